"""Scenes by name, from scene files and from mesh files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wgsss.errors import InputError, unknown
from wgsss.scene.camera import Camera
from wgsss.scene.defaults import DEFAULT_LIGHTS, DEFAULT_MATERIAL, framing
from wgsss.scene.light import Light
from wgsss.scene.material import Material
from wgsss.scene.materialfile import Chosen, choose_material
from wgsss.scene.mesh import load_mesh
from wgsss.scene.scene import Object, Scene
from wgsss.scene.scenefile import camera_of, light_of, read_scene
from wgsss.scene.tables import Table


def load_scene(
    name_or_path: str | Path,
    *,
    material: str | Path | Table | Material | None = None,
    size_mm: float | None = None,
    vertices: int | None = None,
    camera: Table | Camera | None = None,
    lights: Sequence[Table | Light] = (),
) -> Scene:
    """A built-in scene by its name, a scene file (.toml), or a mesh file with default lights and a camera to frame it.

    `material`, a name, a material file or a Material, takes the place of every object's, whose textures stay. `size_mm`
    is for a mesh file: the length of its longest side. `vertices` is for a built-in scene: about how many it has.
    `camera`, and `lights` where there are any, take the place of the scene's own; they and the material may be tables
    with the keys of a scene file.

    Raises InputError for a name that is not known, and for whatever is wrong with a file, naming the file.
    """
    chosen = None if material is None else choose_material(material, Path(), "material")
    return with_view(_scene(name_or_path, chosen, size_mm, vertices), camera, lights)


def _scene(name_or_path: str | Path, chosen: Chosen | None, size_mm: float | None, vertices: int | None) -> Scene:
    from wgsss.scene.builtin import SCENES

    name, path = str(name_or_path), Path(name_or_path)
    builtin = name in SCENES
    if not builtin and not path.suffix and len(path.parts) == 1:
        raise unknown("scene", name, SCENES)
    is_mesh = not builtin and path.suffix.lower() != ".toml"
    if size_mm is not None and not is_mesh:
        raise InputError(f"{name}: size_mm is for mesh files; this scene says how large it is")
    if vertices is not None and not builtin:
        raise InputError(f"{name}: vertices is for built-in scenes; a file has those it has")

    if is_mesh:
        loaded = load_mesh(path, size_mm=size_mm)
        chosen = chosen or choose_material(DEFAULT_MATERIAL, Path())
        thing = Object(loaded.mesh, chosen.on(loaded.maps), motion=loaded.motion)
        return Scene(path.stem, (thing,), DEFAULT_LIGHTS, framing([thing]))
    scene: Scene = SCENES[name](vertices) if builtin else read_scene(path)
    return scene if chosen is None else _dressed(scene, chosen)


def with_material(scene: Scene, material: str | Path | Table | Material) -> Scene:
    """The scene with all objects of another material, as of `load_scene`; their textures stay."""
    return _dressed(scene, choose_material(material, Path(), "material"))


def with_view(scene: Scene, camera: Table | Camera | None, lights: Sequence[Table | Light]) -> Scene:
    """The scene with another camera and other lights, as of `load_scene`, where there are any."""
    if isinstance(camera, dict):
        camera = camera_of(camera, "camera")
    found = [light_of(light, "light", Path()) if isinstance(light, dict) else light for light in lights]
    return replace(scene, camera=camera or scene.camera, lights=tuple(found) or scene.lights)


def _dressed(scene: Scene, chosen: Chosen) -> Scene:
    return replace(scene, objects=tuple(replace(o, material=chosen.on(o.material.maps)) for o in scene.objects))


def load_material(name_or_path: str | Path) -> Material:
    """A measured material by its name, or the one of a material file (.toml), which holds what [object.material] would.

    Raises InputError for a name that is not known, and for whatever is wrong with a file, naming the file.
    """
    return choose_material(name_or_path, Path()).material
