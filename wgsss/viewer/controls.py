"""Control of a session by pointer and keys."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from rendercanvas.base import BaseRenderCanvas

from wgsss.viewer import manipulation
from wgsss.viewer.pictures import LAYERS
from wgsss.viewer.session import COMPARISONS, LEFT, RIGHT, SPLIT, Session
from wgsss.viewer.ui import Event

Action = Callable[[], object]

DIVIDER, LIGHT, ORBIT, PAN = "divider", "light", "orbit", "pan"
GRIP_WIDTH = 8
"""logical pixels on either side of the divider within which a drag moves it"""
KEY_STEP = 0.03
"""distance that an arrow key drags the camera, relative to the height of the picture"""
ZOOM_STEP = 1.1
"""magnification by a key or by one step of the wheel"""
_ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, -1), "ArrowDown": (0, 1)}


class Controls:
    """Changes a session as the events of a canvas ask. Positions are in logical pixels, y down."""

    def __init__(self, session: Session, canvas: BaseRenderCanvas, window_keys: dict[str, Action]) -> None:
        """`window_keys` are actions by key that concern the window and not the session."""
        self._session = session
        self._dragged = ""
        """DIVIDER, LIGHT, ORBIT or PAN; empty: nothing is dragged"""
        self._keys = {**self._session_keys(), **window_keys}
        canvas.add_event_handler(self._on_pointer, "pointer_down", "pointer_move", "pointer_up")
        canvas.add_event_handler(self._on_wheel, "wheel")
        canvas.add_event_handler(self._on_double_click, "double_click")
        canvas.add_event_handler(self._on_key, "key_down")

    def _on_pointer(self, event: Event) -> None:
        """Start, continue or end a drag."""
        x, y, kind = event["x"], event["y"], event["event_type"]
        session = self._session
        if kind == "pointer_down":
            self._dragged = self._target(x, event["button"], set(event.get("modifiers", ())))
        elif kind == "pointer_up":
            self._dragged = ""
        elif self._dragged:
            self._drag(self._dragged, x - session.pointer[0], y - session.pointer[1])
        session.pointer = x, y
        session.refresh()

    def _on_wheel(self, event: Event) -> None:
        self._zoom(ZOOM_STEP ** (-event["dy"] / 100.0))

    def _on_double_click(self, event: Event) -> None:
        self._focus(event["x"], event["y"])

    def _on_key(self, event: Event) -> None:
        """Run the action of a key, if it has one."""
        key, session = event["key"], self._session
        if key in _ARROWS:
            x, y = (KEY_STEP * session.layout.picture_height * step for step in _ARROWS[key])
            self._drag(PAN if "Shift" in event.get("modifiers", ()) else ORBIT, x, y)
        elif key in self._keys:
            session.attempt(self._keys[key])
        session.refresh()

    def _target(self, x: float, button: int, modifiers: set[str]) -> str:
        """Return the target of a drag that starts at `x` with a button: DIVIDER, LIGHT, ORBIT or PAN."""
        session, layout = self._session, self._session.layout
        divider_x = layout.panel_width + session.divider * layout.picture_width
        if session.comparison == SPLIT and abs(x - divider_x) < GRIP_WIDTH:
            return DIVIDER
        if button == 1 and modifiers & {"Control", "Alt"}:
            return LIGHT
        return PAN if button != 1 or "Shift" in modifiers else ORBIT

    def _drag(self, target: str, x: float, y: float) -> None:
        """Move the divider, the first light or the camera by a distance that the pointer moved."""
        session, layout = self._session, self._session.layout
        right, up = x / layout.picture_height, -y / layout.picture_height
        if target == DIVIDER:
            session.divider = float(np.clip(session.divider + x / layout.picture_width, 0.0, 1.0))
        elif target == LIGHT:
            if session.scene.lights:
                centre = session.scene.bounds.mean(axis=0)
                light = manipulation.turn_light(session.scene.lights[0], session.camera, right, up, centre)
                session.set_first_light(light)
        else:
            move = manipulation.orbit if target == ORBIT else manipulation.pan
            session.set_camera(move(session.camera, right, up))
        session.refresh()

    def _zoom(self, factor: float) -> None:
        self._session.set_camera(manipulation.zoom(self._session.camera, factor))

    def _focus(self, x: float, y: float) -> None:
        """Make the camera look at the point of the surface that is seen at a position of the window."""
        point = self._session.pick(x, y)
        if point is not None:
            self._session.set_camera(manipulation.focus(self._session.camera, point))

    def _session_keys(self) -> dict[str, Action]:
        """Return the actions of all keys but the arrows."""
        session = self._session

        def compare(comparison: str) -> None:
            session.comparison = comparison

        def show_next_layer() -> None:
            session.layer = LAYERS[(LAYERS.index(session.layer) + 1) % len(LAYERS)]

        def toggle_senders() -> None:
            session.shows_senders = not session.shows_senders

        return {
            "+": lambda: self._zoom(ZOOM_STEP),
            "=": lambda: self._zoom(ZOOM_STEP),
            "-": lambda: self._zoom(1 / ZOOM_STEP),
            " ": session.play_or_pause,
            ".": session.step,
            **{str(i + 1): partial(compare, comparison) for i, comparison in enumerate(COMPARISONS)},
            "Tab": lambda: compare(LEFT if session.comparison == RIGHT else RIGHT),
            "x": session.swap_sides,
            "l": show_next_layer,
            "e": toggle_senders,
            "r": session.reset,
            "f": lambda: self._focus(*session.pointer),
            "s": session.screenshot,
            "c": session.copy_command,
        }
