"""Adjusts the weights of entries to the mixtures that read them.

The entries were fitted so that each row alone reproduces M_back. Once the rows are mixed (`neighbour_mixture`), other
weights have a smaller error. All rows take a step at the same time, short enough that the error cannot grow.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.batched_nnls import batched_nnls
from wgsss.bake.sam.fit.neighbour_mixture import in_blocks
from wgsss.bake.sam.sender_map import NeighbourMixture, gather_rows

Array = npt.NDArray[Any]

_MIN_FACTOR = 0.1
"""smallest factor by which an entry is scaled: a row scaled to 0 would leave all mixtures and could never return"""


def refit(
    mixture: NeighbourMixture,
    vertices: Array,
    rows: Array,
    sender: Array,
    weight: Array,
    light: Array,
    response: Array,
) -> None:
    """Scale the weights of entries so that the mixtures come nearer to the vertices' responses.

    Args:
        mixture: the mixtures; their tints are ignored.
        vertices: int (m,), the vertices whose mixtures are not empty.
        rows: int (k,), in ascending order, the rows that gather anything.
        sender: int32 (R, N), indices into the rows of `light`.
        weight: float32 (R, N, 3), changed in place: the three channels of an entry by the same factor.
        light: float32 (S, T), the irradiance of each sender under T training lights.
        response: float32 (V, T), exact M_back under these lights, added over the channels.

    Every row solves a nonnegative least squares for the factors of its own entries, as if all other rows in its
    mixtures took a step of the same size.
    """
    from scipy.sparse import csr_array

    read = np.searchsorted(rows, mixture.row[vertices])
    ends = np.arange(len(vertices) + 1) * read.shape[1]
    shape = (len(vertices), len(rows))
    mixing = csr_array((mixture.weight[vertices].ravel().astype(np.float32), read.ravel(), ends), shape=shape)
    transposed = mixing.T.tocsr()
    # Row sums of transposed @ mixing: since no weight is negative, they bound its largest eigenvalue.
    step = transposed @ mixing.sum(axis=1)
    residual = response[vertices]

    def subtract_mixtures(block: Array) -> None:
        used, index = np.unique(read[block], return_inverse=True)
        mixing_used = csr_array((mixing[block].data, index.ravel(), np.arange(len(block) + 1) * read.shape[1]))
        residual[block] -= mixing_used @ gather_rows(sender[rows[used]], weight[rows[used]], light)

    def scale_entries(block: Array) -> None:
        row, cost = rows[block], step[block, None, None]
        entry = weight[row].sum(axis=2)[..., None] * light[sender[row]]
        gram = cost * (entry @ entry.transpose(0, 2, 1))
        gram += 1e-5 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(entry.shape[1], dtype=np.float32)
        moment = gram.sum(axis=2, keepdims=True) + entry @ (transposed[block] @ residual)[..., None]
        factor = batched_nnls(gram, moment)
        weight[row] *= np.where(cost > 0.0, np.maximum(factor, _MIN_FACTOR), 1.0)

    in_blocks(subtract_mixtures, np.arange(len(vertices)))
    in_blocks(scale_entries, np.arange(len(rows)))
