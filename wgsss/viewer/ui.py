"""Dear ImGui in the window: its font, when it is drawn, and which of pointer and keys are its own."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

FONT_SIZE = 14.0
"""logical pixels: what is drawn has as many as the display's scale asks for"""
FRAMES = 3
"""after each input: a press, its release and what they open are told one by one"""
REST_S = 0.6
"""after the last input, when help is shown on what is under the pointer"""


class Ui:
    """Declared anew for each frame.

    What is left of `width()`, logical pixels, is its own, and what begins there. wgpu's renderer asks the last frame
    whose an event is, which where frames are slow may be long ago: pointers are followed here in its place.
    """

    def __init__(self, device: Any, canvas: Any, declare: Callable[[], None], width: Callable[[], float]) -> None:
        import matplotlib
        from imgui_bundle import imgui, implot
        from rendercanvas.glfw import loop
        from wgpu.utils.imgui import ImguiRenderer

        self._canvas, self._declare, self._width, self._loop = canvas, declare, width, loop

        class Renderer(ImguiRenderer):
            def _on_pointer(self, event: Any) -> None:
                pass

            _on_mouse = _on_mouse_move = _on_wheel = _on_pointer

        self._renderer = Renderer(device, canvas, "bgra8unorm")
        self._renderer.KEY_MAP = {**ImguiRenderer.KEY_MAP, " ": imgui.Key.space}
        self._renderer.set_gui(self._gui)
        implot.create_context()
        self.backend = self._renderer.backend
        self._io = self.backend.io
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._io.fonts.add_font_from_file_ttf(str(fonts / "DejaVuSans.ttf"), FONT_SIZE)
        self._io.config_nav_escape_clear_focus_window = True
        self._owed, self._drawn_s, self._woken_s, self._is_resting = FRAMES, 0.0, 0.0, False
        self._has_keys = self._is_entering = False
        self._is_ours = self._has_popup = False
        self._untold: deque[tuple[str, Callable[[], None]]] = deque()
        """what pointers did, by kind of event"""
        pointer = "pointer_down", "pointer_move", "pointer_up", "wheel", "double_click"
        canvas.add_event_handler(self._on_pointer, *pointer, order=-100)
        canvas.add_event_handler(self._on_key, "key_down", "key_up", "char", order=-100)
        canvas.add_event_handler(self._keep_key, "key_down", "key_up", order=-98)  # after the renderer has told of it
        canvas.add_event_handler(lambda event: self._wake(), "resize", order=-100)

    def render(self) -> None:
        """Draw a frame, and ask for those that are still owed."""
        now = time.perf_counter()
        self._io.delta_time = float(np.clip(now - self._drawn_s, 1e-3, 1.0))
        self._drawn_s = now
        self._tell()
        self._renderer.render()
        self._owed = max(self._owed - 1, 0)
        if self._owed or self._untold:
            self._canvas.request_draw()

    def take_keys(self) -> None:
        """The panel's from now on, until escape or a click on the picture."""
        from imgui_bundle import imgui

        self._io.config_flags |= imgui.ConfigFlags_.nav_enable_keyboard
        self._has_keys = self._is_entering = True

    def _gui(self) -> None:
        from imgui_bundle import imgui

        if self._is_entering:
            imgui.set_next_window_focus()
            imgui.set_nav_cursor_visible(True)
            self._is_entering = False
        elif self._has_keys and not self._io.nav_active:
            self._io.config_flags &= ~imgui.ConfigFlags_.nav_enable_keyboard
            self._has_keys = False
        self._declare()
        self._has_popup = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)

    def _tell(self) -> None:
        """Tell Dear ImGui what pointers did: in one frame no more than that one went somewhere and was pressed there,
        or was released. Told of all at once, it would not see where one was dragged."""
        told: set[str] = set()
        while self._untold:
            kind, tell = self._untold[0]
            if (kind == "pointer_move" and told - {kind}) or (kind == "pointer_up" and told):
                break
            self._untold.popleft()
            told.add(kind)
            tell()

    def _on_pointer(self, event: Any) -> None:
        io, kind = self._io, event["event_type"]
        if kind in ("pointer_down", "pointer_up"):
            self._untold.append((kind, lambda: io.add_mouse_button_event(event["button"] - 1, kind == "pointer_down")))
        elif kind == "pointer_move":
            self._untold.append((kind, lambda: io.add_mouse_pos_event(event["x"], event["y"])))
        elif kind == "wheel":
            self._untold.append((kind, lambda: io.add_mouse_wheel_event(event["dx"] / 100, -event["dy"] / 100)))
        if kind != "pointer_up" and len(event["buttons"]) <= (kind == "pointer_down"):
            self._is_ours = self._has_popup or event["x"] < self._width()
        event["stop_propagation"] = self._is_ours
        self._wake(self._owed + FRAMES if self._is_ours and kind != "pointer_move" else FRAMES)

    def _on_key(self, event: Any) -> None:
        self._io.want_capture_keyboard |= self._has_keys
        self._wake(self._owed + FRAMES if self._io.want_capture_keyboard else FRAMES)

    def _keep_key(self, event: Any) -> None:
        """The renderer passes on keys that Dear ImGui has no name for, such as a point that is typed."""
        event["stop_propagation"] = self._io.want_capture_keyboard

    def _wake(self, frames: int = FRAMES) -> None:
        """Draw so many frames at least, and one more when nothing else comes."""
        self._owed = max(self._owed, frames)
        self._woken_s = time.perf_counter()
        self._canvas.request_draw()
        if not self._is_resting:
            self._is_resting = True
            self._loop.call_later(REST_S, self._rest)

    def _rest(self) -> None:
        left = self._woken_s + REST_S - time.perf_counter()
        if left > 0.0:
            self._loop.call_later(left, self._rest)
        else:
            self._is_resting = False
            self._owed = max(self._owed, FRAMES)
            self._canvas.request_draw()
