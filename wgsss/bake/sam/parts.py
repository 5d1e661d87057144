"""Reduced fans in parts, each a point that knows how far it extends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fans import kites
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

# The two halves of a quad, by its vertex a and the others b, c of the face: the corners' barycentric coordinates.
_A, _AB, _AC, _G = np.array([[1, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [1 / 3, 1 / 3, 1 / 3]])
_HALVES = np.array([[_A, _AB, _G], [_A, _G, _AC]])


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of some fans: those of vertex[k] from start[k] to start[k + 1]."""

    vertex: Array
    """int64 (k,), ascending"""
    start: Array
    """int64 (k + 1,)"""
    centre: Array
    """float64 (N, 3), mm: the parts' centroids"""
    area: Array
    """float64 (N,), mm^2"""
    extent: Array
    """float64 (N,), mm^2: mean squared distance of a part from its centroid"""


class Fans:
    """The fans of a mesh, each as a whole and in parts."""

    def __init__(self, mesh: Mesh) -> None:
        found = kites(mesh)
        self.start, self.corner = found.start.astype(np.int64), found.corner
        self.positions, self.faces = mesh.positions, mesh.faces
        self.normal = mesh.normals.astype(np.float64)
        centre, area, extent = self._merged(*self._halves(self.corner))  # of each quad
        at = np.repeat(np.arange(len(mesh.positions)), np.diff(self.start))

        def total(values: Array) -> Array:
            return np.bincount(at, values, len(mesh.positions))

        self.area = total(area)
        """float64 (V,), mm^2"""
        safe = np.maximum(self.area, 1e-300)
        self.centre = np.stack([total(area * centre[:, k]) / safe for k in range(3)], axis=1)
        """float64 (V, 3), mm: centroids"""
        off = centre - self.centre[at]
        self.extent = total(area * (extent + np.einsum("nk,nk->n", off, off))) / safe
        """float64 (V,), mm^2: mean squared distances from the centroids"""

    def points(self, cuts: int) -> Array:
        """How many (V,) parts fans have, as `parts` cuts them."""
        return np.diff(self.start) * 2 * (cuts - 1) ** 2 if cuts > 1 else np.diff(self.start) ** cuts

    def parts(self, vertex: Array, cuts: int) -> Parts:
        """The fans of some vertices (k,), ascending, in parts: whole for 0 `cuts`, in quads for 1, and for more with
        each half of a quad, a triangle, cut into (cuts - 1)^2 equal ones."""
        if not cuts:
            return Parts(vertex, np.arange(len(vertex) + 1), self.centre[vertex], self.area[vertex], self.extent[vertex])
        count = np.diff(self.start)[vertex]
        ends = np.cumsum(count)
        corner = self.corner[np.repeat(self.start[vertex] - ends + count, count) + np.arange(ends[-1])]
        halves = self._halves(corner)
        if cuts == 1:
            centre, area, extent = self._merged(*halves)
        else:
            n = cuts - 1
            centre = np.einsum("sk,qhkd->qhsd", _triangles(n), self._corners(corner)).reshape(-1, 3)
            area, extent = (np.repeat(value.ravel(), n * n) / (n * n) for value in halves[1:])
        start = np.concatenate([[0], ends]) * (len(area) // len(corner))
        return Parts(vertex, start, centre, area, extent)

    def _corners(self, corner: Array) -> Array:
        """float64 (q, 2, 3, 3): the corners of the halves of quads."""
        face, k = corner // 3, corner % 3
        turned = self.faces[face[:, None], (k[:, None] + np.arange(3)) % 3]
        return np.einsum("hkc,qcd->qhkd", _HALVES, self.positions[turned].astype(np.float64))

    def _halves(self, corner: Array) -> tuple[Array, Array, Array]:
        """Centroids (q, 2, 3), areas (q, 2) and extents (q, 2) of the halves of quads."""
        at = self._corners(corner)
        side = np.roll(at, -1, axis=2) - at
        area = 0.5 * np.linalg.norm(np.cross(side[:, :, 0], side[:, :, 1]), axis=2)
        return at.mean(axis=2), area, np.einsum("qhkd,qhkd->qh", side, side) / 36.0

    @staticmethod
    def _merged(centre: Array, area: Array, extent: Array) -> tuple[Array, Array, Array]:
        """Two halves of equal area as one."""
        apart = centre[:, 1] - centre[:, 0]
        return centre.mean(axis=1), area.sum(axis=1), extent.mean(axis=1) + 0.25 * np.einsum("qd,qd->q", apart, apart)


def _triangles(n: int) -> Array:
    """Barycentric coordinates (n^2, 3) of the centroids of the parts of a triangle that is cut n times each side."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright = np.stack([i, j], axis=1)[i + j < n] + 1.0 / 3.0
    turned = np.stack([i, j], axis=1)[i + j < n - 1] + 2.0 / 3.0
    ab = np.concatenate([upright, turned]) / n
    return np.column_stack([ab, 1.0 - ab.sum(axis=1)])
