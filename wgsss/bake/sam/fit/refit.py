"""Entries that were fitted one by one, refitted to what the mixtures that read them still lack."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.batched_nnls import batched_nnls
from wgsss.bake.sam.fit.neighbour_mixture import in_blocks
from wgsss.bake.sam.sender_map import NeighbourMixture, gather_rows

Array = npt.NDArray[Any]

_LEAST = 0.1
"""of a weight, that stays: what gathers nothing is no part of any mixture, and would not come back"""


def refit(
    mix: NeighbourMixture, vertices: Array, rows: Array, sender: Array, weight: Array, light: Array, response: Array
) -> None:
    """Scale the entries of rows (k,) towards those by which mixtures are nearest to what is wanted.

    Args:
        mix: the mixtures, whose tints do not count.
        vertices: those that are mixtures of anything.
        rows: those that gather anything, in ascending order.
        sender: int32 (R, N), rows of `light`.
        weight: float32 (R, N, 3), changed: each entry's three by one factor.
        light: float32 (S, T), what senders have of T lights.
        response: float32 (V, T), what vertices should receive of them, in all channels together.

    All rows move at once, each as if all others that it is mixed with moved as far: so the error cannot grow.
    """
    from scipy.sparse import csr_array

    read = np.searchsorted(rows, mix.row[vertices])
    ends = np.arange(len(vertices) + 1) * read.shape[1]
    shape = (len(vertices), len(rows))
    parts = csr_array((mix.weight[vertices].ravel().astype(np.float32), read.ravel(), ends), shape=shape)
    lent = parts.T.tocsr()
    price = lent @ parts.sum(axis=1)  # the sum of a row of the parts' square, and so at least its largest eigenvalue
    lack = response[vertices]

    def miss(which: Array) -> None:
        some, at = np.unique(read[which], return_inverse=True)
        there = csr_array((parts[which].data, at.ravel(), np.arange(len(which) + 1) * read.shape[1]))
        lack[which] -= there @ gather_rows(sender[rows[some]], weight[rows[some]], light)

    def scale(which: Array) -> None:
        some, cost = rows[which], price[which, None, None]
        seen = weight[some].sum(axis=2)[..., None] * light[sender[some]]
        gram = cost * (seen @ seen.transpose(0, 2, 1))
        gram += 1e-5 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(seen.shape[1], dtype=np.float32)
        moment = gram.sum(axis=2, keepdims=True) + seen @ (lent[which] @ lack)[..., None]
        factor = batched_nnls(gram, moment)
        weight[some] *= np.where(cost > 0.0, np.maximum(factor, _LEAST), 1.0)

    in_blocks(miss, np.arange(len(vertices)))
    in_blocks(scale, np.arange(len(rows)))
