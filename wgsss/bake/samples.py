"""Samples of a surface. Each stands for an area: integrals over the surface become sums over samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Samples:
    """Points that keep their place on a surface when it deforms."""

    face: Array
    """int32 (N,): the face of each sample"""
    barycentric: Array
    """float64 (N, 3): the barycentric coordinates of the sample in its face"""
    share: Array
    """float64 (N,): the area of the sample over that of its face; those of a face sum to 1 if each face has samples"""


def subdivided(mesh: Mesh, spacing: float) -> Samples:
    """Return the centroids of equal parts of each triangle, which are at most about `spacing` mm wide.

    Each edge of a triangle is cut into n parts and the triangle into n^2 similar ones; n follows from the longest edge.
    This is the midpoint rule: the areas sum to that of the mesh, and the error falls with the square of the spacing.
    """
    cuts = _cuts(mesh, spacing)
    faces, middles, share = [], [], []
    for n in np.unique(cuts):
        cut = np.flatnonzero(cuts == n)
        parts = _parts(int(n))
        faces.append(np.repeat(cut, n * n))
        middles.append(np.tile(parts, (len(cut), 1)))
        share.append(np.full(len(cut) * n * n, 1.0 / (n * n)))
    return Samples(np.concatenate(faces).astype(np.int32), np.concatenate(middles), np.concatenate(share))


def vertex_samples(mesh: Mesh, vertices: Array | slice = slice(None)) -> Samples:
    """Return vertices of a mesh as samples with share 0, by default all of them.

    `vertices` are indices (N,). Each sample is a corner of one face at its vertex: where normals or texture coordinates
    differ between the faces, it belongs to one side. A vertex without faces receives no light: its sample is at the
    first corner of the mesh.
    """
    used, first = np.unique(mesh.faces, return_index=True)
    corner = np.zeros(len(mesh.positions), np.int64)
    corner[used] = first
    corner = corner[vertices]
    return Samples((corner // 3).astype(np.int32), np.eye(3)[corner % 3], np.zeros(len(corner)))


def count(mesh: Mesh, spacing: float) -> int:
    """Return the number of samples that `subdivided` returns."""
    return int(np.square(_cuts(mesh, spacing)).sum())


def longest_edges(mesh: Mesh) -> Array:
    """Return the length of the longest edge of each face: float64 (F,), mm."""
    corners = mesh.positions[mesh.faces].astype(np.float64)
    edges: Array = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return edges


def _cuts(mesh: Mesh, spacing: float) -> Array:
    """Return the number of parts (F,) into which each edge of a face is cut."""
    return np.maximum(np.ceil(longest_edges(mesh) / spacing), 1).astype(np.int64)


def _parts(n: int) -> Array:
    """Return the barycentric coordinates (n^2, 3) of the centroids of the parts of a triangle, n along each edge."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright = np.stack([i, j], axis=1)[i + j < n] + 1.0 / 3.0
    turned = np.stack([i, j], axis=1)[i + j < n - 1] + 2.0 / 3.0
    ab = np.concatenate([upright, turned]) / n
    return np.column_stack([ab, 1.0 - ab.sum(axis=1)])
