"""Reading mesh files, one module per format, into what `contents` describes."""

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
    """What a mesh file holds. Raises InputError, naming the file, for one that is missing, of another format, damaged
    or without faces."""
    name = _READERS.get(path.suffix.lower())
    if name is None:
        raise InputError(f"{path}: not a mesh format that can be read ({' '.join(SUFFIXES)})")
    require_file(path)
    read: Callable[[Path], Contents] = getattr(import_module(f"{__name__}.{name}"), f"read_{name}")
    return read(path)
