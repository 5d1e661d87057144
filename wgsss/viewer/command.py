"""The command line that draws a picture of the viewer."""

from __future__ import annotations

import json
import shlex
from collections.abc import Collection
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from wgsss.methods import Method
from wgsss.registry import make_method, name_of
from wgsss.scene import Camera, Light, Scene, load_scene
from wgsss.scene.scenefile import CAMERAS, LIGHTS
from wgsss.scene.tables import Table
from wgsss.study.run_record import Knob
from wgsss.viewer.pictures import View


@dataclass(frozen=True)
class Source:
    """A scene as a command line names it: its name or file, and the options that say how to load it."""

    scene: str
    size_mm: float | None = None
    animation: str | None = None
    simplify: int | None = None
    vertices: int | None = None
    file_camera: bool = False
    file_lights: bool = False

    def load(self) -> Scene:
        """Load the scene. Raises InputError if it cannot be loaded."""
        return load_scene(self.scene, **self._options())

    def words(self, *, without: Collection[str] = ()) -> list[str]:
        """Return the scene and its options as words of a command line, without the options of the named fields."""
        words = [self.scene]
        for name, value in self._options().items():
            if name not in without and value not in (None, False):
                words += [_option(name)] if value is True else [_option(name), str(value)]
        return words

    def _options(self) -> dict[str, Any]:
        options = asdict(self)
        del options["scene"]
        return options


def render_command(source: Source, opened: Scene, material: str | Table | None, view: View, side: int) -> str:
    """Return the `wgsss render` command that draws one side of a view, except for its layer.

    Args:
        source: names the scene.
        opened: the scene as it was loaded; the command states how the view differs from it.
        material: replaces the materials of all objects; None: they stay.
        view: the view that the viewer shows.
        side: index of the method.
    """
    scene, method = view.scene, view.methods[side]
    has_camera, has_lights = scene.camera != opened.camera, scene.lights != opened.lights
    replaced = {"file_camera": has_camera, "file_lights": has_lights}
    words = ["wgsss", "render", *source.words(without=[name for name, is_replaced in replaced.items() if is_replaced])]
    if material is not None:
        words += ["--material", material if isinstance(material, str) else toml(material)]
    if has_camera:
        words += ["--camera", _table(scene.camera, CAMERAS)]
    if has_lights:
        words += [word for light in scene.lights for word in ("--light", _table(light, LIGHTS))]
    for name in ("exposure", "tone_map", "bloom"):
        if getattr(scene, name) != getattr(opened, name):
            words += [_option(name), str(getattr(scene, name))]
    words += ["--method", name_of(method)]
    for knob, value in changed_knobs(method).items():
        words += ["--set", f"{knob}={value}"]
    if view.time_s:
        words += ["--time", repr(view.time_s)]
    return shlex.join([*words, "--size", f"{view.size[0]}x{view.size[1]}"])


def knob_values(method: Method) -> dict[str, Knob]:
    """Return the values of all knobs of a method by name."""
    return {f.name: getattr(method, f.name) for f in fields(method)}  # type: ignore[arg-type]


def changed_knobs(method: Method) -> dict[str, Knob]:
    """Return the values of the knobs of a method that are not at their defaults, by name."""
    default = knob_values(make_method(name_of(method)))
    return {knob: value for knob, value in knob_values(method).items() if value != default[knob]}


def toml(value: Any) -> str:
    """Write a value as TOML on one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {toml(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml(item) for item in value)}]"
    if isinstance(value, Path):
        value = str(value)
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def _option(name: str) -> str:
    """Return the option that sets a field."""
    return f"--{name.replace('_', '-')}"


def _table(item: Camera | Light, kinds: dict[str, Any]) -> str:
    """Write a camera or a light as the TOML table of a scene file; `kinds` has the classes by their names there."""
    kind = next(name for name, kind in kinds.items() if kind is type(item))
    values = {f.name: getattr(item, f.name) for f in fields(item)}
    return toml({"kind": kind, **{name: value for name, value in values.items() if value is not None}})
