"""The window: what happens when, what is where, and what keys, buttons and dropped files ask for."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from wgsss import console
from wgsss.errors import InputError, RenderError
from wgsss.gpu import Gpu
from wgsss.methods import Method
from wgsss.viewer import keys, memory
from wgsss.viewer.gallery import Gallery
from wgsss.viewer.painter import Painter
from wgsss.viewer.panels import OPEN, PANEL_WIDTH, panels
from wgsss.viewer.pointer import Pointer
from wgsss.viewer.state import LEFT, RIGHT, Source, State
from wgsss.viewer.trail import Trail

SIZE = 960, 540
"""of the window, logical pixels, the first time"""
POLL_S = 0.2
"""between looks at how far a reference is"""
WATCH_S = 0.5
"""between looks at the shaders' files"""
AGAIN_S = 0.1
"""until a frame is drawn again that the screen did not take"""
LONGEST_S = 0.5
"""of time that a frame may take: what is played does not skip what was not shown"""


def loop() -> Any:
    """The loop that windows live in."""
    from rendercanvas.glfw import loop

    return loop


class Window:
    """A window on a state. Drawn when something has changed, and while something moves."""

    def __init__(self, state: State, gpu: Gpu, size: tuple[int, int] | None = None) -> None:
        """`size` in logical pixels: by default what it was the last time."""
        import glfw
        from rendercanvas.glfw import RenderCanvas

        from wgsss.viewer.ui import Ui

        self.state, self.gpu = state, gpu
        self.painter, self.trail = Painter(gpu), Trail()
        remembered = memory.recall()
        self.open_panels = set(remembered.get("open", OPEN))
        self._size: tuple[float, float] = SIZE
        self._clock: float | None = None
        """when the last frame of what is played was drawn"""
        self._is_lost = False
        size = size or tuple(remembered.get("size", SIZE))
        self.canvas = RenderCanvas(size=size, title=f"wgsss: {state.source.scene}", update_mode="ondemand")
        self.ui = Ui(gpu.device, self.canvas, self._declare, lambda: self.region[0])
        self.gallery = Gallery(gpu, self.ui.backend)
        self.pointer = Pointer(self)
        self.canvas.add_event_handler(partial(keys.press, self), "key_down")
        on_drop: Any = lambda window, paths: self.drop(paths)  # noqa: E731
        glfw.set_drop_callback(self.canvas._window, on_drop)
        self.canvas.request_draw(self._draw)

    def run(self) -> None:
        """Until the window is closed. Raises RenderError where the device is lost."""
        self._watch()
        try:
            loop().run()
        finally:
            self.painter.truth.close()
        memory.remember({"size": self._size, "open": sorted(self.open_panels)})
        if self._is_lost:
            raise RenderError(f"{self.gpu.name}: the device was lost; start the viewer again")

    def _watch(self) -> None:
        """Look after the shaders, again and again."""
        if self.painter.reread():
            self.refresh()
        loop().call_later(WATCH_S, self._watch)

    def refresh(self) -> None:
        """Draw again soon."""
        self.canvas.request_draw()

    def _draw(self) -> None:
        state, now = self.state, time.perf_counter()
        if state.playing and self._clock is not None:
            state.time_s += min(now - self._clock, LONGEST_S)
        self._clock = now if state.playing else None
        self._size = self.canvas.get_logical_size()
        if self.painter.paint(state, self.full_size):
            self.gallery.hang(self.painter)
            self.trail.follow(state, self.painter, self.full_size)
        self._present()
        if state.playing or not self.painter.is_done(state, self.full_size):
            self.refresh()
        elif self.painter.truth.is_refining:
            loop().call_later(POLL_S, self.refresh)

    def _present(self) -> None:
        """Show pictures and panel. Raises what wgpu does where the surface is lost: it is there again the next time."""
        import wgpu

        try:
            self.gpu.fence()  # says that the device is lost, where asking a surface for a texture would end the process
            self.ui.render()
        except wgpu.GPUError as error:
            if "device is lost" in str(error):
                self._is_lost = True
                loop().call_soon(self.canvas.close)
                raise wgpu.DrawCancelled from None
            loop().call_later(AGAIN_S, self.refresh)
            raise

    def _declare(self) -> None:
        self.gallery.declare(self)
        panels(self)

    # what is where, in logical pixels

    @property
    def region(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of where pictures are."""
        width, height = self.canvas.get_logical_size()
        left = min(PANEL_WIDTH, 0.5 * width)
        return left, 0.0, max(width - left, 1.0), max(height, 1.0)

    @property
    def full_size(self) -> tuple[int, int]:
        """Of a picture, in pixels of the screen."""
        _, _, width, height = self.region
        ratio = self.canvas.get_pixel_ratio()
        return max(int(width * ratio), 1), max(int(height * ratio), 1)

    @property
    def side(self) -> int:
        """Which picture keys are about: the one shown, or under the pointer."""
        if self.state.comparison in (LEFT, RIGHT):
            return (LEFT, RIGHT).index(self.state.comparison)
        left, _, across, _ = self.region
        return int((self.pointer.at[0] - left) / across > self.state.divider)

    # what keys, buttons and dropped files ask for

    def attempt(self, act: Any) -> None:
        """Do something that bad input may keep from being done; say so."""
        try:
            act()
        except InputError as error:
            self.state.note(str(error))
        self.refresh()

    def drop(self, paths: list[str]) -> None:
        """Open a scene or a mesh, or wear a material, from files dropped on the window."""
        for path in paths:
            self.attempt(partial(self._take, path))

    def _take(self, path: str) -> None:
        """A scene where it is one, else a material."""
        try:
            self.open(Source(path))
        except InputError:
            if Path(path).suffix.lower() != ".toml":
                raise
            self.state.wear(path)

    def open(self, source: Source) -> None:
        """Show another scene. Raises InputError for what is wrong with it."""
        opened = State.open(source, self.state.methods)
        self.state = replace(
            self.state, source=source, opened=opened.opened, scene=opened.scene, material=None, time_s=0.0
        )
        self.canvas.set_title(f"wgsss: {source.scene}")

    def change_method(self, side: int, method: Method) -> None:
        self.state.methods[side] = method
        self.refresh()

    def screenshot(self, side: int | None = None) -> list[Path]:
        """Write what is shown of a side, by default the one that keys are about, PNG and EXR, as the command would."""
        from wgsss.output import save
        from wgsss.rendering import AOVS, Renderer

        state = self.state
        method = state.methods[self.side if side is None else side]
        image = Renderer(state.scene, method, self.full_size, self.gpu).frame(state.time_s, AOVS)
        stem = f"{Path(state.source.scene).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
        files = [path for suffix in (".png", ".exr") for path in save(image, Path(stem + suffix))]
        state.note(f"wrote {', '.join(map(str, files))}")
        return files

    def copy_command(self, side: int | None = None) -> str:
        """Put the command that draws a side, by default the one that keys are about, on the clipboard."""
        import glfw

        command = self.state.command(self.side if side is None else side, self.full_size)
        with suppress(glfw.GLFWError):
            glfw.set_clipboard_string(self.canvas._window, command)
        with suppress(InputError, BrokenPipeError):
            console.print_result(f"copied: {command}")
        self.state.note(f"copied: {command}")
        return command
