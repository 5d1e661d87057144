"""Description of a file: a mesh, a scene, a material or an environment image, and what of it wgsss does not use."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from wgsss.errors import InputError, Note
from wgsss.scene.animation import Animation
from wgsss.scene.files import SUFFIXES, read_file
from wgsss.scene.files.contents import NONE
from wgsss.scene.images import read_sky
from wgsss.scene.loading import load_material, load_scene
from wgsss.scene.material import SLOTS, Material
from wgsss.scene.scene import Object
from wgsss.scene.scenefile import CAMERAS, LIGHTS
from wgsss.scene.tables import read_toml
from wgsss.text import one_line

Described = dict[str, Any]

SKIES = (".hdr", ".exr")
FORMATS = {".glb": "glTF", ".gltf": "glTF", ".obj": "OBJ", ".ply": "PLY", ".stl": "STL", ".off": "OFF"}


def describe(path: Path) -> Described:
    """Describe the contents of a file as plain data.

    `notes` has one line for each thing that is repaired, left out or interpreted differently.
    Raises InputError for a file that cannot be read, and for an unknown kind of file.
    """
    suffix = path.suffix.lower()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.filterwarnings("always", category=Note)
        if suffix in SUFFIXES:
            description = _mesh_file(path)
        elif suffix == ".toml":
            description = _toml_file(path)
        elif suffix in SKIES:
            description = _sky(path)
        else:
            kinds = ", ".join((*SUFFIXES, ".toml", *SKIES))
            raise InputError(f"{path}: not a kind of file that can be described ({kinds})")
    description["notes"] = list(dict.fromkeys(one_line(warning.message) for warning in caught))
    return description


def _mesh_file(path: Path) -> Described:
    contents = read_file(path)
    scene = load_scene(path)
    motions = [thing.motion for thing in scene.objects if isinstance(thing.motion, Animation)]
    return {
        "file": str(path),
        "kind": f"mesh ({FORMATS[path.suffix.lower()]})",
        "unit": "metre" if contents.states_unit else None,
        "mm_per_unit": contents.mm_per_unit,
        "size_mm": _size(scene.objects),
        "bodies": [_body(thing) for thing in scene.objects],
        "lights": [{"kind": light.kind, "name": light.name, "file": None} for light in contents.lights],
        "cameras": [
            {"kind": "perspective" if camera.height is None else "orthographic", "name": camera.name, "file": None}
            for camera in contents.cameras
        ],
        "animations": list(contents.animations),
        "plays": motions[0].clip.name if motions else NONE,
    }


def _toml_file(path: Path) -> Described:
    table = read_toml(path)
    if table and not table.keys() & {"object", "light", "camera"}:
        material = load_material(path)
        return {"file": str(path), "kind": f"material {material.name}", "reach_mm": _reach(material)}
    scene = load_scene(path)
    return {
        "file": str(path),
        "kind": "scene",
        "size_mm": _size(scene.objects),
        "bodies": [_body(thing) for thing in scene.objects],
        "lights": [
            {"kind": _kind(light, LIGHTS), "name": "", "file": getattr(light, "file", None)} for light in scene.lights
        ],
        "cameras": [{"kind": _kind(scene.camera, CAMERAS), "name": "", "file": None}],
    }


def _kind(thing: Any, kinds: dict[str, Any]) -> str:
    return next(name for name, kind in kinds.items() if isinstance(thing, kind))


def _sky(path: Path) -> Described:
    pixels = read_sky(path)
    height, width = pixels.shape[:2]
    # Rows of a latitude-longitude image cover less of the sphere the nearer they are to a pole.
    weights = np.sin((np.arange(height) + 0.5) / height * np.pi)
    mean = np.average(pixels.mean(axis=1, dtype=np.float64), axis=0, weights=weights)
    return {
        "file": str(path),
        "kind": "environment image",
        "pixels": [width, height],
        "mean_radiance": mean.tolist(),
        "greatest_radiance": float(pixels.max()),
    }


def _body(thing: Object) -> Described:
    mesh, material = thing.mesh, thing.material
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges = ends[:, 0].astype(np.int64) * len(mesh.positions) + ends[:, 1]
    maps = {slot: getattr(material.maps, slot) for slot in SLOTS}
    return {
        "name": mesh.name,
        "vertices": len(mesh.positions),
        "faces": len(mesh.faces),
        "size_mm": _size([thing]),
        "closed": bool((np.unique(edges, return_counts=True)[1] == 2).all()),
        "material": material.name,
        "reach_mm": _reach(material),
        "base_color": list(material.base_color),
        "textures": {slot: [pixels.shape[1], pixels.shape[0]] for slot, pixels in maps.items() if pixels is not None},
        "texture_coordinates": mesh.corner_uvs is not None,
        "vertex_colors": mesh.corner_colors is not None,
        "moves": thing.motion is not None,
    }


def _size(things: Any) -> list[float]:
    points = np.concatenate([thing.placed for thing in things])
    return [float(f"{side:.4g}") for side in np.ptp(points, axis=0)]


def _reach(material: Material) -> float | None:
    """Return the distance, mm, within which 99 % of the light leaves. None if layers are too thin for diffusion."""
    try:
        return float(f"{material.profile.range(0.01).max():.3g}")
    except InputError:
        return None
