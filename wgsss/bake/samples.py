"""Samples of a surface, each standing for an area, so that integrals over the surface are sums."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Samples:
    """Points that stay where they are on a surface when it deforms."""

    face: Array
    """int32 (N,), the face that each lies on"""
    barycentric: Array
    """float64 (N, 3), where on it"""
    share: Array
    """float64 (N,), of the face's area: those of a face sum to 1 where each face has its own samples"""


def subdivided(mesh: Mesh, spacing: float) -> Samples:
    """The middles of equal parts of each triangle, about `spacing` mm wide at most.

    A triangle is cut n times along each edge into n^2 parts like itself, n as its longest edge wants: the midpoint
    rule, whose areas sum to the mesh's, and whose error falls with the square of the spacing.
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
    """How many samples `subdivided` gives."""
    return int(np.square(_cuts(mesh, spacing)).sum())


def longest_edges(mesh: Mesh) -> Array:
    """The length (F,) of each face's longest edge, mm, float64."""
    corners = mesh.positions[mesh.faces].astype(np.float64)
    edges: Array = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return edges


def _cuts(mesh: Mesh, spacing: float) -> Array:
    """Into how many parts (F,) each edge of a face is cut."""
    return np.maximum(np.ceil(longest_edges(mesh) / spacing), 1).astype(np.int64)


def _parts(n: int) -> Array:
    """Barycentric coordinates (n^2, 3) of the middles of the parts of a triangle that is cut n times."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright = np.stack([i, j], axis=1)[i + j < n] + 1.0 / 3.0
    turned = np.stack([i, j], axis=1)[i + j < n - 1] + 2.0 / 3.0
    ab = np.concatenate([upright, turned]) / n
    return np.column_stack([ab, 1.0 - ab.sum(axis=1)])
