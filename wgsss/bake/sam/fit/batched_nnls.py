"""Nonnegative least squares for many small problems at once.

All problems of a batch run through block principal pivoting (Kim & Park 2011) together, so that each iteration is one
batched linear solve.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

_DAMPING = 1e-4
"""added to the diagonal, as a share of its mean: columns that are nearly equal then get nearly equal weights"""
_RETURNS = 3
"""number of iterations in which a column whose weight was set to 0 may come back"""


def batched_nnls(gram: Array, moment: Array) -> Array:
    """Return the nonnegative weights of k columns whose weighted sum is nearest to a target, float32 (B, k, c).

    There are B problems with the same columns for each of their c targets.

    Args:
        gram: float32 (B, k, k), the dot products of the columns with each other.
        moment: float32 (B, k, c), their dot products with the targets.

    In each iteration, all columns with a negative weight are removed, and all removed columns that would lessen the
    error come back.
    """
    k = moment.shape[1]
    mean = np.trace(gram, axis1=1, axis2=2) / max(k, 1)
    G = gram + (_DAMPING * mean + 1e-30)[:, None, None] * np.eye(k, dtype=np.float32)
    weight = np.linalg.solve(G, moment)
    b, target = np.nonzero((weight < 0.0).any(axis=1))
    if not len(b):
        return weight
    G, r = G[b], moment[b, :, target]
    diagonal = np.einsum("nkk->nk", G)
    x = weight[b, :, target]
    is_free = x > 0.0
    for iteration in range(_RETURNS + k):
        both_free = is_free[:, :, None] & is_free[:, None, :]
        removed = np.where(is_free, 0.0, diagonal)[:, :, None] * np.eye(k, dtype=np.float32)
        x = np.linalg.solve(np.where(both_free, G, removed), np.where(is_free, r, 0.0)[..., None])[..., 0]
        next_free = is_free & (x > 0.0)
        if iteration < _RETURNS:
            next_free |= ~is_free & (r - (G @ x[..., None])[..., 0] > 1e-6 * np.abs(r))
        if np.array_equal(next_free, is_free):
            break
        is_free = next_free
    weight[b, :, target] = np.maximum(x, 0.0)
    return weight
