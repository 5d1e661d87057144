"""The window: puts session, controls, panel and pictures together, and decides when to draw a frame."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import glfw
import wgpu
from platformdirs import user_state_path
from rendercanvas.glfw import RenderCanvas, loop

from wgsss.errors import RenderError
from wgsss.viewer.controls import Controls
from wgsss.viewer.gallery import Gallery
from wgsss.viewer.layout import Layout
from wgsss.viewer.panels.panel import OPEN_HEADINGS, Panel
from wgsss.viewer.session import Session
from wgsss.viewer.ui import Ui

DEFAULT_SIZE = 960, 540
"""of the window, logical pixels"""
REFERENCE_POLL_S = 0.2
"""time between looks for a better estimate of a reference"""
SHADER_POLL_S = 0.5
"""time between looks for changed shaders"""
RETRY_S = 0.1
"""time until the next frame after one that could not be shown"""
MAX_TIME_STEP_S = 0.5
"""longest step of the animation from frame to frame: it does not skip the time that one slow frame takes"""


class Window:
    """A window on a session. It draws a frame when something has changed, and while something moves."""

    def __init__(self, session: Session, size: tuple[int, int] | None = None) -> None:
        """`size` is in logical pixels. None: the size of the window that was closed last."""
        self.session, self._gpu = session, session.painter.gpu
        settings = _load_settings()
        self._frame_s: float | None = None
        """when the last frame of an animation that plays was drawn"""
        self._is_device_lost = False
        size = size or tuple(settings.get("size", DEFAULT_SIZE))
        self.canvas = RenderCanvas(size=size, title=self._title, update_mode="ondemand")
        self.canvas.add_event_handler(lambda event: self._update_layout(), "resize", order=-200)
        self._update_layout()
        session.refresh, session.copy_text = self.canvas.request_draw, self._copy_text
        self._ui = Ui(self._gpu, self.canvas, self._declare, lambda: session.layout.panel_width)
        self._gallery = Gallery(session, self._gpu, self._ui.backend)
        self._panel = Panel(session, settings.get("open", OPEN_HEADINGS))
        Controls(session, self.canvas, {"p": self._ui.take_keyboard, "q": self.canvas.close})
        on_drop: Any = self._on_drop  # glfw declares other parameters than it passes
        glfw.set_drop_callback(self.canvas._window, on_drop)
        self.canvas.request_draw(self._draw)

    def run(self) -> None:
        """Show the window until it is closed. Raises RenderError if the device is lost."""
        self._poll_shaders()
        try:
            loop.run()
        finally:
            self.session.painter.reference.close()
        layout = self.session.layout
        _save_settings({"size": [layout.width, layout.height], "open": sorted(self._panel.open_headings)})
        if self._is_device_lost:
            raise RenderError(f"{self._gpu.name}: the device was lost; start the viewer again")

    @property
    def _title(self) -> str:
        return f"wgsss: {self.session.source.scene}"

    def _update_layout(self) -> None:
        width, height = self.canvas.get_logical_size()
        self.session.layout = Layout(width, height, self.canvas.get_pixel_ratio())

    def _poll_shaders(self) -> None:
        """Draw again if a shader has changed, and look again later."""
        if self.session.painter.reload_shaders():
            self.session.refresh()
        loop.call_later(SHADER_POLL_S, self._poll_shaders)

    def _draw(self) -> None:
        """Draw a frame, and request the next one if the pictures are not final."""
        session, now = self.session, time.perf_counter()
        self._update_layout()
        if session.is_playing and self._frame_s is not None:
            session.time_s += min(now - self._frame_s, MAX_TIME_STEP_S)
        self._frame_s = now if session.is_playing else None
        if session.paint():
            self._gallery.update_textures()
        self._present()
        if session.is_playing or not session.painter.is_done(session.view):
            session.refresh()
        elif session.painter.reference.is_refining:
            loop.call_later(REFERENCE_POLL_S, session.refresh)

    def _present(self) -> None:
        """Draw the user interface on the screen.

        Raises the error of wgpu if the window's surface is lost; the next frame recreates it. If the device is lost,
        close the window.
        """
        try:
            self._gpu.fence()  # raises if the device is lost; asking a surface for a texture then would end the process
            self._ui.render()
        except wgpu.GPUError as error:
            if "device is lost" in str(error):
                self._is_device_lost = True
                loop.call_soon(self.canvas.close)
                raise wgpu.DrawCancelled from None
            loop.call_later(RETRY_S, self.session.refresh)
            raise

    def _declare(self) -> None:
        """Declare the content of a frame for Dear ImGui."""
        self._gallery.declare()
        self._panel.declare()

    def _on_drop(self, window: object, paths: list[str]) -> None:
        """Open files that were dropped on the window, one after the other."""
        for path in paths:
            self.session.attempt(partial(self.session.open_file, path))
        self.canvas.set_title(self._title)

    def _copy_text(self, text: str) -> None:
        """Put a text on the clipboard, unless the system has none."""
        with suppress(glfw.GLFWError):
            glfw.set_clipboard_string(self.canvas._window, text)


def _settings_file() -> Path:
    return user_state_path("wgsss") / "viewer.json"


def _load_settings() -> dict[str, Any]:
    """Return the `size` and `open` headings of the last window; an empty table if the file is missing or damaged."""
    with suppress(OSError, ValueError):
        settings = json.loads(_settings_file().read_text())
        if isinstance(settings, dict):
            return settings
    return {}


def _save_settings(settings: dict[str, Any]) -> None:
    """Write the settings for the next window, unless the folder cannot be written."""
    with suppress(OSError):
        _settings_file().parent.mkdir(parents=True, exist_ok=True)
        _settings_file().write_text(json.dumps(settings))
