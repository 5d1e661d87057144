"""Reader of STL files, binary and ASCII. Each triangle has its own three vertices; facet normals are not read.

Source: "StereoLithography Interface Specification" (3D Systems, 1989).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents, Part
from wgsss.scene.files.text import Text, file_bytes
from wgsss.scene.files.triangulate import triangulate

Array = npt.NDArray[Any]

_HEADER = 84  # bytes: 80 of text, then the number of facets
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path) -> Contents:
    """Read all facets of a file as one part. Raises InputError if it is missing, is damaged or has no facets."""
    data = file_bytes(path)
    notes: list[str] = []
    count = int.from_bytes(data[80:_HEADER], "little")
    # Binary files may start with "solid", too. Their length, which the number of facets determines, identifies them.
    if len(data) != _HEADER + count * _FACET.itemsize and _is_text(data):
        positions, faces = _ascii(path, data, notes)
    else:
        positions, faces = _binary(path, data, count, notes)
    if not len(faces):
        raise InputError(f"{path}: the mesh is empty: it has no facets")
    return Contents((Part("the mesh", positions, faces),), splits=True, notes=tuple(notes))


def _is_text(data: bytes) -> bool:
    start = data[:200].removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    return b"\0" not in data.rstrip(b"\0\x1a") and (start.startswith((b"solid", b"facet")) or b"facet" in data.lower())


def _binary(path: Path, data: bytes, count: int, notes: list[str]) -> tuple[Array, Array]:
    complete = max(len(data) - _HEADER, 0) // _FACET.itemsize
    if len(data) < _HEADER:
        raise InputError(f"{path}: damaged, or not an .stl file")
    if complete < count:
        raise InputError(f"{path}: truncated, or not an .stl file: it has {complete} of {count} facets")
    facets = np.frombuffer(data, _FACET, count, _HEADER)
    if len(data) > _HEADER + facets.nbytes:
        notes.append(f"{len(data) - _HEADER - facets.nbytes} bytes after the last facet are left out")
    colored = np.count_nonzero(facets["attribute"])
    if colored or b"COLOR=" in data[:80]:
        notes.append(f"colours (attributes) of {colored} facets are left out" if colored else "the colour is left out")
    with np.errstate(invalid="ignore"):  # the caller checks that positions are finite
        positions = facets["corners"].reshape(-1, 3).astype(np.float64)
    return positions, np.arange(3 * count).reshape(-1, 3)


def _ascii(path: Path, data: bytes, notes: list[str]) -> tuple[Array, Array]:
    text = Text(path, data.lower())
    rows, loops = (np.flatnonzero(text.row_starts_with(word)) for word in (b"vertex", b"outer"))
    loop = np.searchsorted(loops, rows) - 1
    if len(rows) and loop[0] < 0:
        raise text.error(text.first[rows[0]], "a vertex outside any 'outer loop'")
    counts = np.bincount(loop, minlength=len(loops))
    bad = np.flatnonzero(counts < 3)
    if len(bad):
        raise text.error(text.first[loops[bad[0]]], f"a loop of {counts[bad[0]]} vertices")
    if not text.row_starts_with(b"endsolid").any():
        notes.append("the file may be truncated: it does not end with 'endsolid'")
    if not len(loops):
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    positions = text.table(rows, 3, 3)[0]
    return positions, triangulate(path, positions, np.arange(len(positions)), counts, notes)[0]
