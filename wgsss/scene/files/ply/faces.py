"""The faces of PLY files: polygons and triangle strips, as indices of vertices."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.ply.data import Lists, Table

Array = npt.NDArray[Any]

_INDICES = ("vertex_indices", "vertex_index")
_CORNER_UVS = ("texcoord", "texcoords")
_RESTART = (-1, 2**32 - 1)  # indices that start a new strip: -1, signed or unsigned


@dataclass(frozen=True)
class Faces:
    """F faces with C corners in total, face after face."""

    counts: Array
    """int64 (F,): the number of corners of each face"""
    vertex: Array
    """int64 (C,): the vertex of each corner"""
    uvs: Array | None
    """float64 (C, 2): texture coordinates of the corners, v up; 0 for faces without; None if no face has any"""
    texture: Array | None
    """int64 (F,): the number of the texture of each face, or None"""


def read_faces(path: Path, tables: dict[str, Table], vertices: int, notes: list[str]) -> Faces:
    """Read the faces of the elements `face` and `tristrips`, and remove the used properties from the tables.

    `vertices` is the number of vertices. Raises InputError, naming the row, if a face is damaged or refers to a vertex
    that does not exist.
    """
    table, strips = tables.get("face", tables.get("faces", {})), tables.get("tristrips", {})
    corner_uvs = _pop_lists(table, _CORNER_UVS)
    polygons = _pop_lists(table, _INDICES) or _pop_lists(table, [name for name in table if _is_whole(table[name])])
    strip = _pop_lists(strips, _INDICES)

    counts, vertex = np.empty(0, np.int64), np.empty(0, np.int64)
    uvs = texture = None
    if polygons:
        counts, vertex = polygons.counts, _indices(path, "face", polygons, vertices)
        uvs = _uvs(path, corner_uvs, counts, notes) if corner_uvs else None
        number = table.pop("texnumber", None)
        texture = _whole(number) if isinstance(number, np.ndarray) else None
    if strip:
        triangles = _strip_triangles(_indices(path, "tristrips", strip, vertices, _RESTART), strip.counts)
        counts = np.concatenate([counts, np.full(len(triangles), 3)])
        vertex = np.concatenate([vertex, triangles.ravel()])
        uvs = None if uvs is None else np.concatenate([uvs, np.zeros((triangles.size, 2))])
        texture = None if texture is None else np.concatenate([texture, np.zeros(len(triangles), np.int64)])
    return Faces(counts, vertex, uvs, texture)


def _pop_lists(table: Table, names: Iterable[str]) -> Lists | None:
    """Remove the first list property with one of the names from a table, and return it, or None."""
    for name in names:
        value = table.get(name)
        if isinstance(value, Lists):
            del table[name]
            return value
    return None


def _is_whole(values: Array | Lists) -> bool:
    """Whether the values are lists of whole numbers. Lists of vertices may have any name."""
    return isinstance(values, Lists) and bool((values.values == np.floor(values.values)).all())


def _whole(values: Array) -> Array:
    """Convert numbers to int64. Those that are not whole or too large become -1."""
    fits = (np.abs(values) < 2.0**53) & (values == np.floor(values))
    return np.where(fits, values, -1).astype(np.int64)


def _indices(path: Path, element: str, lists: Lists, vertices: int, allowed: tuple[int, ...] = ()) -> Array:
    """Check the vertices in lists, and return them as int64 (C,). The special values `allowed` become -1."""
    index = _whole(lists.values)
    special = np.isin(lists.values, allowed)
    bad = np.flatnonzero(((index < 0) | (index >= vertices)) & ~special)
    if len(bad):
        row = int(np.searchsorted(np.cumsum(lists.counts), bad[0], side="right")) + 1
        name = f"{lists.values[bad[0]]:.17g}"
        raise InputError(f"{path}: row {row} of element {element}: vertex {name} does not exist (there are {vertices})")
    return np.where(special, -1, index)


def _uvs(path: Path, lists: Lists, counts: Array, notes: list[str]) -> Array:
    """Return texture coordinates (C, 2) of faces with `counts` corners, given a list u v u v ... for each face."""
    textured = lists.counts > 0
    bad = np.flatnonzero(textured & (lists.counts != 2 * counts))
    if len(bad):
        mismatch = f"{lists.counts[bad[0]]} texture coordinates for {counts[bad[0]]} corners"
        raise InputError(f"{path}: row {bad[0] + 1} of element face: {mismatch}")
    if not textured.all():
        without = np.count_nonzero(~textured)
        notes.append(f"{without} of {len(counts)} faces have no texture coordinates and get 0 0")
    uvs = np.zeros((int(counts.sum()), 2))
    uvs[np.repeat(textured, counts)] = lists.values.reshape(-1, 2)
    return uvs


def _strip_triangles(index: Array, counts: Array) -> Array:
    """Return the triangles (T, 3) of triangle strips, given as lists of vertices with `counts` entries.

    A strip ends with its list and at each -1. All triangles get the winding of the first of their strip. Triangles with
    two equal corners, which only join strips, are left out.
    """
    index = np.insert(index, np.cumsum(counts), -1)
    position = np.arange(len(index))
    start = np.maximum.accumulate(np.where(index < 0, position + 1, 0))
    a, b, c = index[:-2], index[1:-1], index[2:]
    a, b = np.where((position - start)[:-2] % 2 == 0, (a, b), (b, a))
    triangles = np.stack([a, b, c], axis=1)
    keep = (triangles >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)
    return triangles[keep]
