"""The viewer: a window that compares two methods, drawn with the same passes as `wgsss render`.

A `Session` holds what is shown and knows no window. Panels, gallery and controls take a session; `Window` puts them
together.
"""
