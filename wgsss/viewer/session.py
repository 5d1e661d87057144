"""The state of the viewer and the actions that change it. It knows no window."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from wgsss import console
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.methods import Method
from wgsss.output import save
from wgsss.rendering import AOVS, Renderer
from wgsss.scene import Camera, Light, Scene
from wgsss.scene.loading import with_material, with_view
from wgsss.scene.tables import Table
from wgsss.viewer import manipulation
from wgsss.viewer.command import Source, render_command
from wgsss.viewer.history import History
from wgsss.viewer.layout import Layout
from wgsss.viewer.painter import Painter
from wgsss.viewer.pictures import LAYERS, View

SPLIT, LEFT, RIGHT, ERROR = COMPARISONS = ("split", "left", "right", "error")
"""both sides beside the divider, one side alone, or the map of the error between them"""
SIDES = LEFT, RIGHT
STEP_S = 1 / 25
"""time of one step"""
MAX_NOTES = 8


@dataclass
class Session:
    """The state of the viewer, with the painter that draws it and the history of its measurements.

    The window provides `layout`, `pointer` and the two callbacks.
    """

    painter: Painter
    source: Source
    methods: list[Method]
    """of the left and the right side"""
    opened: Scene
    """the scene as it was loaded"""
    scene: Scene
    """the scene as it is shown, with changed camera, lights and materials"""
    material: str | Table | None = None
    """replaces the materials of all objects; None: they stay"""
    comparison: str = SPLIT
    """one of COMPARISONS"""
    divider: float = 0.5
    """position of the divider: the share of the picture's width that shows the left side"""
    layer: str = LAYERS[0]
    time_s: float = 0.0
    is_playing: bool = False
    shows_senders: bool = False
    """whether lines lead from the vertex under the pointer to the senders of its spatial adjacency map"""
    is_measured: bool = False
    """whether a reference is estimated to measure the errors of both sides"""
    notes: list[str] = field(default_factory=list)
    """messages for the user, the newest first"""
    history: History = field(default_factory=History)
    layout: Layout = field(default_factory=Layout)
    pointer: tuple[float, float] = (0.0, 0.0)
    """position of the pointer in the window, logical pixels, y down"""
    refresh: Callable[[], None] = lambda: None
    """asks for a new frame"""
    copy_text: Callable[[str], None] = lambda text: None
    """puts a text on the clipboard"""

    @classmethod
    def open(
        cls,
        gpu: Gpu,
        source: Source,
        methods: Sequence[Method],
        material: str | Table | None = None,
        camera: Table | None = None,
        lights: Sequence[Table] = (),
    ) -> Session:
        """Load a scene; material, camera and lights replace those of the scene. Raises InputError if one is invalid."""
        scene = source.load()
        session = cls(Painter(gpu), source, list(methods), scene, with_view(scene, camera, lights))
        if material is not None:
            session.set_material(material)
        return session

    # What is shown

    @property
    def view(self) -> View:
        """What the pictures show at full resolution."""
        return View(self.scene, tuple(self.methods), self.layout.picture_size, self.time_s, self.layer)

    @property
    def camera(self) -> Camera:
        """The camera at the time that is shown."""
        return self.scene.camera.at(self.time_s)

    @property
    def side(self) -> int:
        """The side that keys act on: the one shown alone, or else the one under the pointer."""
        if self.comparison in SIDES:
            return SIDES.index(self.comparison)
        layout = self.layout
        return int((self.pointer[0] - layout.panel_width) / layout.picture_width > self.divider)

    def pick(self, x: float, y: float) -> npt.NDArray[np.float64] | None:
        """Return the point of the surface, world mm, that is seen at a position of the window; None: there is none."""
        right, up = self.layout.to_picture(x, y)
        if max(abs(right), abs(up)) > 1.0:
            return None
        return manipulation.pick(self.scene.at(self.time_s), self.layout.aspect, right, up)

    def paint(self) -> bool:
        """Draw the pictures if the view has changed, and record their errors. Return whether there are new pictures."""
        if not self.painter.paint(self.view, self.is_playing, self.is_measured):
            return False
        measurement = self.painter.measurement
        if measurement is not None:
            self.history.record(self.view, [self.painter.frame_ms(side) for side in range(2)], measurement.errors)
        return True

    # Actions

    def attempt(self, action: Callable[[], object]) -> None:
        """Run an action. If bad input makes it fail, note the reason."""
        try:
            action()
        except InputError as error:
            self.note(str(error))
        self.refresh()

    def note(self, text: str) -> None:
        """Show a message in the window, and drop the oldest of more than MAX_NOTES."""
        self.notes[:0] = [text]
        del self.notes[MAX_NOTES:]

    def open_file(self, path: str) -> None:
        """Open a scene or a mesh, or use a material for all objects. Raises InputError if the file is none of these."""
        try:
            self._open_scene(Source(path))
        except InputError:
            if Path(path).suffix.lower() != ".toml":
                raise
            self.set_material(path)

    def _open_scene(self, source: Source) -> None:
        self.opened = self.scene = source.load()
        self.source, self.material, self.time_s, self.history = source, None, 0.0, History()

    def set_method(self, side: int, method: Method) -> None:
        self.methods[side] = method
        self.refresh()

    def set_material(self, material: str | Table) -> None:
        """Replace the materials of all objects by a preset, a file or a table. Raises InputError if it is invalid."""
        changed = with_material(self.opened, material)
        self.scene = replace(changed, camera=self.scene.camera, lights=self.scene.lights)
        self.material = material

    def set_camera(self, camera: Camera) -> None:
        self.scene = replace(self.scene, camera=camera)
        self.refresh()

    def set_first_light(self, light: Light) -> None:
        """Replace the first light; the others stay."""
        self.scene = replace(self.scene, lights=(light, *self.scene.lights[1:]))
        self.refresh()

    def reset(self) -> None:
        """Restore the camera and the lights of the scene as it was loaded."""
        self.scene = replace(self.scene, camera=self.opened.camera, lights=self.opened.lights)

    def swap_sides(self) -> None:
        self.methods.reverse()

    def play_or_pause(self) -> None:
        self.is_playing = not self.is_playing

    def step(self) -> None:
        """Advance the time by one step."""
        self.time_s += STEP_S

    def screenshot(self, side: int | None = None) -> list[Path]:
        """Write a side as PNG and EXR, rendered as by `wgsss render`. None: the side that keys act on."""
        method = self.methods[self.side if side is None else side]
        renderer = Renderer(self.scene, method, self.layout.picture_size, self.painter.gpu)
        image = renderer.frame(self.time_s, AOVS)
        stem = f"{Path(self.source.scene).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
        files = [path for suffix in (".png", ".exr") for path in save(image, Path(stem + suffix))]
        self.note(f"wrote {', '.join(map(str, files))}")
        return files

    def command(self, side: int | None = None) -> str:
        """Return the command line that draws a side, except for its layer. None: the side that keys act on."""
        return render_command(self.source, self.opened, self.material, self.view, self.side if side is None else side)

    def copy_command(self, side: int | None = None) -> None:
        """Copy the command line that draws a side to the clipboard, and print it."""
        text = f"copied: {self.command(side)}"
        self.copy_text(self.command(side))
        with suppress(InputError, BrokenPipeError):
            console.print_result(text)
        self.note(text)
