"""The surroundings of a vertex: its one-ring and its reduced triangle fan.

The reduced triangle fan of a vertex is the part of the surface that the vertex represents (Maisch & Ropinski 2017,
section 3.2). It contains those points of the adjacent triangles whose largest barycentric coordinate belongs to the
vertex. In one triangle they form a quad between the vertex, the midpoints of its two edges and the centroid; the three
quads of a triangle have equal areas. The fans of all vertices tile the mesh. They are not Voronoi cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class OneRing:
    """The vertices that share an edge with each vertex (Maisch & Ropinski 2017, section 4.1).

    The neighbours of vertex v are vertex[start[v] : start[v + 1]], each once, in ascending order.
    """

    start: Array
    """int32 (V + 1,)"""
    vertex: Array
    """int32 (E,)"""


@dataclass(frozen=True, eq=False)
class FanCorners:
    """The face corners at each vertex, one for each quad of its fan.

    Those of vertex v are corner[start[v] : start[v + 1]], in the order of the faces.
    """

    start: Array
    """int32 (V + 1,)"""
    corner: Array
    """int32 (3 F,): three times the face, plus which of its three corners the vertex is"""


def fan_areas(mesh: Mesh) -> Array:
    """Return the areas of the reduced fans (Maisch & Ropinski 2017, eq. 16), float64 (V,), mm^2.

    The area of a fan is a third of the areas of the triangles around the vertex, so the areas sum to that of the mesh.
    Fans at a boundary are open and need no special case. A vertex without faces has an area of 0.
    """
    third = np.linalg.norm(mesh.face_normals, axis=1) / 6.0
    return np.bincount(mesh.faces.ravel(), np.repeat(third, 3), len(mesh.positions))


def one_ring(mesh: Mesh) -> OneRing:
    """Return the neighbours of each vertex along the edges of the mesh."""
    count = len(mesh.positions)
    a, b = mesh.faces.ravel().astype(np.int64), np.roll(mesh.faces, -1, axis=1).ravel().astype(np.int64)
    edges = np.unique(np.concatenate([a * count + b, b * count + a])[np.tile(a != b, 2)])
    return OneRing(_starts(edges // count, count), (edges % count).astype(np.int32))


def fan_corners(mesh: Mesh) -> FanCorners:
    """Return the face corners at each vertex."""
    vertex = mesh.faces.ravel()
    corner = np.argsort(vertex, kind="stable")
    return FanCorners(_starts(vertex, len(mesh.positions)), corner.astype(np.int32))


def _starts(vertex: Array, count: int) -> Array:
    """Return where the items of each vertex begin, int32 (count + 1,), once items are sorted by their `vertex`."""
    return np.concatenate([[0], np.cumsum(np.bincount(vertex, minlength=count))]).astype(np.int32)
