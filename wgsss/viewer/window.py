"""The window: what pointer, keys and files do to the state, and the pictures that it shows of it."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wgsss.errors import InputError, RenderError
from wgsss.gpu import Gpu
from wgsss.methods import Method
from wgsss.reference import REFERENCES, Integral
from wgsss.study import error_maps
from wgsss.viewer import controls, memory
from wgsss.viewer.entries import adjacency, links
from wgsss.viewer.measure import WHOLE, Measured, measure
from wgsss.viewer.pace import STILL_S, Pace
from wgsss.viewer.panels import OPEN, PANEL_WIDTH, panels
from wgsss.viewer.pictures import LAYERS, Drawing, Easel, Picture
from wgsss.viewer.reload import Shaders
from wgsss.viewer.sheet import Sheet
from wgsss.viewer.state import COMPARISONS, ERROR, LEFT, RIGHT, SPLIT, Source, State
from wgsss.viewer.truth import Known, Truth, View
from wgsss.wgsl import WgslError

SIZE = 960, 540
"""of the window, logical pixels, the first time"""
GRIP = 8
"""logical pixels to either side of the divider where it can be dragged"""
POLL_S = 0.2
"""between looks at how far a reference is"""
WATCH_S = 0.5
"""between looks at the shaders' files"""
STEP_S = 1 / 25
"""of time, by the key"""
KEY_STEP = 0.03
"""heights of the picture that an arrow key drags"""


def _is_reference(method: Method) -> bool:
    return type(method) in REFERENCES.values()


def loop() -> Any:
    """The loop that windows live in."""
    from rendercanvas.glfw import loop

    return loop


class Window:
    """A window on a state. Drawn when something has changed, and while something moves."""

    def __init__(self, state: State, gpu: Gpu, size: tuple[int, int] | None = None) -> None:
        """`size` in logical pixels: by default what it was the last time."""
        from imgui_bundle import implot
        from rendercanvas.glfw import RenderCanvas
        from wgpu.utils.imgui import ImguiRenderer

        self.state, self.gpu = state, gpu
        self.easel, self.pace, self.shaders = Easel(gpu), Pace(), Shaders()
        self.truth = Truth()
        self.drawing: Drawing | None = None
        self.sides: list[Picture | None] = [None, None]
        """the pictures of the left and the right side: None is a reference that is not known yet"""
        self.measured: Measured | None = None
        self.scale = 1.0
        """share of the full size that the pictures have"""
        self.seconds = 0.0
        """that the last picture took"""
        remembered = memory.recall()
        self.open_panels = set(remembered.get("open", OPEN))
        self._drawn: Any = None
        """the view that was drawn last, how finely, and with which reference"""
        self._last_known: Known | None = None
        self._present: list[Method] = []
        self._changed_s = -1.0
        self._size: tuple[float, float] = SIZE
        self._dragged = ""
        self._at = (0.0, 0.0)
        self._clock = time.perf_counter()
        size = size or tuple(remembered.get("size", SIZE))
        self.canvas = RenderCanvas(size=size, title=f"wgsss: {state.source.scene}", update_mode="ondemand")
        self.ui = ImguiRenderer(gpu.device, self.canvas, "bgra8unorm")
        implot.create_context()
        self.sheets = Sheet(gpu, self.ui.backend), Sheet(gpu, self.ui.backend)
        self.map, self.colours = Sheet(gpu, self.ui.backend), Sheet(gpu, self.ui.backend)
        self.ui.set_gui(self._gui)
        handle = self.canvas.add_event_handler
        handle(self._on_pointer, "pointer_down", "pointer_move", "pointer_up")
        handle(self._on_wheel, "wheel")
        handle(self._on_double_click, "double_click")
        handle(self._on_key, "key_down")
        handle(lambda event: self.refresh(), "resize", "key_up", "char")
        self._take_drops()
        self.canvas.request_draw(self._draw)

    def run(self) -> None:
        """Until the window is closed."""
        self._watch()
        loop().run()
        self.truth.close()
        memory.remember({"size": self._size, "open": sorted(self.open_panels)})

    def _watch(self) -> None:
        """Look after the shaders, again and again."""
        if self.shaders.changed():
            self._drawn = None
            self.refresh()
        loop().call_later(WATCH_S, self._watch)

    def refresh(self) -> None:
        """Draw again soon."""
        self.canvas.request_draw()

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

    def _in_heights(self, x: float, y: float) -> tuple[float, float]:
        return x / self.region[3], -y / self.region[3]

    # drawing

    def _draw(self) -> None:
        now = time.perf_counter()
        if self.state.playing:
            self.state.time_s += now - self._clock
        self._clock = now
        self._size = self.canvas.get_logical_size()
        self._paint()
        self.ui.render()
        if self.state.playing or not self._is_done():
            self.refresh()
        elif self.truth.is_refining:
            loop().call_later(POLL_S, self.refresh)

    def _view(self) -> Any:
        """All that the pictures depend on, but for how finely they are drawn and what is known of a reference."""
        state = self.state
        return state.scene, tuple(state.methods), state.layer, state.time_s, self.full_size

    def _is_done(self) -> bool:
        return self._drawn is not None and self._drawn[:2] == (self._view(), 1.0)

    def _paint(self) -> None:
        """Draw what is not drawn yet: coarsely while things move, in full once they are still."""
        state, view, now = self.state, self._view(), time.perf_counter()
        last = None if self._drawn is None else self._drawn[0]
        if view != last:
            self._changed_s = now
        if last is not None and view[-1] != last[-1]:
            self.gpu.trim()  # or pictures of every size that the window had would be kept
        moving = state.playing or (last is not None and now - self._changed_s < STILL_S)
        scale = self.pace.scale if moving else 1.0
        known = None if moving else self._known()
        if self._is_done() and self._drawn[2] is known:
            return
        if view == last and moving and self._drawn[1] >= scale:
            return
        width, height = self.full_size
        size = max(int(width * scale), 1), max(int(height * scale), 1)
        methods = [known if _is_reference(m) else m for m in state.methods]
        present = [m for m in methods if m is not None]
        self._present = present
        try:
            self.drawing = self.easel.draw(state.scene, present, size, state.time_s, state.layer, timed=scale == 1.0)
            self.gpu.fence()
            pictures = iter(self.drawing.pictures)
            self.sides = [None if m is None else next(pictures) for m in methods]
            self.scale = scale
            self._lay_out()
            self.measured = None if moving else measure(self.drawing, self.sides, known)
            if self.measured is None or self.measured.map is None:
                self.map.clear()
            else:
                self.map.write(self.measured.map)
        except (InputError, RenderError, WgslError) as error:
            self.note(str(error))
            self.shaders.undo()
        else:
            self.shaders.keep()
            self.seconds = time.perf_counter() - now
            if moving:
                self.pace.took(self.seconds)
        self._drawn = view, scale, known

    def _lay_out(self) -> None:
        for sheet, picture in zip(self.sheets, self.sides, strict=True):
            if picture is None or picture.display is None:
                sheet.clear()
            else:
                sheet.show(picture.display.resource.gpu)

    def _known(self) -> Known | None:
        """What is known by now of the reference that a side shows, or errors are told against."""
        state = self.state
        references: list[Any] = [m for m in state.methods if _is_reference(m)]
        if not references and not state.is_measured:
            return None
        reference = references[0] if references else Integral()
        found = self.truth.of(View(state.scene, state.time_s, self.full_size, reference))
        if found is None:
            return None
        if self._last_known is None or self._last_known.estimate is not found:
            self._last_known = Known(found)
        return self._last_known

    def note(self, text: str) -> None:
        """Say what went wrong."""
        self.state.notes[:0] = [text]
        del self.state.notes[8:]

    def _gui(self) -> None:
        from imgui_bundle import imgui

        behind = imgui.get_background_draw_list()
        width, height = self.canvas.get_logical_size()
        behind.add_rect_filled((0, 0), (width, height), imgui.IM_COL32(0, 0, 0, 255))
        left, top, across, down = self.region
        state = self.state

        def add(sheet: Sheet, a: float, b: float) -> None:
            if sheet.reference is not None and b > a:
                corners = (left + a * across, top), (left + b * across, top + down)
                behind.add_image(sheet.reference, *corners, (a, 0.0), (b, 1.0))

        cut = {LEFT: 1.0, RIGHT: 0.0}.get(state.comparison, state.divider)
        if state.comparison == ERROR:
            add(self.map, 0.0, 1.0)
        else:
            add(self.sheets[0], 0.0, cut)
            add(self.sheets[1], cut, 1.0)
        if state.comparison == SPLIT:
            x = left + state.divider * across
            behind.add_line((x, top), (x, top + down), imgui.IM_COL32(255, 255, 255, 160), 1.0)
        if state.comparison == ERROR:
            self._legend(behind)
        elif state.shows_entries:
            self._entries(behind)
        panels(self)

    def _legend(self, behind: Any) -> None:
        """The colours of the map of errors."""
        from imgui_bundle import imgui

        left, top, across, down = self.region
        if self.colours.reference is None:
            self.colours.write(error_maps.bar())
        x, y, length = left + 0.2 * across, top + down - 40.0, 0.6 * across
        behind.add_image(self.colours.reference, (x, y), (x + length, y + 10))
        for share, text in error_maps.ticks(WHOLE):
            behind.add_text((x + share * length - 8, y + 14), imgui.IM_COL32(255, 255, 255, 255), text)

    def _entries(self, behind: Any) -> None:
        """Lines from the vertex under the pointer to where it reads from, as wide as they weigh."""
        from imgui_bundle import imgui

        maps = adjacency(self.state.methods[self.side])
        point = None if maps is None else self.pick(*self._at)
        if maps is None or point is None:
            return
        stage = self.easel.stage(self.state.scene, self._present, self.state.time_s)
        found = links(stage, maps, point)
        start = self._on_screen(found.vertex)
        most = max(float(found.weights.max(initial=0.0)), 1e-30)
        for place, weight in zip(found.senders, found.weights, strict=True):
            end, share = self._on_screen(place), float(weight) / most
            behind.add_line(start, end, imgui.IM_COL32(90, 220, 255, 255), 1.0 + 4.0 * share)
            behind.add_text(end, imgui.IM_COL32(255, 255, 255, 255), f"{weight:.3g}")
        behind.add_circle_filled(start, 4.0, imgui.IM_COL32(255, 200, 60, 255))

    def _on_screen(self, point: Any) -> tuple[float, float]:
        left, top, across, down = self.region
        right, up = controls.project(self.camera, across / down, point)
        return left + 0.5 * (1.0 + right) * across, top + 0.5 * (1.0 - up) * down

    # input

    def _on_pointer(self, event: Any) -> None:
        x, y, kind = event["x"], event["y"], event["event_type"]
        left, _, across, _ = self.region
        if kind == "pointer_down":
            near = abs(x - left - self.state.divider * across) < GRIP and self.state.comparison == SPLIT
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
            self.drag(self._dragged, x - self._at[0], y - self._at[1])
        self._at = x, y
        self.refresh()

    def drag(self, what: str, x: float, y: float) -> None:
        """Drag the divider, the light or the camera (orbit, pan) by logical pixels, y down."""
        state = self.state
        right, up = self._in_heights(x, y)
        if what == "divider":
            state.divider = float(np.clip(state.divider + x / self.region[2], 0.0, 1.0))
        elif what == "light":
            self.move_light(right, up)
        else:
            turned = {"orbit": controls.orbit, "pan": controls.pan}[what](self.camera, right, up)
            state.scene = replace(state.scene, camera=turned)
        self.refresh()

    @property
    def camera(self) -> Any:
        """As it stands at the time shown."""
        return self.state.scene.camera.at(self.state.time_s)

    def move_light(self, right: float, up: float) -> None:
        """Turn the first light about the middle of the scene."""
        state = self.state
        if state.scene.lights:
            first, *others = state.scene.lights
            centre = state.scene.bounds.mean(axis=0)
            moved = controls.turn_light(first, self.camera, right, up, centre)
            state.scene = replace(state.scene, lights=(moved, *others))

    def _on_wheel(self, event: Any) -> None:
        self.zoom(1.1 ** (-event["dy"] / 100.0))

    def zoom(self, factor: float) -> None:
        self.state.scene = replace(self.state.scene, camera=controls.zoom(self.camera, factor))
        self.refresh()

    def _on_double_click(self, event: Any) -> None:
        self.focus(event["x"], event["y"])

    def focus(self, x: float, y: float) -> None:
        """Look at what is seen at a point of the window."""
        point = self.pick(x, y)
        if point is not None:
            self.state.scene = replace(self.state.scene, camera=controls.focus(self.camera, point))
            self.refresh()

    def pick(self, x: float, y: float) -> Any:
        """The point of the surface that is seen at a point of the window, world mm; None where nothing is."""
        left, top, across, down = self.region
        return controls.pick(
            self.state.scene.at(self.state.time_s), across / down, 2 * (x - left) / across - 1, 1 - 2 * (y - top) / down
        )

    def _on_key(self, event: Any) -> None:
        key, state = event["key"], self.state
        arrows = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, 1), "ArrowDown": (0, -1)}
        if key in arrows:
            x, y = arrows[key]
            step = KEY_STEP * self.region[3]
            self.drag("pan" if "Shift" in event.get("modifiers", ()) else "orbit", x * step, -y * step)
        elif key in ("+", "=", "-"):
            self.zoom(1 / 1.1 if key == "-" else 1.1)
        elif key == " ":
            state.playing = not state.playing
        elif key == ".":
            state.time_s += STEP_S
        elif key == "Tab":
            state.comparison = LEFT if state.comparison == RIGHT else RIGHT
        elif key in ("1", "2", "3", "4"):
            state.comparison = COMPARISONS[int(key) - 1]
        elif key == "x":
            state.methods.reverse()
        elif key == "l":
            state.layer = LAYERS[(LAYERS.index(state.layer) + 1) % len(LAYERS)]
        elif key == "e":
            state.shows_entries = not state.shows_entries
        elif key == "r":
            state.reset()
        elif key == "f":
            self.focus(*self._at)
        elif key == "s":
            self.screenshot()
        elif key == "c":
            self.copy_command()
        elif key == "q":
            self.canvas.close()
        self.refresh()

    def _take_drops(self) -> None:
        import glfw

        on_drop: Any = lambda window, paths: self.drop(paths)  # noqa: E731
        glfw.set_drop_callback(self.canvas._window, on_drop)

    # what keys and buttons do

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

    def attempt(self, act: Any) -> None:
        """Do something that bad input may keep from being done; say so."""
        try:
            act()
        except InputError as error:
            self.note(str(error))
        self.refresh()

    def change_method(self, side: int, method: Method) -> None:
        self.state.methods[side] = method
        self.refresh()

    @property
    def side(self) -> int:
        """Which picture keys are about: the one shown, or under the pointer."""
        if self.state.comparison in (LEFT, RIGHT):
            return (LEFT, RIGHT).index(self.state.comparison)
        left, _, across, _ = self.region
        return int((self._at[0] - left) / across > self.state.divider)

    def screenshot(self) -> list[Path]:
        """Write what is shown of one side, PNG and EXR, as the command would."""
        from wgsss.output import save
        from wgsss.rendering import AOVS, Renderer

        state = self.state
        method = state.methods[self.side]
        image = Renderer(state.scene, method, self.full_size, self.gpu).frame(state.time_s, AOVS)
        stem = f"{Path(state.source.scene).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
        files = [path for suffix in (".png", ".exr") for path in save(image, Path(stem + suffix))]
        self.note(f"wrote {', '.join(map(str, files))}")
        return files

    def copy_command(self) -> str:
        """Put the command that draws a side on the clipboard."""
        import glfw

        command = self.state.command(self.side, self.full_size)
        with suppress(glfw.GLFWError):
            glfw.set_clipboard_string(self.canvas._window, command)
        print(f"copied: {command}", flush=True)
        self.note(f"copied: {command}")
        return command
