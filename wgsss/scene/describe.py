"""What a mesh file or a scene file holds, what of it is used, and what is not."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from wgsss.errors import InputError, Note
from wgsss.scene.files import SUFFIXES, read_file
from wgsss.scene.files.contents import NONE
from wgsss.scene.images import read_sky
from wgsss.scene.light import EnvironmentLight
from wgsss.scene.loading import load_scene
from wgsss.scene.material import SLOTS, Material
from wgsss.scene.scene import Object

Described = dict[str, Any]

SKIES = (".hdr", ".exr")


def describe(path: Path) -> Described:
    """What a file holds, as plain data. `notes` says, a line each, what is repaired, left out or taken otherwise.

    Raises InputError for a file that cannot be read, and of another kind than a mesh, a scene or an environment image.
    """
    suffix = path.suffix.lower()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.filterwarnings("always", category=Note)
        if suffix in SUFFIXES:
            found = _mesh_file(path)
        elif suffix == ".toml":
            found = _scene_file(path)
        elif suffix in SKIES:
            found = _sky(path)
        else:
            kinds = ", ".join((*SUFFIXES, ".toml", *SKIES))
            raise InputError(f"{path}: not a kind of file that can be described ({kinds})")
    found["notes"] = list(dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught))
    return found


def _mesh_file(path: Path) -> Described:
    contents = read_file(path)
    scene = load_scene(path)
    animations = list(contents.animations)
    return {
        "file": str(path),
        "kind": f"mesh ({path.suffix.lower()[1:]})",
        "unit": "metre" if contents.states_unit else None,
        "mm_per_unit": contents.mm_per_unit,
        "size_mm": _size(scene.objects),
        "bodies": [_body(thing) for thing in scene.objects],
        "lights": [{"name": light.name, "kind": light.kind} for light in contents.lights],
        "cameras": [
            {"name": camera.name, "kind": "perspective" if camera.height is None else "orthographic"}
            for camera in contents.cameras
        ],
        "animations": animations,
        "plays": animations[0] if animations else NONE,
    }


def _scene_file(path: Path) -> Described:
    scene = load_scene(path)
    return {
        "file": str(path),
        "kind": "scene",
        "size_mm": _size(scene.objects),
        "bodies": [_body(thing) for thing in scene.objects],
        "lights": [
            {"name": light.file or "" if isinstance(light, EnvironmentLight) else "", "kind": type(light).__name__}
            for light in scene.lights
        ],
    }


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
    """Within how many mm all but 1 % of the light leaves; None where layers are too thin for diffusion."""
    try:
        return float(f"{material.profile.range(0.01).max():.3g}")
    except InputError:
        return None
