"""Reduced fans as points: for what is far away, few that know how far they extend; for what is near, Gauss points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fans import fan_quads
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

# The corners of a quad, in turn, by the barycentric coordinates of its face, that of its vertex first.
_QUAD = np.array([[1, 0, 0], [0.5, 0.5, 0], [1 / 3, 1 / 3, 1 / 3], [0.5, 0, 0.5]])


@dataclass(frozen=True, eq=False)
class Points:
    """Points for some fans: those of vertex[k] from start[k] to start[k + 1]."""

    vertex: Array
    """int64 (k,), ascending"""
    start: Array
    """int64 (k + 1,)"""
    position: Array
    """float64 (N, 3), mm"""
    area: Array
    """float64 (N,), mm^2"""
    extent: Array
    """float64 (N,), mm^2: of what each stands for, mean squared distance from it"""


class Fans:
    """The fans of a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        found = fan_quads(mesh)
        self.start, self.corner = found.start.astype(np.int64), found.corner
        self.positions, self.faces = mesh.positions, mesh.faces
        self._third = np.linalg.norm(mesh.face_normals, axis=1) / 6.0  # of each face's area
        self.normal = mesh.normals.astype(np.float64)
        centre, area, extent = self._quads(self.corner)
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

    def count(self, order: int) -> Array:
        """How many (V,) points fans have of an order."""
        quads = np.diff(self.start)
        return quads * order**2 if order else np.minimum(quads, 1)

    def points(self, vertex: Array, order: int) -> Points:
        """The fans of some vertices (k,), ascending: as one point each for `order` 0, of each quad one for 1, and
        beyond that order^2, Gauss' for polynomials of degree 2 order - 1 along each side."""
        if not order:
            one = np.arange(len(vertex) + 1)
            return Points(vertex, one, self.centre[vertex], self.area[vertex], self.extent[vertex])
        count = np.diff(self.start)[vertex]
        ends = np.cumsum(count)
        corner = self.corner[np.repeat(self.start[vertex] - ends + count, count) + np.arange(ends[-1])]
        start = np.concatenate([[0], ends]) * order**2
        if order == 1:
            return Points(vertex, start, *self._quads(corner))
        x, w = np.polynomial.legendre.leggauss(order)
        s, t = (0.5 * (a.ravel() + 1.0) for a in np.meshgrid(x, x))
        shares = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])
        along_s, along_t = np.stack([t - 1, 1 - t, t, -t]), np.stack([s - 1, -s, s, 1 - s])
        quad = self._corners(corner)
        position, ds, dt = (np.einsum("kg,qkd->qgd", of, quad) for of in (shares, along_s, along_t))
        area = 0.25 * np.outer(w, w).ravel() * np.linalg.norm(np.cross(ds, dt), axis=2)
        return Points(vertex, start, position.reshape(-1, 3), area.ravel(), np.zeros(area.size))

    def _corners(self, corner: Array) -> Array:
        """float64 (q, 4, 3): the corners of quads."""
        face, k = corner // 3, corner % 3
        turned = self.faces[face[:, None], (k[:, None] + np.arange(3)) % 3]
        return np.einsum("kc,qcd->qkd", _QUAD, self.positions[turned].astype(np.float64))

    def _quads(self, corner: Array) -> tuple[Array, Array, Array]:
        """Centroids (q, 3), areas (q,) and extents (q,) of quads, by their halves, triangles of equal area."""
        halves = self._corners(corner)[:, [[0, 1, 2], [0, 2, 3]]]
        side = np.roll(halves, -1, axis=2) - halves
        centre = halves.mean(axis=2)
        apart = centre[:, 1] - centre[:, 0]
        extent = np.einsum("qhkd,qhkd->q", side, side) / 72.0 + np.einsum("qd,qd->q", apart, apart) / 4.0
        return centre.mean(axis=1), self._third[corner // 3], extent
