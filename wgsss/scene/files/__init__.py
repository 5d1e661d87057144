"""Readers of mesh files, one module per format. Each returns a `Contents`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.userfiles import require_file

_READERS = {  # file extension -> module of this package, whose function read_<module> reads it
    ".ply": "ply",
    ".obj": "obj",
    ".stl": "stl",
    ".off": "off",
    ".glb": "gltf",
    ".gltf": "gltf",
}
SUFFIXES = tuple(_READERS)


def read_file(path: Path) -> Contents:
    """Read a mesh file of any supported format.

    Raises InputError, naming the file, if it is missing, has another format, is damaged or has no faces.
    """
    name = _READERS.get(path.suffix.lower())
    if name is None:
        raise InputError(f"{path}: not a mesh format that can be read ({' '.join(SUFFIXES)})")
    require_file(path)
    read: Callable[[Path], Contents] = getattr(import_module(f"{__name__}.{name}"), f"read_{name}")
    return read(path)
