"""The whole panel: the controls of the comparison, and a section below each heading."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

from imgui_bundle import imgui

from wgsss.registry import name_of
from wgsss.viewer.panels.errors import declare_errors
from wgsss.viewer.panels.light import declare_light
from wgsss.viewer.panels.material import declare_material
from wgsss.viewer.panels.method import declare_method
from wgsss.viewer.panels.passes import declare_passes
from wgsss.viewer.panels.widgets import CLAMPED, button_row, choice, rounded
from wgsss.viewer.pictures import LAYERS
from wgsss.viewer.session import COMPARISONS, SIDES, SPLIT, Session

LABEL_WIDTH = 110
"""logical pixels to the right of a control, for its label"""
NOTES_HEIGHT = 92
"""logical pixels"""
KEY_WIDTH = 130
"""width of the column of keys in the list of KEYS, logical pixels"""
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
    ("P", "give the keys to this panel:"),
    ("  arrows, Tab", "from control to control"),
    ("  space", "hold; arrows change it"),
    ("  enter", "open, press, or type a value"),
    ("  escape", "back to the pictures"),
)
OPEN_HEADINGS = (*SIDES, "passes")
"""headings that are open in the first window"""


class Panel:
    """The panel of a session."""

    def __init__(self, session: Session, open_headings: Iterable[str]) -> None:
        self._session = session
        self.open_headings = set(open_headings)

    def declare(self) -> None:
        """Declare the panel for this frame, with the notes below it if there are any."""
        session, layout = self._session, self._session.layout
        notes_height = NOTES_HEIGHT if session.notes else 0
        _begin("wgsss", layout.panel_width, 0, layout.height - notes_height)
        imgui.push_item_width(-LABEL_WIDTH)
        _declare_comparison(session)
        for side, name in enumerate(SIDES):
            if self._declare_heading(name, f"{name}: {name_of(session.methods[side])}"):
                imgui.push_id(side)
                _declare_side(session, side)
                imgui.pop_id()
        for name, declare in _SECTIONS.items():
            if self._declare_heading(name, name):
                imgui.push_id(name)
                declare(session)
                imgui.pop_id()
        imgui.pop_item_width()
        imgui.end()
        if notes_height:
            _begin("notes", layout.panel_width, layout.height - notes_height, notes_height)
            for note in session.notes:
                imgui.text_wrapped(note)
            imgui.end()

    def _declare_heading(self, name: str, title: str) -> bool:
        """Declare a heading. Return whether it is open."""
        imgui.set_next_item_open(name in self.open_headings, imgui.Cond_.once)
        is_open: bool = imgui.collapsing_header(f"{title}###{name}")
        (self.open_headings.add if is_open else self.open_headings.discard)(name)
        return is_open


def _begin(name: str, width: float, top: float, height: float) -> None:
    """Begin a part of the panel that scrolls independently."""
    imgui.set_next_window_pos((0, top))
    imgui.set_next_window_size((width, height))
    flags = imgui.WindowFlags_
    imgui.begin(name, None, flags.no_move | flags.no_resize | flags.no_collapse | flags.no_title_bar)


def _declare_comparison(session: Session) -> None:
    """Declare the choice of comparison and layer, the divider, exposure and bloom."""
    session.comparison = choice("show", session.comparison, COMPARISONS)
    session.layer = choice("layer", session.layer, LAYERS)
    if session.comparison == SPLIT:
        session.divider = imgui.slider_float("divider", session.divider, 0.0, 1.0, "%.2f", CLAMPED)[1]
    for name, low, high in (("exposure", -6.0, 6.0), ("bloom", 0.0, 1.0)):
        changed, value = imgui.slider_float(name, getattr(session.scene, name), low, high, "%.2f", CLAMPED)
        if changed:
            change: dict[str, Any] = {name: rounded(value)}
            session.scene = replace(session.scene, **change)
    button_row(session, {"reset view, lights": session.reset, "swap sides": session.swap_sides})


def _declare_side(session: Session, side: int) -> None:
    """Declare the method of a side, and the buttons that save its picture or copy its command."""
    declare_method(session, side)
    actions = {"screenshot": session.screenshot, "copy as command": session.copy_command}
    button_row(session, {label: partial(action, side) for label, action in actions.items()})


def _declare_time(session: Session) -> None:
    """Declare the controls of the animation."""
    button_row(session, {"pause" if session.is_playing else "play": session.play_or_pause, "step": session.step})
    changed, seconds = imgui.drag_float("seconds", session.time_s, 0.02, 0.0, 1e4, "%.2f")
    if changed:
        session.time_s = max(rounded(seconds), 0.0)


def _declare_keys(session: Session) -> None:
    """Declare the list of keys and their actions."""
    for key, action in KEYS:
        imgui.text(key)
        imgui.same_line(KEY_WIDTH)
        imgui.text_wrapped(action)


_SECTIONS = {
    "light": declare_light,
    "material": declare_material,
    "time": _declare_time,
    "errors": declare_errors,
    "passes": declare_passes,
    "keys": _declare_keys,
}
