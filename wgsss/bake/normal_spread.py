"""The largest angle between the normal at a point and those within a distance.

A visible point may receive light from points whose normals face away from the viewer by that angle more.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.cache import Arrays, cached

Array = npt.NDArray[Any]

_CELLS = 4.0  # per distance: points in one cell with similar normals are averaged
_AT_ONCE = 10_000  # points, so that the pairs fit in memory


def normal_spread(positions: Array, normals: Array, distance: float) -> Array:
    """Return the largest angle between the normal at each point and those within a distance: float32 (N,), rad. Cached.

    Args:
        positions: (N, 3), mm.
        normals: (N, 3), of length 1.
        distance: mm, along a straight line. The effective distance is within a quarter of it.
    """

    def make() -> Arrays:
        return {"normal_spread": _normal_spread(positions.astype(np.float64), normals.astype(np.float64), distance)}

    label = f"angles between {len(positions)} normals within {distance:.3g} mm"
    return cached("normal_spread", [positions, normals, distance], make, label=label)["normal_spread"]


def _normal_spread(positions: Array, normals: Array, distance: float) -> Array:
    """Compute the result of `normal_spread`."""
    from scipy.spatial import cKDTree

    cell = np.floor((positions - positions.min(axis=0)) / (distance / _CELLS)).astype(np.int64)
    alike = np.round(normals * _CELLS / 2).astype(np.int64)
    _, group = np.unique(np.concatenate([cell, alike], axis=1), axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    place, normal = (
        np.stack([np.bincount(group, column) for column in values.T], axis=1) / count[:, None]
        for values in (positions, normals)
    )
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    tree, least = cKDTree(place), np.ones(len(positions))
    for start in range(0, len(positions), _AT_ONCE):
        near = tree.query_ball_point(positions[start : start + _AT_ONCE], distance)
        of = start + np.repeat(np.arange(len(near)), [len(indices) for indices in near])
        to = np.concatenate([np.asarray(indices, np.int64) for indices in near])
        np.minimum.at(least, of, np.einsum("nd,nd->n", normals[of], normal[to]))
    return np.arccos(np.clip(least, -1.0, 1.0)).astype(np.float32)
