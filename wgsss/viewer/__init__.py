"""The viewer: a window to compare two methods by hand, on the passes of the offscreen command."""
