"""Conversion of corners with separate indices of position, texture coordinate and normal to vertices with one index."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def vertices_of(columns: Sequence[Array]) -> tuple[Array, Array]:
    """Find the distinct rows of a table of integers >= -1 that is given as columns (C,).

    Returns the index (V,) of the first row of each kind, and for each row (C,) the number of its kind. Kinds are sorted
    by the first column, then by the next.
    """
    key = columns[0] + 1
    for column in columns[1:]:
        span = int(column.max(initial=0)) + 2
        if int(key.max(initial=0)) > 2**62 // span:
            key = np.unique(key, return_inverse=True)[1]
        key = key * span + (column + 1)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return first, inverse


def take_rows(values: Array, indices: Array) -> Array:
    """Return the rows of values (N, k) at the indices; 0 where an index is -1."""
    if not len(values):
        return np.zeros((len(indices), values.shape[1]))
    return np.where((indices >= 0)[:, None], values[indices], 0.0)


def flip_v(uvs: Array) -> Array:
    """Replace v by 1 - v in texture coordinates (N, 2), which converts between v up and v down."""
    return np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)


def finite_uvs(uvs: Array, notes: list[str]) -> Array:
    """Replace texture coordinates (N, 2) that are not finite as float32 by 0, and count them in a note."""
    finite = _finite(uvs)
    if not finite.all():
        notes.append(f"{np.count_nonzero(~finite)} texture coordinates are not finite numbers and become 0")
    return np.where(finite, uvs, 0.0)


def finite_normals(normals: Array, notes: list[str]) -> Array:
    """Replace normals (N, 3) that are not finite as float32 by 0, which means none, and count them in a note."""
    finite = _finite(normals)
    if not finite.all():
        notes.append(f"{np.count_nonzero(~finite)} normals are not finite numbers and are left out")
    return np.where(finite, normals, 0.0)


def _finite(values: Array) -> Array:
    with np.errstate(over="ignore"):
        finite = np.asarray(np.isfinite(values.astype(np.float32)).all(axis=1, keepdims=True))
    return finite
