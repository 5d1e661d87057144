"""Tangential smoothing, which moves the vertices of a mesh along its surface to improve the triangles."""

from __future__ import annotations

import numpy as np


def vertex_normals(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Compute area-weighted unit normals (V,3)."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    weighted = np.cross(b - a, c - a)
    normals = np.stack(
        [np.bincount(faces.ravel(), np.repeat(weighted[:, k], 3), len(positions)) for k in range(3)], axis=1
    )
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)


def neighbour_mean(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Compute the mean (V,3) of the neighbours of each vertex of a closed mesh. Each neighbour is counted twice."""
    ends = faces.ravel()
    others = positions[np.roll(faces, -1, axis=1).ravel()] + positions[np.roll(faces, 1, axis=1).ravel()]
    degree = np.maximum(2.0 * np.bincount(ends, minlength=len(positions)), 1.0)
    return np.stack([np.bincount(ends, others[:, k], len(positions)) for k in range(3)], axis=1) / degree[:, None]


def relax(positions: np.ndarray, faces: np.ndarray, *, steps: int) -> np.ndarray:
    """Apply Laplacian smoothing without its normal component: triangles become more even, the shape changes little."""
    for _ in range(steps):
        move = neighbour_mean(positions, faces) - positions
        normals = vertex_normals(positions, faces)
        positions = positions + 0.5 * (move - normals * np.sum(move * normals, axis=1, keepdims=True))
    return positions
