"""Which senders the pursuit may choose from."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.smoothed_means import WIDTHS
from wgsss.bake.sam.receiver_patches import ragged_rows
from wgsss.bake.sam.sender_tree import SenderTree

Array = npt.NDArray[Any]

DRAWS = 32
"""equal shares of a vertex's form factors: what holds the middle of one is a candidate, as are all nodes above it"""


def candidates(s: SenderTree, k: Array, reached: Array) -> Array:
    """Vertices and blended means (B, candidates) by form factors k (B, P, C), of all channels, of what reaches patches
    (B, C); -1 fills up."""
    before = np.cumsum(k, axis=2)
    before *= DRAWS / np.where(before[..., -1:] > 1e-30, before[..., -1:], 1.0)
    share = np.floor(before + 0.5)
    drawn = np.diff(share, axis=2, prepend=np.float32(0.0)) > 0.0
    patch, column = np.nonzero(drawn.any(axis=1))
    sender, all_ = reached[patch, column], len(s.area)
    keys = [patch * all_ + sender]
    while len(patch):
        above = s.parent[sender]
        key = np.unique((patch * all_ + above)[above >= 0])
        patch, sender = key // all_, key % all_
        keys.append(key)
    patch, sender = np.divmod(np.unique(np.concatenate(keys)), all_)
    start = np.searchsorted(patch, np.arange(len(k) + 1))
    found = ragged_rows(sender, start[:-1], np.diff(start))
    V, nodes = len(s.tree.order), all_ - len(s.tree.order)
    is_mean = found >= V
    wider = [np.where(is_mean, found + width * nodes, -1) for width in range(2, 1 + len(WIDTHS))]
    return np.concatenate([np.where(is_mean, found + nodes, found), *wider], axis=1)
