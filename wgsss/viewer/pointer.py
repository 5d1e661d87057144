"""What a pointer does to the state: divider, camera and light follow it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.viewer import controls
from wgsss.viewer.state import SPLIT

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

GRIP = 8
"""logical pixels to either side of the divider where it can be dragged"""


class Pointer:
    """Over a window. Places are in logical pixels, y down."""

    def __init__(self, window: Window) -> None:
        self._window = window
        self.at = (0.0, 0.0)
        self._dragged = ""
        handle = window.canvas.add_event_handler
        handle(self._on_move, "pointer_down", "pointer_move", "pointer_up")
        handle(lambda event: self.zoom(1.1 ** (-event["dy"] / 100.0)), "wheel")
        handle(lambda event: self.focus(event["x"], event["y"]), "double_click")

    def _on_move(self, event: Any) -> None:
        x, y, kind = event["x"], event["y"], event["event_type"]
        left, _, across, _ = self._window.region
        state = self._window.state
        if kind == "pointer_down":
            near = abs(x - left - state.divider * across) < GRIP and state.comparison == SPLIT
            modifiers = set(event.get("modifiers", ()))
            if near:
                self._dragged = "divider"
            elif event["button"] == 1 and modifiers & {"Control", "Alt"}:
                self._dragged = "light"
            else:
                self._dragged = "pan" if event["button"] != 1 or "Shift" in modifiers else "orbit"
        elif kind == "pointer_up":
            self._dragged = ""
        elif self._dragged:
            self.drag(self._dragged, x - self.at[0], y - self.at[1])
        self.at = x, y
        self._window.refresh()

    def drag(self, what: str, x: float, y: float) -> None:
        """Drag the divider, the light or the camera (orbit, pan) by so much."""
        state = self._window.state
        _, _, across, down = self._window.region
        right, up = x / down, -y / down
        if what == "divider":
            state.divider = float(np.clip(state.divider + x / across, 0.0, 1.0))
        elif what == "light":
            self._move_light(right, up)
        else:
            turned = {"orbit": controls.orbit, "pan": controls.pan}[what](state.camera, right, up)
            state.scene = replace(state.scene, camera=turned)
        self._window.refresh()

    def _move_light(self, right: float, up: float) -> None:
        """Turn the first light about the middle of the scene."""
        state = self._window.state
        if state.scene.lights:
            first, *others = state.scene.lights
            centre = state.scene.bounds.mean(axis=0)
            moved = controls.turn_light(first, state.camera, right, up, centre)
            state.scene = replace(state.scene, lights=(moved, *others))

    def zoom(self, factor: float) -> None:
        state = self._window.state
        state.scene = replace(state.scene, camera=controls.zoom(state.camera, factor))
        self._window.refresh()

    def focus(self, x: float, y: float) -> None:
        """Look at what is seen at a point of the window."""
        state, point = self._window.state, self.pick(x, y)
        if point is not None:
            state.scene = replace(state.scene, camera=controls.focus(state.camera, point))
            self._window.refresh()

    def pick(self, x: float, y: float) -> Any:
        """The point of the surface that is seen at a point of the window, world mm; None where nothing is."""
        left, top, across, down = self._window.region
        state = self._window.state
        right, up = 2 * (x - left) / across - 1, 1 - 2 * (y - top) / down
        if max(abs(right), abs(up)) > 1.0:
            return None
        return controls.pick(state.scene.at(state.time_s), across / down, right, up)
