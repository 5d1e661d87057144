"""Scene files: the dataclasses of this package as TOML.

The top level has the keys `name`, `exposure`, `tone_map` and `bloom`.

- `[camera]` and `[[light]]` have a `kind` and the fields of its dataclass. In place of `eye`, a camera may have the
  `distance`, `azimuth` and `elevation` of an orbit.
- `[[object]]` has the fields of Object. It has either a `mesh`, which is a file, or a `shape`, which is a function of
  `shapes`, with its arguments. A `mesh` may be followed by `mm_per_unit` or `size_mm`, by the `animation` of a glTF
  file, and by `simplify`, the largest number of faces. Each material of the file becomes an object.
- `material` is a name, a material file, or a table `[object.material]`. The table or file has the fields of Material.
  It may start from a `preset`, and names images as `base_color_map`, `normal_map` and `specular_map`. Each of its
  `[[layers]]` may name images as `thickness_map`, `color_map` and `opacity_map`.
- `[object.motion]` has a `kind`, which is a class of `motion` in snake case, and its fields.

Paths are relative to the file that contains them. Missing lights and a missing camera have the defaults of a mesh file.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

from wgsss.errors import InputError
from wgsss.scene import tables
from wgsss.scene.bodies import load_file
from wgsss.scene.camera import Camera, OrthographicCamera, PerspectiveCamera
from wgsss.scene.defaults import DEFAULT_LIGHTS, DEFAULT_MATERIAL, framing
from wgsss.scene.files.contents import NONE
from wgsss.scene.fileview import note_unused
from wgsss.scene.light import DirectionalLight, EnvironmentLight, Light, PointLight, RectLight, SphereLight
from wgsss.scene.materialfile import choose_material
from wgsss.scene.meshobjects import objects_of
from wgsss.scene.scene import Object, Scene
from wgsss.scene.tables import Table

CAMERAS = {"perspective": PerspectiveCamera, "orthographic": OrthographicCamera}
LIGHTS = {
    "directional": DirectionalLight,
    "point": PointLight,
    "rect": RectLight,
    "sphere": SphereLight,
    "environment": EnvironmentLight,
}


def read_scene(path: Path) -> Scene:
    """Read a scene file. Raises InputError naming the file, the table and the key that is wrong."""
    table, folder, where = tables.read_toml(path), path.parent, str(path)
    parts = {"objects": "object", "lights": "light", "camera": "camera"}
    simple = [key for key in inspect.signature(Scene).parameters if key not in parts]
    tables.check_keys(table, [*simple, *parts.values()], where)

    objects = tuple(o for t, place in tables.each(table, "object", where) for o in _objects(t, place, folder))
    if not objects:
        raise InputError(f"{where}: there is no [[object]] to render")
    lights = tuple(light_of(t, place, folder) for t, place in tables.each(table, "light", where))
    camera = camera_of(table["camera"], f"{where}: [camera]") if "camera" in table else framing(objects)
    values = {"name": path.stem, **{key: table[key] for key in simple if key in table}}
    scene: Scene = tables.call(
        Scene, {**values, "objects": objects, "lights": lights or DEFAULT_LIGHTS, "camera": camera}, where
    )
    return scene


def _objects(table: Table, where: str, folder: Path) -> tuple[Object, ...]:
    """Create the objects of an [[object]]: one for a shape, or one for each body of a mesh file."""
    if ("mesh" in table) == ("shape" in table):
        raise InputError(f"{where}: give either mesh, a file, or shape, a name")
    source = load_file if "mesh" in table else tables.choose(_shapes(), table["shape"], "shape", where)
    options = [key for key in inspect.signature(source).parameters if key != "path"]
    own = [key for key in inspect.signature(Object).parameters if key != "mesh"]
    tables.check_keys(table, ["mesh", "shape", *own, *options], where)

    arguments = {key: table[key] for key in options if key in table}
    if "mesh" in table:
        arguments["path"] = tables.file_in(table, "mesh", where, folder)
        if "motion" in table and arguments.setdefault("animation", NONE) != NONE:
            raise InputError(f"{where}: give either motion or the animation of the mesh")
    loaded = tables.call(source, arguments, where)

    values = {key: table[key] for key in own if key in table and key != "material"}
    if "motion" in table:
        values["motion"] = tables.call_kind(table["motion"], _motions(), f"{where}: [object.motion]")
    chosen = None
    try:
        if "material" in table:
            chosen = choose_material(table["material"], folder, f"{where}: [object.material]")
    except InputError as error:
        raise tables.at(where, error) from None
    if "mesh" in table:
        name = arguments["path"].name
        for what, ones in (("light", loaded.lights), ("camera", loaded.cameras)):
            note_unused(name, len(ones), what, ": a scene file has its own")
        objects: tuple[Object, ...] = tables.call(
            objects_of, {"file": loaded, "chosen": chosen, "where": name, **values}, where
        )
        return objects
    material = DEFAULT_MATERIAL if chosen is None else chosen.material
    return (tables.call(Object, {"mesh": loaded, "material": material, **values}, where),)


def _shapes() -> dict[str, Any]:
    from wgsss.scene import shapes

    return {name: f for name, f in vars(shapes).items() if inspect.isfunction(f) and not name.startswith("_")}


def _motions() -> dict[str, Any]:
    from wgsss.scene import motion

    classes = {name: c for name, c in vars(motion).items() if is_dataclass(c) and not name.startswith("_")}
    return {re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(): c for name, c in classes.items()}


def light_of(table: Table, where: str, folder: Path) -> Light:
    """Create the light of a [[light]], its file relative to `folder`. Raises InputError naming `where` and the key."""
    if "file" in table:
        table = {**table, "file": str(tables.file_in(table, "file", where, folder))}
    light: Light = tables.call_kind(table, LIGHTS, where)
    return light


def camera_of(table: Any, where: str) -> Camera:
    """Create the camera_class of a [camera_class]. Raises InputError naming `where` and the key."""
    camera: Camera
    if not isinstance(table, dict) or "distance" not in table:
        camera = tables.call_kind(table, CAMERAS, where)
        return camera
    camera_class = tables.choose(CAMERAS, table.get("kind"), "kind", where)
    orbit = {key: p for key, p in inspect.signature(camera_class.orbit).parameters.items() if key != "rest"}
    own = {key: p for key, p in inspect.signature(camera_class).parameters.items() if key != "eye"}
    camera = tables.call(camera_class.orbit, {k: v for k, v in table.items() if k != "kind"}, where, {**own, **orbit})
    return camera
