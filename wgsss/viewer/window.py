"""The window: what happens when, what is where, and what keys, buttons and dropped files ask for."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.methods import Method
from wgsss.viewer import keys, memory
from wgsss.viewer.gallery import Gallery
from wgsss.viewer.painter import Painter
from wgsss.viewer.panels import OPEN, PANEL_WIDTH, panels
from wgsss.viewer.pointer import Pointer
from wgsss.viewer.state import LEFT, RIGHT, Source, State

SIZE = 960, 540
"""of the window, logical pixels, the first time"""
POLL_S = 0.2
"""between looks at how far a reference is"""
WATCH_S = 0.5
"""between looks at the shaders' files"""


def loop() -> Any:
    """The loop that windows live in."""
    from rendercanvas.glfw import loop

    return loop


class Window:
    """A window on a state. Drawn when something has changed, and while something moves."""

    def __init__(self, state: State, gpu: Gpu, size: tuple[int, int] | None = None) -> None:
        """`size` in logical pixels: by default what it was the last time."""
        import glfw
        from imgui_bundle import implot
        from rendercanvas.glfw import RenderCanvas
        from wgpu.utils.imgui import ImguiRenderer

        self.state, self.gpu = state, gpu
        self.painter = Painter(gpu)
        remembered = memory.recall()
        self.open_panels = set(remembered.get("open", OPEN))
        self._size: tuple[float, float] = SIZE
        self._clock = time.perf_counter()
        size = size or tuple(remembered.get("size", SIZE))
        self.canvas = RenderCanvas(size=size, title=f"wgsss: {state.source.scene}", update_mode="ondemand")
        self.ui = ImguiRenderer(gpu.device, self.canvas, "bgra8unorm")
        implot.create_context()
        self.gallery = Gallery(gpu, self.ui.backend)
        self.ui.set_gui(self._declare)
        self.pointer = Pointer(self)
        self.canvas.add_event_handler(partial(keys.press, self), "key_down")
        self.canvas.add_event_handler(lambda event: self.refresh(), "resize", "key_up", "char")
        on_drop: Any = lambda window, paths: self.drop(paths)  # noqa: E731
        glfw.set_drop_callback(self.canvas._window, on_drop)
        self.canvas.request_draw(self._draw)

    def run(self) -> None:
        """Until the window is closed."""
        self._watch()
        loop().run()
        self.painter.truth.close()
        memory.remember({"size": self._size, "open": sorted(self.open_panels)})

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
        if state.playing:
            state.time_s += now - self._clock
        self._clock = now
        self._size = self.canvas.get_logical_size()
        if self.painter.paint(state, self.full_size):
            self.gallery.hang(self.painter)
        self.ui.render()
        if state.playing or not self.painter.is_done(state, self.full_size):
            self.refresh()
        elif self.painter.truth.is_refining:
            loop().call_later(POLL_S, self.refresh)

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
        methods, notes = self.state.methods, self.state.notes
        self.state = replace(State.open(source, methods), notes=notes)
        self.canvas.set_title(f"wgsss: {source.scene}")

    def change_method(self, side: int, method: Method) -> None:
        self.state.methods[side] = method
        self.refresh()

    def screenshot(self) -> list[Path]:
        """Write what is shown of one side, PNG and EXR, as the command would."""
        from wgsss.output import save
        from wgsss.rendering import AOVS, Renderer

        state = self.state
        method = state.methods[self.side]
        image = Renderer(state.scene, method, self.full_size, self.gpu).frame(state.time_s, AOVS)
        stem = f"{Path(state.source.scene).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
        files = [path for suffix in (".png", ".exr") for path in save(image, Path(stem + suffix))]
        state.note(f"wrote {', '.join(map(str, files))}")
        return files

    def copy_command(self) -> str:
        """Put the command that draws a side on the clipboard."""
        import glfw

        command = self.state.command(self.side, self.full_size)
        with suppress(glfw.GLFWError):
            glfw.set_clipboard_string(self.canvas._window, command)
        print(f"copied: {command}", flush=True)
        self.state.note(f"copied: {command}")
        return command
