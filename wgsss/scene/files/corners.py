"""From corners that index positions, texture coordinates and normals apart to vertices that have one of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def vertices_of(columns: Sequence[Array]) -> tuple[Array, Array]:
    """The distinct rows of whole numbers >= -1, given as columns (C,): where each first is (V,), and each row's (C,).

    Vertices are in the order of the first column, then of the next.
    """
    key = columns[0] + 1
    for column in columns[1:]:
        span = int(column.max(initial=0)) + 2
        if int(key.max(initial=0)) > 2**62 // span:
            key = np.unique(key, return_inverse=True)[1]
        key = key * span + (column + 1)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return first, inverse


def picked(values: Array, indices: Array) -> Array:
    """Rows of values (N, k) by index, 0 where the index is -1."""
    if not len(values):
        return np.zeros((len(indices), values.shape[1]))
    return np.where((indices >= 0)[:, None], values[indices], 0.0)


def upside_down(uvs: Array) -> Array:
    """Texture coordinates (N, 2) whose v points up as such whose v points down, and the other way round."""
    return np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)


def finite_uvs(uvs: Array, notes: list[str]) -> Array:
    """Texture coordinates (N, 2) with 0 for those that are not finite as float32, which a note counts."""
    finite = _finite(uvs)
    if not finite.all():
        notes.append(f"{np.count_nonzero(~finite)} texture coordinates are not finite numbers: 0 is taken for them")
    return np.where(finite, uvs, 0.0)


def finite_normals(normals: Array, notes: list[str]) -> Array:
    """Normals (N, 3) with 0, for none, where they are not finite as float32, which a note counts."""
    finite = _finite(normals)
    if not finite.all():
        notes.append(f"{np.count_nonzero(~finite)} normals are not finite numbers and are left out")
    return np.where(finite, normals, 0.0)


def _finite(values: Array) -> Array:
    with np.errstate(over="ignore"):
        finite = np.asarray(np.isfinite(values.astype(np.float32)).all(axis=1, keepdims=True))
    return finite
