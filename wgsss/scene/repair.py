"""Repair of the triangles of a file: weld vertices, drop degenerate faces, orient faces outwards, count holes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.geometry import components

Array = npt.NDArray[Any]

# Below this ratio of height to length, rounding of float32 positions decides which way a triangle faces.
SLIVER = 1e-6
# A surface with holes still has an inside if the length of its summed area vectors is below this share of its area.
OPENING = 0.05


@dataclass(frozen=True)
class Repaired:
    """A repaired surface, and how it relates to the original faces."""

    positions: Array
    """float32 (V, 3), all different and all used"""
    faces: Array
    """int32 (F, 3)"""
    kept: Array
    """int (F,): the index of each face among the original faces"""
    flipped: Array
    """bool (F,): whether the order of the corners was reversed"""
    welded: int
    """number of positions that were equal to an earlier one"""
    notes: tuple[str, ...]
    """one text for each kind of repair or defect, with its count; without welding"""

    def corners(self, values: Array) -> Array:
        """Select the values (F, 3, k) of the corners of the repaired faces from those of the original faces."""
        values = values[self.kept]
        return np.where(self.flipped[:, None, None], values[:, ::-1], values)

    def sources(self, faces: Array) -> Array:
        """Return, for each position, the index (V,) of an original position, given the original faces (N, 3)."""
        indices = np.empty(len(self.positions), np.int64)
        indices[self.faces] = self.corners(faces[..., None])[..., 0]
        return indices


def weld(positions: Array) -> tuple[Array, Array]:
    """Merge equal rows of float32 (V, 3).

    Returns the distinct rows in order of appearance, and the new index of each.
    """
    bits = np.ascontiguousarray(positions + np.float32(0), np.float32).view(np.uint32).astype(np.uint64)  # -0 is 0
    pair = np.unique((bits[:, 0] << np.uint64(32)) | bits[:, 1], return_inverse=True)[1].astype(np.uint64)
    _, first, inverse = np.unique((pair << np.uint64(32)) | bits[:, 2], return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return positions[first[order]], rank[inverse]


def repair(positions: Array, faces: Array) -> Repaired:
    """Weld, clean and orient the faces (F, 3) over float32 positions (V, 3). The result may have no faces."""
    given = len(positions)
    used = np.zeros(given, bool)
    used[faces] = True
    positions, to_welded = weld(positions)
    faces = to_welded[faces]
    notes: list[str] = []
    welded = int(used.sum()) - len(np.unique(to_welded[used]))

    kept = np.flatnonzero(~_degenerate(positions, faces))
    _note(notes, len(faces) - len(kept), "degenerate face", "removed")
    kept, before = kept[_first_of_equal(faces[kept], len(positions))], len(kept)
    _note(notes, before - len(kept), "duplicate face", "removed")
    _note(notes, given - int(used.sum()), "unused vertex", "dropped")
    faces = faces[kept]

    flipped = np.zeros(len(faces), bool)
    if len(faces):
        edges = _Edges(faces)
        flipped = _disagreeing(edges, positions, faces)
        flipped ^= _inside_out(edges, positions, np.where(flipped[:, None], faces[:, ::-1], faces))
        faces = np.where(flipped[:, None], faces[:, ::-1], faces)
        _note(notes, int(flipped.sum()), "face", "wound inwards, turned over")
        edges = _Edges(faces) if flipped.any() else edges
        _note(notes, len(edges.boundary), "boundary edge", f"({counted(edges.holes(), 'hole')})")
        _note(notes, edges.branching, "edge", "of more than two faces")
        _note(notes, int((~edges.agree).sum()), "edge", "whose faces disagree on the outside")

    alive, faces = np.unique(faces, return_inverse=True)
    return Repaired(
        positions[alive], faces.reshape(-1, 3).astype(np.int32), kept, flipped, welded=welded, notes=tuple(notes)
    )


class _Edges:
    """The edges of a mesh, and the faces that meet at them."""

    def __init__(self, faces: Array) -> None:
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        low, high = np.minimum(start, end), np.maximum(start, end)
        self.count = len(faces)
        order = np.argsort(low * (high.max() + 1) + high, kind="stable")
        low, high = low[order], high[order]
        first = np.flatnonzero(np.concatenate([[True], (low[1:] != low[:-1]) | (high[1:] != high[:-1])]))
        size = np.diff(np.append(first, len(order)))
        once, twice = first[size == 1], first[size == 2]
        self.boundary = np.stack([low[once], high[once]], axis=1)
        self.branching = int((size > 2).sum())
        self.pairs = order[np.stack([twice, twice + 1])] // 3
        self.agree = start[order[twice]] != start[order[twice + 1]]

    def holes(self) -> int:
        """Count the connected boundaries."""
        if not len(self.boundary):
            return 0
        vertices, ends = np.unique(self.boundary, return_inverse=True)
        return int(components(len(vertices), *ends.reshape(-1, 2).T).max()) + 1


def _degenerate(positions: Array, faces: Array) -> Array:
    corners = positions[faces].astype(np.float64)
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.einsum("ijk,ijk->ij", sides, sides).max(axis=1)
    double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    flat: Array = double_area <= SLIVER * longest
    return flat


def _first_of_equal(faces: Array, vertices: int) -> Array:
    """Return the indices of faces that do not repeat an earlier face with the same corners and winding."""
    least = faces.argmin(axis=1)[:, None]
    a, b, c = (np.take_along_axis(faces, (least + i) % 3, axis=1)[:, 0] for i in range(3))
    ab = np.unique(a * vertices + b, return_inverse=True)[1]
    return np.sort(np.unique(ab * vertices + c, return_index=True)[1])


def _disagreeing(edges: _Edges, positions: Array, faces: Array) -> Array:
    """Choose the faces to flip so that neighbouring faces agree on the outside: in each piece those of less total area.

    Each face becomes two graph nodes, one as it is and one flipped. Neighbours link the states in which they agree. A
    piece then forms two components, its two orientations. A one-sided piece like a Moebius strip forms only one, and
    is left as it is.
    """
    count = len(faces)
    if edges.agree.all():
        return np.zeros(count, bool)
    f, g = edges.pairs
    crossed = np.where(edges.agree, 0, count)
    as_is, turned = components(
        2 * count, np.concatenate([f, f + count]), np.concatenate([g + crossed, g + count - crossed])
    ).reshape(2, count)
    area = np.linalg.norm(_area_vectors(positions, faces), axis=1)
    for_it = np.bincount(as_is, area, 2 * count)
    # Where both orientations have the same area, choose one consistently.
    tied = (for_it[as_is] == for_it[turned]) & (as_is > turned)
    minority: Array = (as_is != turned) & ((for_it[as_is] < for_it[turned]) | tied)
    return minority


def _inside_out(edges: _Edges, positions: Array, faces: Array) -> Array:
    """Return the faces of closed pieces that enclose a negative volume. Small holes are allowed; cavities stay."""
    piece = components(len(faces), *edges.pairs)
    pieces = int(piece.max()) + 1
    corners = positions[faces].astype(np.float64)
    corner_piece = np.repeat(piece, 3)
    low, high = np.full((pieces, 3), np.inf), np.full((pieces, 3), -np.inf)
    np.minimum.at(low, corner_piece, corners.reshape(-1, 3))
    np.maximum.at(high, corner_piece, corners.reshape(-1, 3))

    def total(per_face: Array) -> Array:
        return np.bincount(piece, per_face, pieces)

    vectors = _area_vectors(positions, faces)
    area = total(np.linalg.norm(vectors, axis=1))
    opening = np.linalg.norm([total(vectors[:, i]) for i in range(3)], axis=0)
    # Measured from the centre of the piece, small holes change the volume little.
    middle = ((low + high) / 2)[piece]
    volume = total(np.einsum("ij,ij->i", corners[:, 0] - middle, vectors) / 3)
    negative = (opening <= OPENING * area) & (volume < -1e-4 * area**1.5)
    for i in np.flatnonzero(negative):
        around = (low < low[i]).all(axis=1) & (high > high[i]).all(axis=1)
        negative[i] = not around.any()
    inverted: Array = negative[piece]
    return inverted


def _area_vectors(positions: Array, faces: Array) -> Array:
    a, b, c = (positions[faces[:, i]].astype(np.float64) for i in range(3))
    return np.cross(b - a, c - a) / 2


def _note(notes: list[str], count: int, what: str, did: str) -> None:
    if count:
        notes.append(f"{counted(count, what)} {did}")


def counted(count: int, what: str) -> str:
    """Format a count with its noun: "1 vertex", "2 vertices", "3 meshes", "4 faces"."""
    if count == 1:
        return f"1 {what}"
    if what.endswith("sh"):
        return f"{count} {what}es"
    return f"{count} {what.removesuffix('ex')}{'ices' if what.endswith('ex') else 's'}"
