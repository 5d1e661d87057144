"""What the viewer shows, and the command that draws the same."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from wgsss.methods import Method
from wgsss.registry import make_method, name_of
from wgsss.scene import Camera, Scene, load_scene
from wgsss.scene.loading import with_material, with_view
from wgsss.scene.scenefile import CAMERAS, LIGHTS

SPLIT, LEFT, RIGHT, ERROR = COMPARISONS = ("split", "left", "right", "error")
"""both beside the divider, one of the two, or how far they are from each other"""
STEP_S = 1 / 25
"""of time, at once"""


@dataclass(frozen=True)
class Source:
    """Where a scene is from, as on the command line."""

    scene: str
    size_mm: float | None = None
    animation: str | None = None
    simplify: int | None = None
    vertices: int | None = None
    file_camera: bool = False
    file_lights: bool = False

    def load(self) -> Scene:
        rest = {name: value for name, value in vars(self).items() if name != "scene"}
        return load_scene(self.scene, **rest)

    def options(self, *, without: Sequence[str] = ()) -> list[str]:
        """The words of a command line, less the options of some fields."""
        words = []
        for name, value in vars(self).items():
            if name == "scene" or name in without or value in (None, False):
                continue
            option = f"--{name.replace('_', '-')}"
            words += [option] if value is True else [option, str(value)]
        return words


@dataclass
class State:
    """All that is shown. `opened` is the scene as it was loaded, `material` what took the place of its materials."""

    source: Source
    methods: list[Method]
    """of the left and of the right side"""
    opened: Scene
    scene: Scene
    material: str | dict[str, Any] | None = None
    comparison: str = SPLIT
    divider: float = 0.5
    """share of the width that is the left side's"""
    layer: str = "image"
    time_s: float = 0.0
    playing: bool = False
    shows_entries: bool = False
    """whether lines go from the vertex under the pointer to the senders of its spatial adjacency map"""
    is_measured: bool = False
    """whether a reference is estimated for the view, to tell errors"""
    notes: list[str] = field(default_factory=list)
    """what went wrong or was done, the last first"""

    @classmethod
    def open(
        cls,
        source: Source,
        methods: Sequence[Method],
        material: str | dict[str, Any] | None = None,
        camera: dict[str, Any] | None = None,
        lights: Sequence[dict[str, Any]] = (),
    ) -> State:
        """A scene with what takes the place of its own, as of `load_scene`. Raises InputError for what is wrong."""
        scene = source.load()
        state = cls(source, list(methods), scene, with_view(scene, camera, lights))
        if material is not None:
            state.wear(material)
        return state

    @property
    def camera(self) -> Camera:
        """As it stands at the time shown."""
        return self.scene.camera.at(self.time_s)

    def note(self, text: str) -> None:
        """Say something in the window: what went wrong, or was done."""
        self.notes[:0] = [text]
        del self.notes[8:]

    def wear(self, material: str | dict[str, Any]) -> None:
        """All objects of another material: a name, a file, or a table of one. Raises InputError where there is none."""
        self.scene = replace(with_material(self.opened, material), camera=self.scene.camera, lights=self.scene.lights)
        self.material = material

    def reset(self) -> None:
        """Camera and lights as they were."""
        self.scene = replace(self.scene, camera=self.opened.camera, lights=self.opened.lights)

    def play_or_pause(self) -> None:
        self.playing = not self.playing

    def step(self) -> None:
        """A little later."""
        self.time_s += STEP_S

    def command(self, side: int, size: tuple[int, int]) -> str:
        """The command line that draws a side as it is shown, its layer aside."""
        source, scene, method = self.source, self.scene, self.methods[side]
        words = ["wgsss", "render", source.scene]
        moved = {"file_camera": scene.camera != self.opened.camera, "file_lights": scene.lights != self.opened.lights}
        words += source.options(without=[name for name, changed in moved.items() if changed])
        if self.material is not None:
            words += ["--material", self.material if isinstance(self.material, str) else toml(self.material)]
        if moved["file_camera"]:
            words += ["--camera", _table(scene.camera, CAMERAS)]
        if moved["file_lights"]:
            words += [word for light in scene.lights for word in ("--light", _table(light, LIGHTS))]
        for name in ("exposure", "tone_map", "bloom"):
            if getattr(scene, name) != getattr(self.opened, name):
                words += [f"--{name.replace('_', '-')}", str(getattr(scene, name))]
        name = name_of(method)
        words += ["--method", name]
        for knob, value in vars(method).items():
            if value != vars(make_method(name))[knob]:
                words += ["--set", f"{knob}={value}"]
        if self.time_s:
            words += ["--time", repr(self.time_s)]
        return shlex.join([*words, "--size", f"{size[0]}x{size[1]}"])


def toml(value: Any) -> str:
    """A value as TOML in one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {toml(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml(item) for item in value)}]"
    if isinstance(value, Path):
        value = str(value)
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def _table(thing: Any, kinds: dict[str, Any]) -> str:
    """A camera or a light as a scene file has it."""
    kind = next(name for name, kind in kinds.items() if kind is type(thing))
    values = {f.name: getattr(thing, f.name) for f in fields(thing)}
    return toml({"kind": kind, **{name: value for name, value in values.items() if value is not None}})
