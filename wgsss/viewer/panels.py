"""The panel beside the pictures: its headings, and what is under none. What it offers is read from methods, materials
and lights: nothing is listed twice."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from wgsss.registry import name_of
from wgsss.viewer import chart, costs, knobs, lamps, media
from wgsss.viewer.costs import SIDES
from wgsss.viewer.pictures import LAYERS
from wgsss.viewer.state import COMPARISONS, SPLIT

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

PANEL_WIDTH = 330
"""logical pixels"""
LABELS = 110
"""logical pixels of the panel's width, for what stands right of a control"""
NOTES = 92
"""logical pixels of the panel's height, for what went wrong"""
KEYS = (
    ("drag, arrows", "orbit"),
    ("shift or right drag", "pan (shift arrows)"),
    ("wheel, + -", "zoom"),
    ("ctrl drag", "turn the light"),
    ("double click, F", "look at that point"),
    ("1 2 3 4", "split, left, right, error"),
    ("Tab, X", "flicker, swap sides"),
    ("L", "next layer"),
    ("E", "senders of the vertex"),
    ("space, .", "play or pause, step"),
    ("S, C", "screenshot, copy command"),
    ("R, Q", "reset view and lights, close"),
    ("P", "this panel takes the keys:"),
    ("  arrows, Tab", "from control to control"),
    ("  space", "take hold; arrows change it"),
    ("  enter", "open, press, or type a value"),
    ("  escape", "back to the pictures"),
)
"""and what they do"""
KEYS_WIDTH = 130
"""logical pixels"""
OPEN = {*SIDES, "passes"}
"""headings that are open the first time"""


def panels(window: Window) -> None:
    """Declare the panel for this frame."""
    from imgui_bundle import imgui

    _, height = window.canvas.get_logical_size()
    below = NOTES if window.state.notes else 0
    _begin("wgsss", window.region[0], 0, height - below)
    imgui.push_item_width(-LABELS)
    _compared(window)
    for side, name in enumerate(SIDES):
        if _heading(window, name, f"{name}: {name_of(window.state.methods[side])}"):
            imgui.push_id(side)
            _side(window, side)
            imgui.pop_id()
    for name, declare in _MORE.items():
        if _heading(window, name, name):
            imgui.push_id(name)
            declare(window)
            imgui.pop_id()
    imgui.pop_item_width()
    imgui.end()
    if below:
        _begin("notes", window.region[0], height - below, below)
        for note in window.state.notes:
            imgui.text_wrapped(note)
        imgui.end()


def _begin(name: str, width: float, top: float, height: float) -> None:
    """A part of the panel that scrolls by itself."""
    from imgui_bundle import imgui

    imgui.set_next_window_pos((0, top))
    imgui.set_next_window_size((width, height))
    flags = imgui.WindowFlags_
    imgui.begin(name, None, flags.no_move | flags.no_resize | flags.no_collapse | flags.no_title_bar)


def _heading(window: Window, name: str, title: str) -> bool:
    """A heading, and whether what is under it is to be declared."""
    from imgui_bundle import imgui

    imgui.set_next_item_open(name in window.open_panels, imgui.Cond_.once)
    is_open: bool = imgui.collapsing_header(f"{title}###{name}")
    (window.open_panels.add if is_open else window.open_panels.discard)(name)
    return is_open


def _row(window: Window, buttons: dict[str, Any]) -> None:
    """Buttons side by side."""
    from imgui_bundle import imgui

    for i, (label, act) in enumerate(buttons.items()):
        if i:
            imgui.same_line()
        if imgui.button(label):
            window.attempt(act)


def _compared(window: Window) -> None:
    """What is shown of the two sides."""
    from imgui_bundle import imgui

    state = window.state
    state.comparison = knobs.choice("show", state.comparison, COMPARISONS)
    state.layer = knobs.choice("layer", state.layer, LAYERS)
    clamped = imgui.SliderFlags_.always_clamp
    if state.comparison == SPLIT:
        state.divider = imgui.slider_float("divider", state.divider, 0.0, 1.0, "%.2f", clamped)[1]
    for name, low, high in (("exposure", -6.0, 6.0), ("bloom", 0.0, 1.0)):
        changed, value = imgui.slider_float(name, getattr(state.scene, name), low, high, "%.2f", clamped)
        if changed:
            shown: Any = {name: knobs.shortened(value)}
            state.scene = replace(state.scene, **shown)
    _row(window, {"reset view, lights": state.reset, "swap sides": state.methods.reverse})


def _side(window: Window, side: int) -> None:
    """A side's method, and what can be taken away of its picture."""
    knobs.method(window, side)
    acts = {"screenshot": window.screenshot, "copy as command": window.copy_command}
    _row(window, {label: partial(act, side) for label, act in acts.items()})


def _time(window: Window) -> None:
    from imgui_bundle import imgui

    state = window.state

    _row(window, {"pause" if state.playing else "play": state.play_or_pause, "step": state.step})
    changed, seconds = imgui.drag_float("seconds", state.time_s, 0.02, 0.0, 1e4, "%.2f")
    if changed:
        state.time_s = max(knobs.shortened(seconds), 0.0)


def _keys(window: Window) -> None:
    from imgui_bundle import imgui

    for key, act in KEYS:
        imgui.text(key)
        imgui.same_line(KEYS_WIDTH)
        imgui.text_wrapped(act)


_MORE = {
    "light": lamps.lamp,
    "material": media.medium,
    "time": _time,
    "errors": chart.errors,
    "passes": costs.costs,
    "keys": _keys,
}
