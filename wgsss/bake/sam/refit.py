"""Entries that were fitted one by one, refitted to what the mixtures that read them still lack."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.mix import Mix, in_blocks
from wgsss.bake.sam.nonnegative import nonnegative

Array = npt.NDArray[Any]

_LEAST = 0.1
"""of a weight, that stays: what gathers nothing is no part of any mixture, and would not come back"""


def refit(mix: Mix, vertices: Array, sender: Array, weight: Array, light: Array, response: Array) -> None:
    """Scale the entries of vertices (k,) towards those by which mixtures are nearest to what is wanted.

    Args:
        mix: the mixtures, whose tints do not count.
        vertices: those that gather anything.
        sender: int32 (V, N), rows of `light`.
        weight: float32 (V, N, 3), changed: each entry's three by one factor.
        light: float32 (S, T), what senders have of T lights.
        response: float32 (V, T), what vertices should receive of them, in all channels together.

    All vertices move at once, each as if all others that it is mixed with moved as far: so the error cannot grow.
    """
    from scipy.sparse import csr_array

    row = np.full(len(weight), -1)
    row[vertices] = np.arange(len(vertices))
    read = row[mix.vertex[vertices]]
    ends = np.arange(len(vertices) + 1) * read.shape[1]
    parts = csr_array((mix.weight[vertices].ravel().astype(np.float32), read.ravel(), ends), shape=(len(vertices),) * 2)
    lent = parts.T.tocsr()
    price = lent @ parts.sum(axis=1)  # the sum of a row of the parts' square, and so at least its largest eigenvalue
    lack = response[vertices]

    def gathered(rows: Array) -> Array:
        some = vertices[rows]
        return (weight[some].sum(axis=2)[:, None] @ light[sender[some]])[:, 0]

    def miss(rows: Array) -> None:
        some, at = np.unique(read[rows], return_inverse=True)
        there = csr_array((parts[rows].data, at.ravel(), np.arange(len(rows) + 1) * read.shape[1]))
        lack[rows] -= there @ gathered(some)

    def scale(rows: Array) -> None:
        some = vertices[rows]
        seen = weight[some].sum(axis=2)[..., None] * light[sender[some]]
        gram = price[rows, None, None] * (seen @ seen.transpose(0, 2, 1))
        gram += 1e-5 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(seen.shape[1], dtype=np.float32)
        moment = gram.sum(axis=2, keepdims=True) + seen @ (lent[rows] @ lack)[..., None]
        factor = nonnegative(gram, moment)
        weight[some] *= np.where(price[rows, None, None] > 0.0, np.maximum(factor, _LEAST), 1.0)

    every = np.arange(len(vertices))
    in_blocks(miss, every)
    in_blocks(scale, every)
