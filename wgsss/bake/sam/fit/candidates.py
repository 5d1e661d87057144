"""The candidates among which the pursuit chooses the senders of a patch of receivers.

Thousands of senders reach a patch, most with little effect. Candidates are the vertices and nodes at equal steps of the
receivers' summed form factors, and all nodes above these, so that both near details and wide means can be chosen.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.smoothed_means import WIDTHS
from wgsss.bake.sam.receiver_patches import ragged_rows
from wgsss.bake.sam.sender_tree import SenderTree

Array = npt.NDArray[Any]

DRAWS = 32
"""equal shares of the sum of a receiver's form factors: the sender in the middle of each share becomes a candidate"""


def candidates(senders: SenderTree, k: Array, reaching: Array) -> Array:
    """Return the candidates of B patches as indices of vertices and smoothed means, int (B, candidates); -1 fills up.

    A node is represented by its smoothed means, one for each of WIDTHS. With V vertices and N nodes, the first V + N
    indices are those of the tree of senders, and the smoothed means follow (see `smoothed_means`).

    Args:
        k: float32 (B, P, C), the form factors from C senders to P receivers of each patch, summed over the channels.
        reaching: int (B, C), these senders; -1 for none.
    """
    before = np.cumsum(k, axis=2)
    before *= DRAWS / np.where(before[..., -1:] > 1e-30, before[..., -1:], 1.0)
    share = np.floor(before + 0.5)
    is_drawn = np.diff(share, axis=2, prepend=np.float32(0.0)) > 0.0
    patch, column = np.nonzero(is_drawn.any(axis=1))
    sender, count = reaching[patch, column], len(senders.area)
    keys = [patch * count + sender]
    while len(patch):  # one level up the tree
        above = senders.parent[sender]
        key = np.unique((patch * count + above)[above >= 0])
        patch, sender = key // count, key % count
        keys.append(key)
    patch, sender = np.divmod(np.unique(np.concatenate(keys)), count)
    start = np.searchsorted(patch, np.arange(len(k) + 1))
    sender = ragged_rows(sender, start[:-1], np.diff(start))
    V, nodes = len(senders.tree.order), count - len(senders.tree.order)
    is_node = sender >= V
    wider = [np.where(is_node, sender + width * nodes, -1) for width in range(2, 1 + len(WIDTHS))]
    return np.concatenate([np.where(is_node, sender + nodes, sender), *wider], axis=1)
