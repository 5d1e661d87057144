"""The faces of PLY files: polygons and strips of triangles, as indices of vertices."""

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
_RESTART = (-1, 2**32 - 1)  # of a strip; the second is the first as an unsigned number


@dataclass(frozen=True)
class Faces:
    """Faces whose corners (C,) follow one another."""

    counts: Array
    """int64 (F,): the corners of each face"""
    vertex: Array
    """int64 (C,): the vertex of each corner"""
    uvs: Array | None
    """float64 (C, 2): texture coordinates of corners, v up, 0 for faces without"""
    texture: Array | None
    """int64 (F,): the number of each face's texture"""


def read_faces(path: Path, tables: dict[str, Table], vertices: int, notes: list[str]) -> Faces:
    """The faces of the elements `face` and `tristrips`, taking their properties out of the tables.

    Raises InputError, naming the row, where a face names a vertex that is not there or is damaged otherwise.
    """
    table, strips = tables.get("face", tables.get("faces", {})), tables.get("tristrips", {})
    corner_uvs = _taken(table, _CORNER_UVS)
    polygons = _taken(table, _INDICES) or _taken(table, [name for name in table if _is_whole(table[name])])
    strip = _taken(strips, _INDICES)

    counts, vertex = np.empty(0, np.int64), np.empty(0, np.int64)
    uvs = texture = None
    if polygons:
        counts, vertex = polygons.counts, _indices(path, "face", polygons, vertices)
        uvs = _uvs(path, corner_uvs, counts, notes) if corner_uvs else None
        number = table.pop("texnumber", None)
        texture = _whole(number) if isinstance(number, np.ndarray) else None
    if strip:
        triangles = _unrolled(_indices(path, "tristrips", strip, vertices, _RESTART), strip.counts)
        counts = np.concatenate([counts, np.full(len(triangles), 3)])
        vertex = np.concatenate([vertex, triangles.ravel()])
        uvs = None if uvs is None else np.concatenate([uvs, np.zeros((triangles.size, 2))])
        texture = None if texture is None else np.concatenate([texture, np.zeros(len(triangles), np.int64)])
    return Faces(counts, vertex, uvs, texture)


def _taken(table: Table, names: Iterable[str]) -> Lists | None:
    """The lists of the first of some properties that a table has, taken out of it."""
    for name in names:
        value = table.get(name)
        if isinstance(value, Lists):
            del table[name]
            return value
    return None


def _is_whole(values: Array | Lists) -> bool:
    """Whether these are lists of whole numbers: those of the vertices may have any name."""
    return isinstance(values, Lists) and bool((values.values == np.floor(values.values)).all())


def _whole(values: Array) -> Array:
    """Numbers as int64, -1 for those that are not whole or too large for it."""
    fits = (np.abs(values) < 2.0**53) & (values == np.floor(values))
    return np.where(fits, values, -1).astype(np.int64)


def _indices(path: Path, element: str, lists: Lists, vertices: int, allowed: tuple[int, ...] = ()) -> Array:
    """The values of lists of vertices, where -1 stands for the `allowed` ones."""
    index = _whole(lists.values)
    special = np.isin(lists.values, allowed)
    bad = np.flatnonzero(((index < 0) | (index >= vertices)) & ~special)
    if len(bad):
        row = int(np.searchsorted(np.cumsum(lists.counts), bad[0], side="right")) + 1
        name = f"{lists.values[bad[0]]:.17g}"
        raise InputError(f"{path}: row {row} of element {element}: vertex {name} does not exist (there are {vertices})")
    return np.where(special, -1, index)


def _uvs(path: Path, lists: Lists, counts: Array, notes: list[str]) -> Array:
    """Texture coordinates (C, 2) of faces of so many corners each, from a list of u and v for each face, or none."""
    given = lists.counts > 0
    bad = np.flatnonzero(given & (lists.counts != 2 * counts))
    if len(bad):
        has = f"{lists.counts[bad[0]]} texture coordinates for {counts[bad[0]]} corners"
        raise InputError(f"{path}: row {bad[0] + 1} of element face: {has}")
    if not given.all():
        without = np.count_nonzero(~given)
        notes.append(f"{without} of {len(counts)} faces have no texture coordinates: 0 0 is taken for theirs")
    uvs = np.zeros((int(counts.sum()), 2))
    uvs[np.repeat(given, counts)] = lists.values.reshape(-1, 2)
    return uvs


def _unrolled(index: Array, counts: Array) -> Array:
    """The triangles (T, 3) of strips, which end with each list and at each -1, wound as the first of its strip.

    Those with two equal corners are left out: strips are joined by them.
    """
    index = np.insert(index, np.cumsum(counts), -1)
    place = np.arange(len(index))
    start = np.maximum.accumulate(np.where(index < 0, place + 1, 0))
    a, b, c = index[:-2], index[1:-1], index[2:]
    a, b = np.where((place - start)[:-2] % 2 == 0, (a, b), (b, a))
    triangles = np.stack([a, b, c], axis=1)
    keep = (triangles >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)
    return triangles[keep]
