"""The surface of an object in world space: rays that meet it, and its points closest to others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.rays import Caster
from wgsss.bake.samples import Samples, subdivided
from wgsss.bake.unwrap import split
from wgsss.scene import Object

Array = npt.NDArray[Any]

_SAMPLES = 10_000  # number of samples of the surface among which the closest are searched, about
_CANDIDATES = 4  # faces per query: those of the closest samples
_LIFT = 1e-5  # size of the mesh: distance by which rays start off the surface


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays first meet a surface. Values of rays that miss it are arbitrary."""

    is_hit: Array
    """bool (N,)"""
    distance: Array
    """(N,) mm; infinite for a miss"""
    position: Array
    """(N, 3) mm"""
    normal: Array
    """(N, 3): unit shading normals"""
    face_normal: Array
    """(N, 3): unit normals of the faces"""


class WorldSurface:
    """The surface of an object as posed, in world space, mm."""

    def __init__(self, thing: Object) -> None:
        self._mesh, matrix = thing.mesh, thing.matrix
        render_mesh = split(self._mesh)
        self.faces = render_mesh.faces
        self.positions = self._mesh.positions[render_mesh.vertex].astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        self._normals = render_mesh.normals @ matrix[:3, :3].T
        self._corners = self.positions[self.faces]
        self._uvs = render_mesh.uvs.astype(np.float64)
        across = np.cross(self._corners[:, 1] - self._corners[:, 0], self._corners[:, 2] - self._corners[:, 0])
        length = np.linalg.norm(across, axis=1, keepdims=True)
        self.area = float(length.sum() / 2)
        self.face_normals = across / np.maximum(length, 1e-30)
        self.lift = _LIFT * float(np.linalg.norm(np.ptp(self.positions, axis=0)))
        self._caster = Caster(self.positions, self.faces)

    def at(self, samples: Samples) -> tuple[Array, Array]:
        """Return positions (N, 3) and unit shading normals (N, 3) of samples of the surface."""
        position = np.einsum("nk,nkd->nd", samples.barycentric, self._corners[samples.face])
        return position, self._interpolated_normals(samples.face, samples.barycentric)

    def first(self, origins: Array, directions: Array) -> Hits:
        """Return where rays from `origins` (N, 3) along unit `directions` (N, 3) first meet the surface."""
        face = np.asarray(self._caster.first(origins, directions)).astype(np.int64)
        is_hit = face >= 0
        face = np.maximum(face, 0)
        normal = self.face_normals[face]
        along = np.einsum("nd,nd->n", normal, directions)
        height = np.einsum("nd,nd->n", normal, self._corners[face, 0] - origins)
        distance = np.maximum(height / np.where(np.abs(along) < 1e-12, 1e-12, along), 0.0)
        position = origins + distance[:, None] * directions
        barycentric = _barycentric(position, self._corners[face])
        shading = self._interpolated_normals(face, barycentric)
        return Hits(is_hit, np.where(is_hit, distance, np.inf), position, shading, normal)

    def closest(self, points: Array) -> tuple[Array, Array]:
        """Return the distance to the surface (N,), mm, and the texture coordinates (N, 2) there, for points (N, 3)."""
        tree, sampled_faces = self._tree
        _, nearest = tree.query(points, k=min(_CANDIDATES, len(sampled_faces)), workers=-1)
        candidates = sampled_faces[nearest.reshape(len(points), -1)]
        distance, uv = np.full(len(points), np.inf), np.zeros((len(points), 2))
        for k in range(candidates.shape[1]):
            todo = np.ones(len(points), bool) if k == 0 else (candidates[:, k, None] != candidates[:, :k]).all(axis=1)
            faces = candidates[todo, k]
            barycentric = _closest_barycentric(points[todo], self._corners[faces])
            foot = np.einsum("nk,nkd->nd", barycentric, self._corners[faces])
            away = np.linalg.norm(points[todo] - foot, axis=1)
            is_closer = away < distance[todo]
            chosen = np.flatnonzero(todo)[is_closer]
            distance[chosen] = away[is_closer]
            corner_uvs = self._uvs[self.faces[faces[is_closer]]]
            uv[chosen] = np.einsum("nk,nkd->nd", barycentric[is_closer], corner_uvs)
        return distance, uv

    @cached_property
    def _tree(self) -> tuple[Any, Array]:
        """A KD-tree over samples of the surface, and the face of each sample."""
        from scipy.spatial import KDTree

        samples = subdivided(self._mesh, float(np.sqrt(self.area / _SAMPLES * 2)))
        return KDTree(self.at(samples)[0]), samples.face

    def _interpolated_normals(self, face: Array, barycentric: Array) -> Array:
        normal = np.einsum("nk,nkd->nd", barycentric, self._normals[self.faces[face]])
        unit: Array = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        return unit


def _barycentric(points: Array, corners: Array) -> Array:
    """Return the barycentric coordinates (N, 3) of points (N, 3) in the planes of triangles (N, 3, 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = points - corners[:, 0]
    aa, ab, bb, pa, pb = (np.einsum("nd,nd->n", x, y) for x, y in ((a, a), (a, b), (b, b), (p, a), (p, b)))
    determinant = np.maximum(aa * bb - ab * ab, 1e-300)
    v, w = (bb * pa - ab * pb) / determinant, (aa * pb - ab * pa) / determinant
    return np.column_stack([1.0 - v - w, v, w])


def _closest_barycentric(points: Array, corners: Array) -> Array:
    """Return the barycentric coordinates (N, 3) of the points of triangles (N, 3, 3) closest to points (N, 3)."""
    best = _barycentric(points, corners)
    outside = np.flatnonzero((best < 0.0).any(axis=1))
    if not len(outside):
        return best
    nearest = np.full(len(outside), np.inf)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        start, end = corners[outside, first], corners[outside, second]
        along = end - start
        length = np.maximum(np.einsum("nd,nd->n", along, along), 1e-300)
        share = np.clip(np.einsum("nd,nd->n", points[outside] - start, along) / length, 0.0, 1.0)
        square = np.square(start + share[:, None] * along - points[outside]).sum(axis=1)
        is_nearer = square < nearest
        nearest[is_nearer] = square[is_nearer]
        on_edge = np.zeros((len(outside), 3))
        on_edge[:, first], on_edge[:, second] = 1.0 - share, share
        best[outside[is_nearer]] = on_edge[is_nearer]
    return best
