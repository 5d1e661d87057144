"""What surrounds each vertex of a mesh: its neighbours, and the reduced triangle fan that it stands for (000 §3.2).

Of each triangle a vertex has the points whose largest barycentric coordinate is its own: one of three quads of equal
area, between the vertex, the middles of two sides and the centroid. They are not Voronoi cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_CENTRE = np.array([22.0, 7.0, 7.0]) / 36.0  # of a quad, in barycentric coordinates


@dataclass(frozen=True, eq=False)
class OneRing:
    """The neighbours of a vertex v along edges, each once: vertex[start[v] : start[v + 1]] (000 §4.1)."""

    start: Array
    """int32 (V + 1,)"""
    vertex: Array
    """int32 (E,)"""


@dataclass(frozen=True, eq=False)
class FanQuads:
    """The quads of a vertex v, one for each face around it: start[v] to start[v + 1]."""

    start: Array
    """int32 (V + 1,)"""
    corner: Array
    """int32 (3 F,): 3 times the face plus the corner that is the vertex"""
    centre: Array
    """float32 (3 F, 3), mm: the centroids"""
    area: Array
    """float32 (3 F,), mm^2"""


def fan_areas(mesh: Mesh) -> Array:
    """float64 (V,), mm^2: a third of each face around a vertex, open fan or not (000 eq. 16). Sums to the mesh's area.

    0 for a vertex without faces.
    """
    third = np.linalg.norm(mesh.face_normals, axis=1) / 6.0
    return np.bincount(mesh.faces.ravel(), np.repeat(third, 3), len(mesh.positions))


def one_ring(mesh: Mesh) -> OneRing:
    """The neighbours of each vertex, by number."""
    count = len(mesh.positions)
    a, b = mesh.faces.ravel().astype(np.int64), np.roll(mesh.faces, -1, axis=1).ravel().astype(np.int64)
    edges = np.unique(np.concatenate([a * count + b, b * count + a])[np.tile(a != b, 2)])
    return OneRing(_starts(edges // count, count), (edges % count).astype(np.int32))


def fan_quads(mesh: Mesh) -> FanQuads:
    """The quads of each vertex, in the order of the faces."""
    at = mesh.faces.ravel()
    corner = np.argsort(at, kind="stable")
    corners = mesh.positions[mesh.faces].astype(np.float64)
    turned = np.stack([np.roll(corners, -i, axis=1) for i in range(3)], axis=1)
    centre = np.einsum("k,fikd->fid", _CENTRE, turned).reshape(-1, 3)
    area = np.repeat(np.linalg.norm(mesh.face_normals, axis=1) / 6.0, 3)
    start = _starts(at, len(mesh.positions))
    return FanQuads(start, corner.astype(np.int32), centre[corner].astype(np.float32), area[corner].astype(np.float32))


def _starts(of: Array, count: int) -> Array:
    """int32 (count + 1,): where the items of each vertex start, once sorted by the vertex that they are `of`."""
    return np.concatenate([[0], np.cumsum(np.bincount(of, minlength=count))]).astype(np.int32)
