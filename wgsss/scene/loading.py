"""Loads scenes by name, from scene files and from mesh files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wgsss.errors import InputError, unknown
from wgsss.scene.bodies import LoadedFile, load_file
from wgsss.scene.camera import Camera
from wgsss.scene.defaults import DEFAULT_LIGHTS, framing
from wgsss.scene.fileview import camera_in, lights_of, note_unused
from wgsss.scene.light import Light
from wgsss.scene.material import Material
from wgsss.scene.materialfile import Chosen, choose_material
from wgsss.scene.meshobjects import objects_of
from wgsss.scene.scene import Object, Scene
from wgsss.scene.scenefile import camera_of, light_of, read_scene
from wgsss.scene.tables import Table, at


def load_scene(
    name_or_path: str | Path,
    *,
    material: str | Path | Table | Material | None = None,
    size_mm: float | None = None,
    animation: str | None = None,
    simplify: int | None = None,
    vertices: int | None = None,
    camera: Table | Camera | None = None,
    lights: Sequence[Table | Light] = (),
    file_camera: bool = False,
    file_lights: bool = False,
) -> Scene:
    """Load a built-in scene by its name, a scene file (.toml), or a mesh file with default lights and a default camera.

    Args:
        material: replaces the material of every object; the textures of the objects stay. A name, a material file, a
            table with the keys of [object.material], or a Material.
        size_mm: of a mesh file: length of its longest side, mm.
        animation: of a mesh file: name of the animation to play, or "none".
        simplify: of a mesh file: largest number of faces of a body.
        vertices: of a built-in scene: approximate number of vertices.
        camera: replaces the camera of the scene. A Camera, or a table with the keys of [camera].
        lights: replace the lights of the scene if there are any. Lights, or tables with the keys of [[light]].
        file_camera, file_lights: of a mesh file: use its own camera or lights in place of the default ones.

    Raises InputError for an unknown name, and for anything wrong with a file, naming the file.
    """
    chosen = None if material is None else choose_material(material, Path(), "material")
    for_mesh = {"size_mm": size_mm, "animation": animation, "simplify": simplify}
    if file_camera and camera is not None:
        raise InputError("file_camera and camera exclude each other: give one of them")
    if file_lights and lights:
        raise InputError("file_lights and lights exclude each other: give one of them")
    name, path = str(name_or_path), Path(name_or_path)
    if _is_mesh(name, path):
        if vertices is not None:
            raise InputError(f"{name}: vertices is for built-in scenes; a file has those it has")
        scene = _of_mesh(path, chosen, for_mesh, file_camera, file_lights)
    else:
        mesh_options = [key for key, value in for_mesh.items() if value is not None]
        mesh_options += [key for key, on in (("file_camera", file_camera), ("file_lights", file_lights)) if on]
        if mesh_options:
            raise InputError(f"{name}: {mesh_options[0]} is for mesh files, and this is a scene")
        scene = _of_name(name, path, chosen, vertices)
    return with_view(scene, camera, lights)


def _is_mesh(name: str, path: Path) -> bool:
    from wgsss.scene.builtin import SCENES

    if name in SCENES:
        return False
    if not path.suffix and len(path.parts) <= 1:
        raise unknown("scene", name, SCENES)
    return path.suffix.lower() != ".toml"


def _of_name(name: str, path: Path, chosen: Chosen | None, vertices: int | None) -> Scene:
    from wgsss.scene.builtin import SCENES

    if vertices is not None and name not in SCENES:
        raise InputError(f"{name}: vertices is for built-in scenes; a file has those it has")
    scene: Scene = SCENES[name](vertices) if name in SCENES else read_scene(path)
    return scene if chosen is None else _with_chosen(scene, chosen)


def _of_mesh(path: Path, chosen: Chosen | None, options: Table, file_camera: bool, file_lights: bool) -> Scene:
    file = load_file(path, **options)
    try:
        return _view_of_file(path, file, objects_of(file, chosen, path.name), file_camera, file_lights)
    except InputError as error:
        raise at(str(path), error) from None


def _view_of_file(
    path: Path, file: LoadedFile, things: tuple[Object, ...], file_camera: bool, file_lights: bool
) -> Scene:
    """Build the scene of the objects of a mesh file, with its own camera and lights if requested."""
    lights: Sequence[Light] = DEFAULT_LIGHTS
    if file_lights:
        lights = lights_of(file)
        if not lights:
            raise InputError("it holds no lights")
    else:
        uses = " (--file-lights uses it)" if len(file.lights) == 1 else " (--file-lights uses them)"
        note_unused(path.name, len(file.lights), "light", uses)
    camera: Camera | None = None
    if file_camera:
        camera = camera_in(file, things)
        if camera is None:
            raise InputError("it holds no camera")
        note_unused(path.name, len(file.cameras) - 1, "camera", ": the first one is")
    else:
        uses = " (--file-camera uses it)" if len(file.cameras) == 1 else " (--file-camera uses the first)"
        note_unused(path.name, len(file.cameras), "camera", uses)
    return Scene(path.stem, things, tuple(lights), camera or framing(things))


def with_material(scene: Scene, material: str | Path | Table | Material) -> Scene:
    """Replace the material of all objects, as `load_scene` does. Their textures stay."""
    return _with_chosen(scene, choose_material(material, Path(), "material"))


def with_view(scene: Scene, camera: Table | Camera | None, lights: Sequence[Table | Light]) -> Scene:
    """Replace the camera and the lights if any are given, as `load_scene` does."""
    if isinstance(camera, dict):
        camera = camera_of(camera, "camera")
    replaced = [light_of(light, "light", Path()) if isinstance(light, dict) else light for light in lights]
    return replace(scene, camera=camera or scene.camera, lights=tuple(replaced) or scene.lights)


def _with_chosen(scene: Scene, chosen: Chosen) -> Scene:
    return replace(scene, objects=tuple(_apply(chosen, o) for o in scene.objects))


def _apply(chosen: Chosen, thing: Object) -> Object:
    return replace(thing, material=chosen.on(thing.material.maps, thing.mesh.corner_colors is not None))


def load_material(name_or_path: str | Path) -> Material:
    """Load a measured material by its name, or a material file (.toml) with the keys of [object.material].

    Raises InputError for an unknown name, and for anything wrong with a file, naming the file.
    """
    return choose_material(name_or_path, Path()).material
