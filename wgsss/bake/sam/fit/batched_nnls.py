"""Least squares by weights that are not negative, of many small problems at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

_DAMPING = 1e-4
"""of the mean square of a support: two senders that see the same light share it"""
_RETURNS = 3
"""times that what was left out is asked whether it should come back"""


def batched_nnls(gram: Array, moment: Array) -> Array:
    """Weights (B, k, c), float32, at least 0, of k columns by which B times c responses are nearest.

    Args:
        gram: float32 (B, k, k), the products of the columns with each other.
        moment: float32 (B, k, c), their products with the responses.

    Principal pivoting by blocks (Kim & Park 2011): what is negative is left out, what would then lessen the error comes
    back, all of it at once.
    """
    k = moment.shape[1]
    mean = np.trace(gram, axis1=1, axis2=2) / max(k, 1)
    G = gram + (_DAMPING * mean + 1e-30)[:, None, None] * np.eye(k, dtype=np.float32)
    weight = np.linalg.solve(G, moment)
    b, channel = np.nonzero((weight < 0.0).any(axis=1))
    if not len(b):
        return weight
    G, r = G[b], moment[b, :, channel]
    diagonal = np.einsum("nkk->nk", G)
    x = weight[b, :, channel]
    free = x > 0.0
    for turn in range(_RETURNS + k):
        both = free[:, :, None] & free[:, None, :]
        own = np.where(free, 0.0, diagonal)[:, :, None] * np.eye(k, dtype=np.float32)
        x = np.linalg.solve(np.where(both, G, own), np.where(free, r, 0.0)[..., None])[..., 0]
        after = free & (x > 0.0)
        if turn < _RETURNS:
            after |= ~free & (r - (G @ x[..., None])[..., 0] > 1e-6 * np.abs(r))
        if np.array_equal(after, free):
            break
        free = after
    weight[b, :, channel] = np.maximum(x, 0.0)
    return weight
