"""Dear ImGui in the window: its font, when it is drawn, and when keys are its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

FONT_SIZE = 14.0
"""logical pixels: what is drawn has as many as the display's scale asks for"""
FRAMES = 3
"""after each input: a press, its release and what they open are told one by one"""
REST_S = 0.6
"""after the last input: help is shown by then"""


class Ui:
    """Declared anew for each frame."""

    def __init__(self, device: Any, canvas: Any, declare: Callable[[], None]) -> None:
        import matplotlib
        from imgui_bundle import imgui, implot
        from rendercanvas.glfw import loop
        from wgpu.utils.imgui import ImguiRenderer

        self._canvas, self._declare, self._loop = canvas, declare, loop
        self._renderer = ImguiRenderer(device, canvas, "bgra8unorm")
        self._renderer.KEY_MAP = {**ImguiRenderer.KEY_MAP, " ": imgui.Key.space}
        self._renderer.set_gui(self._gui)
        implot.create_context()
        self.backend = self._renderer.backend
        io = self.backend.io
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        io.fonts.add_font_from_file_ttf(str(fonts / "DejaVuSans.ttf"), FONT_SIZE)
        io.config_nav_escape_clear_focus_window = True
        self._is_entered = self._was_active = False
        self._owed = FRAMES
        events = "pointer_down", "pointer_move", "pointer_up", "wheel", "key_down", "key_up", "char", "resize"
        canvas.add_event_handler(self._wake, *events, order=-100)  # before those that keep an event for themselves

    def render(self) -> None:
        """Draw a frame, and ask for those that are still owed."""
        self._renderer.render()
        if self._owed:
            self._owed -= 1
            self._canvas.request_draw()

    def take_keys(self) -> None:
        """The panel's from now on, until escape or a click on the picture."""
        from imgui_bundle import imgui

        self.backend.io.config_flags |= imgui.ConfigFlags_.nav_enable_keyboard
        self._is_entered = True

    def _gui(self) -> None:
        from imgui_bundle import imgui

        io = self.backend.io
        if self._is_entered:
            imgui.set_next_window_focus()
            imgui.set_nav_cursor_visible(True)
        elif self._was_active and not io.nav_active:
            io.config_flags &= ~imgui.ConfigFlags_.nav_enable_keyboard
        self._was_active = io.nav_active and not self._is_entered
        self._is_entered = False
        self._declare()

    def _wake(self, event: Any) -> None:
        self._owed = FRAMES
        self._canvas.request_draw()
