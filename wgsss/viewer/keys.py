"""What keys do."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from wgsss.viewer.pictures import LAYERS
from wgsss.viewer.state import COMPARISONS, LEFT, RIGHT

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

KEY_STEP = 0.03
"""heights of the picture that an arrow key drags"""
_ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, -1), "ArrowDown": (0, 1)}


def press(window: Window, event: Any) -> None:
    """Do what the key of a `key_down` event stands for, if anything."""
    key, acts = event["key"], _acts(window)
    if key in _ARROWS:
        x, y = (KEY_STEP * window.region[3] * step for step in _ARROWS[key])
        window.pointer.drag("pan" if "Shift" in event.get("modifiers", ()) else "orbit", x, y)
    elif key in acts:
        window.attempt(acts[key])
    window.refresh()


def _acts(window: Window) -> dict[str, Callable[[], Any]]:
    """What other keys do."""
    state, pointer = window.state, window.pointer

    def compare(comparison: str) -> None:
        state.comparison = comparison

    def next_layer() -> None:
        state.layer = LAYERS[(LAYERS.index(state.layer) + 1) % len(LAYERS)]

    def entries() -> None:
        state.shows_entries = not state.shows_entries

    return {
        "+": lambda: pointer.zoom(1.1),
        "=": lambda: pointer.zoom(1.1),
        "-": lambda: pointer.zoom(1 / 1.1),
        " ": state.play_or_pause,
        ".": state.step,
        **{str(i + 1): partial(compare, comparison) for i, comparison in enumerate(COMPARISONS)},
        "Tab": lambda: compare(LEFT if state.comparison == RIGHT else RIGHT),
        "x": state.methods.reverse,
        "l": next_layer,
        "e": entries,
        "r": state.reset,
        "f": lambda: pointer.focus(*pointer.at),
        "p": window.ui.take_keys,
        "s": window.screenshot,
        "c": window.copy_command,
        "q": window.canvas.close,
    }
