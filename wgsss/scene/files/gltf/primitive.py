"""Reader of the primitives of a glTF mesh: triangles and their vertex attributes as checked arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.gltf.attributes import FAN, TRIANGLES, Attributes
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item, printable
from wgsss.scene.files.gltf.notes import Notes

Array = npt.NDArray[Any]
Rows = Callable[..., Array]

_NOT_DRAWN = {0: "points", 1: "lines", 2: "lines", 3: "lines"}


@dataclass(frozen=True, eq=False)
class Primitive:
    """The triangles of a primitive, in the space of its mesh."""

    item: Item
    attributes: Attributes
    vertices: int
    """number of vertices in the file"""
    selection: Array | None
    """int (V,): the vertices that faces use, if these are less than half of all; None for all vertices"""
    positions: Array
    """float64 (V, 3)"""
    faces: Array
    """int64 (F, 3)"""
    normals: Array | None
    """float64 (V, 3), of any length"""
    uvs: dict[int, Array]
    """float64 (V, 2) for each number of a set"""
    colors: Array | None
    """float64 (V, 3), 0 to 1; None if there are none or all are white"""

    def read(self, name: str, kind: str | tuple[str, ...]) -> Array:
        """Read a further attribute (V, C) of the selected vertices."""
        return self.select(self.attributes.read(name, kind, self.vertices))

    def select(self, values: Array) -> Array:
        """Return the values of the selected vertices, given those of all vertices."""
        return values if self.selection is None else values[self.selection]


def read_primitive(document: Document, item: Item, notes: Notes) -> Primitive | None:
    """Read a primitive. Return None, with a note, if it has no triangles.

    Raises InputError, naming the primitive, for invalid data.
    """
    mode = item.whole("mode", TRIANGLES, high=FAN)
    attributes = Attributes(document, item)
    if mode in _NOT_DRAWN or "POSITION" not in attributes.names:
        notes.add(f"{_NOT_DRAWN.get(mode, 'triangles without positions')} left out:", "primitive")
        return None
    positions = attributes.read("POSITION", "VEC3").astype(np.float64)
    faces = attributes.faces(len(positions), notes)
    if not len(faces):
        return None
    vertices, selection = len(positions), None
    used = np.zeros(vertices, bool)
    used[faces] = True
    if 2 * used.sum() < vertices:  # the primitive shares its accessors with other primitives
        selection = np.flatnonzero(used)
        positions, faces = positions[selection], np.searchsorted(selection, faces)

    def rows(name: str, kind: str | tuple[str, ...]) -> Array:
        values = attributes.read(name, kind, vertices, finite=False)
        return values if selection is None else values[selection]

    for name in attributes.names:
        if name.startswith("_"):
            notes.add(f"attribute {printable(name)} left out:", "primitive")
    normals, uvs = _normals(attributes, rows, notes), _uvs(attributes, rows, notes)
    colors = _colors(attributes, rows, notes)
    return Primitive(item, attributes, vertices, selection, positions, faces, normals, uvs, colors)


def _normals(attributes: Attributes, rows: Rows, notes: Notes) -> Array | None:
    if "NORMAL" not in attributes.names:
        return None
    normals = rows("NORMAL", "VEC3").astype(np.float64)
    bad = ~np.isfinite(normals).all(axis=1)
    if bad.any():
        notes.add(f"normals that are not finite left out in {attributes.location}:", "vertex", int(bad.sum()))
        normals[bad] = 0
    return normals


def _uvs(attributes: Attributes, rows: Rows, notes: Notes) -> dict[int, Array]:
    sets = {}
    for number in attributes.numbered("TEXCOORD"):
        uvs = rows(f"TEXCOORD_{number}", "VEC2").astype(np.float64)
        bad = int((~np.isfinite(uvs)).any(axis=1).sum())
        if bad:
            notes.add(f"TEXCOORD_{number} of {attributes.location} left out, not finite at", "vertex", bad)
        else:
            sets[number] = uvs
    return sets


def _colors(attributes: Attributes, rows: Rows, notes: Notes) -> Array | None:
    """Read the first set of vertex colours (V, 3), or None.

    Integer colours are divided by the largest value of their type even if the accessor is not marked as normalised.
    """
    sets = attributes.numbered("COLOR")
    if any(number > 0 for number in sets):
        notes.add("vertex colours beyond COLOR_0 left out:", "primitive")
    if 0 not in sets:
        return None
    colors = rows("COLOR_0", ("VEC3", "VEC4"))
    if colors.dtype == np.int64:
        colors = colors / (255 if colors.max() <= 255 else 65535)
    bad = int((~np.isfinite(colors)).any(axis=1).sum())
    if bad:
        notes.add(f"COLOR_0 of {attributes.location} left out, not finite at", "vertex", bad)
        return None
    colors = np.clip(colors, 0, 1)
    if colors.shape[1] == 4 and (colors[:, 3] < 1).any():
        notes.add("alpha of vertex colours left out:", "primitive")
    return None if (colors[:, :3] == 1).all() else colors[:, :3]
