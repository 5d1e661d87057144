"""Quadrature points on reduced triangle fans.

An integral over a fan becomes a sum over points with areas. The order of a point set tells how fine it is: order 0 is
one point for the whole fan, order 1 is one point for each quad, and higher orders are Gauss points in each quad. Points
of orders 0 and 1 lie at the centroid of the area that they represent and carry its mean squared distance from them
(the extent). For two such points, the squared distance plus both extents is the mean squared distance between the two
areas. Between distant fans, R_d at that distance is accurate enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fans import fan_corners
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

# The corners of a quad, in order around it, as barycentric coordinates of its face, that of its vertex first.
_QUAD = np.array([[1, 0, 0], [0.5, 0.5, 0], [1 / 3, 1 / 3, 1 / 3], [0.5, 0, 0.5]])


@dataclass(frozen=True, eq=False)
class FanPoints:
    """Quadrature points of some fans. The fan of vertex[k] has the points start[k] to start[k + 1]."""

    vertex: Array
    """int64 (k,), ascending"""
    start: Array
    """int64 (k + 1,)"""
    position: Array
    """float64 (N, 3), mm"""
    area: Array
    """float64 (N,), mm^2: the area that the point represents"""
    extent: Array
    """float64 (N,), mm^2: mean squared distance of that area from the point; 0 for Gauss points"""


class Fans:
    """The reduced fans of a mesh: their moments, and quadrature points on request."""

    def __init__(self, mesh: Mesh) -> None:
        corners = fan_corners(mesh)
        self.start, self.corner = corners.start.astype(np.int64), corners.corner
        self.positions, self.faces = mesh.positions, mesh.faces
        self._third = np.linalg.norm(mesh.face_normals, axis=1) / 6.0  # of each face's area
        self.normal = mesh.normals.astype(np.float64)
        """float64 (V, 3): unit normals of the vertices"""
        centre, area, extent = self._quad_moments(self.corner)
        owner = np.repeat(np.arange(len(mesh.positions)), np.diff(self.start))

        def sums(values: Array) -> Array:
            return np.bincount(owner, values, len(mesh.positions))

        self.area = sums(area)
        """float64 (V,), mm^2"""
        divisor = np.maximum(self.area, 1e-300)
        self.centre = np.stack([sums(area * centre[:, k]) / divisor for k in range(3)], axis=1)
        """float64 (V, 3), mm: the centroids"""
        offset = centre - self.centre[owner]
        self.extent = sums(area * (extent + np.einsum("nk,nk->n", offset, offset))) / divisor
        """float64 (V,), mm^2: mean squared distance of each fan from its centroid"""

    def point_counts(self, order: int) -> Array:
        """Return the number of points (V,) of each fan in a point set of this order."""
        quads = np.diff(self.start)
        return quads * order**2 if order else np.minimum(quads, 1)

    def points(self, vertex: Array, order: int) -> FanPoints:
        """Return quadrature points of the fans of some vertices.

        Args:
            vertex: the vertices (k,), in ascending order.
            order: 0 for one point a fan, 1 for one a quad, n > 1 for the n^2 Gauss-Legendre points of each quad, which
                integrate polynomials of degree 2 n - 1 along each side.
        """
        if not order:
            start = np.arange(len(vertex) + 1)
            return FanPoints(vertex, start, self.centre[vertex], self.area[vertex], self.extent[vertex])
        count = np.diff(self.start)[vertex]
        ends = np.cumsum(count)
        corner = self.corner[np.repeat(self.start[vertex] - ends + count, count) + np.arange(ends[-1])]
        start = np.concatenate([[0], ends]) * order**2
        if order == 1:
            return FanPoints(vertex, start, *self._quad_moments(corner))
        x, w = np.polynomial.legendre.leggauss(order)
        s, t = (0.5 * (a.ravel() + 1.0) for a in np.meshgrid(x, x))
        # A quad is the bilinear image of the unit square: the weights of its corners at (s, t), and their derivatives.
        shares = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])
        along_s, along_t = np.stack([t - 1, 1 - t, t, -t]), np.stack([s - 1, -s, s, 1 - s])
        quad = self._quad_corners(corner)
        position, ds, dt = (np.einsum("kg,qkd->qgd", weight, quad) for weight in (shares, along_s, along_t))
        area = 0.25 * np.outer(w, w).ravel() * np.linalg.norm(np.cross(ds, dt), axis=2)
        return FanPoints(vertex, start, position.reshape(-1, 3), area.ravel(), np.zeros(area.size))

    def _quad_corners(self, corner: Array) -> Array:
        """Return the four corners of quads, float64 (q, 4, 3), mm, that of the vertex first."""
        face, k = corner // 3, corner % 3
        triangle = self.faces[face[:, None], (k[:, None] + np.arange(3)) % 3]
        return np.einsum("kc,qcd->qkd", _QUAD, self.positions[triangle].astype(np.float64))

    def _quad_moments(self, corner: Array) -> tuple[Array, Array, Array]:
        """Return the centroids (q, 3), areas (q,) and extents (q,) of quads.

        A quad is the union of two triangles of equal area; the extent of a triangle is the sum of its squared sides
        over 36.
        """
        halves = self._quad_corners(corner)[:, [[0, 1, 2], [0, 2, 3]]]
        side = np.roll(halves, -1, axis=2) - halves
        centre = halves.mean(axis=2)
        apart = centre[:, 1] - centre[:, 0]
        extent = np.einsum("qhkd,qhkd->q", side, side) / 72.0 + np.einsum("qd,qd->q", apart, apart) / 4.0
        return centre.mean(axis=1), self._third[corner // 3], extent
