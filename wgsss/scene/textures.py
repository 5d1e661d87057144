"""The textures of a mesh file: those that one mesh of one material can wear."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.images import read_map
from wgsss.scene.material import Maps

Array = npt.NDArray[Any]


def shared_maps(materials: list[Any], folder: Path) -> tuple[Maps, list[str]]:
    """The textures that all of trimesh's materials share, names being relative to a folder; notes on those left out."""
    maps: dict[str, Array] = {}
    notes = []
    slots = {
        "base_color": ("RGB", "baseColorTexture", "image", None),
        "normal": ("RGB", "normalTexture", None, "norm"),
        "specular": ("L", None, None, "map_ks"),
    }
    for slot, (mode, gltf, simple, mtl) in slots.items():
        images = [_image(material, gltf, simple, mtl) for material in materials]
        keys = {
            image if isinstance(image, str) else getattr(image, "info", {}).get("file_path", id(image))
            for image in images
        }
        if len(keys) > 1:
            notes.append(f"{slot} textures left out: the parts do not share a single one")
        elif images[0] is not None:
            try:
                maps[slot] = _pixels(images[0], mode, folder)
            except (InputError, OSError, SyntaxError, ValueError):
                notes.append(f"{slot} texture left out: it is missing or damaged")
    return Maps(**maps), notes


def _image(material: Any, gltf: str | None, simple: str | None, mtl: str | None) -> Any:
    """The image of a trimesh material: one that is open, the name of a file, or None."""
    for attribute in filter(None, (gltf, simple)):
        image = getattr(material, attribute, None)
        if getattr(image, "format", None) is not None:  # trimesh makes up images without a format for its own needs
            return image
    words = getattr(material, "kwargs", {}).get(mtl)
    return words[-1] if words else None


def _pixels(image: Any, mode: str, folder: Path) -> Array:
    return read_map(folder / image, mode) if isinstance(image, str) else np.array(image.convert(mode))
