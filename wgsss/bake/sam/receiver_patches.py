"""Patches of neighbouring receivers, and the senders that may reach each patch from behind.

The receivers of a patch see nearly the same senders, so the tree of senders is walked once for each patch. A node is
replaced by its children while it is large for its distance (`OPENING`). Patches are processed on all CPU cores, in
batches of similar size, so that numpy works on dense arrays.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.sender_tree import SenderTree
from wgsss.console import progress_bar

Array = npt.NDArray[Any]

OPENING = 0.35
"""largest ratio of a node's radius to its distance at which it is used as a whole. The criterion of Mikkelsen 2009
(eq. 42) compares the size of a node instead of its radius"""
_LEVEL = 1  # of the tree, whose nodes of 4 to 16 vertices are the patches
_AT_ONCE = 256  # patches of a thread's task
_BATCH_SIZE = 4_000_000  # numbers that the arrays of one batch hold, about


@dataclass(frozen=True, eq=False)
class ReceiverPatches:
    """Patches of neighbouring receivers. A patch is the chosen vertices below one node of the sender tree."""

    node: Array
    """int64 (p,): the nodes of the patches, counted from the first node of the tree"""
    leaf: Array
    """int64 (v,), ascending: where the chosen vertices are in the tree's order"""

    @classmethod
    def of(cls, senders: SenderTree, vertices: Array) -> ReceiverPatches:
        """Return the patches that contain the chosen vertices (v,)."""
        levels = senders.tree.levels
        level = min(_LEVEL, len(levels) - 2)
        place = np.empty(len(senders.tree.order), np.int64)
        place[senders.tree.order] = np.arange(len(place))
        leaf = np.sort(place[vertices])
        node = np.searchsorted(senders.tree.first[levels[level] : levels[level + 1]], leaf, side="right") - 1
        return cls(levels[level] + np.unique(node), leaf)

    def each(self, work: Callable[[ReceiverPatches], None], label: str) -> None:
        """Call `work` for groups of patches in parallel, with a progress bar that shows `label`."""
        groups = [ReceiverPatches(self.node[i : i + _AT_ONCE], self.leaf) for i in range(0, len(self.node), _AT_ONCE)]
        with (
            progress_bar(total=len(self.node), desc=label, unit=" patches") as bar,
            ThreadPoolExecutor(os.cpu_count()) as pool,
        ):
            for group, _ in zip(groups, pool.map(work, groups), strict=True):
                bar.update(len(group.node))

    def batches(self, K: PatchFormFactors, lights: int) -> Iterator[tuple[Array, Array]]:
        """Yield batches of B patches as arrays: their receivers, int (B, P), and senders, int (B, C), filled up by -1.

        Patches with few senders come first; those without any are left out.

        Args:
            K: the form factors, which tell how far away senders count.
            lights: the number of floats that the caller needs for each sender, from which the size of a batch follows.
        """
        tree, V = K.senders.tree, len(K.senders.tree.order)
        patch, sender = reaching_senders(K, V + self.node)
        first = np.searchsorted(self.leaf, tree.first[self.node])
        count = np.searchsorted(self.leaf, tree.first[self.node] + tree.count[self.node]) - first
        start = np.searchsorted(patch, np.arange(len(self.node) + 1))
        size = np.diff(start)
        order = np.argsort(size, kind="stable")
        order = order[size[order] > 0]
        P = int(count.max())
        i = 0
        while i < len(order):
            j = i + 1
            while j < len(order) and (j + 1 - i) * size[order[j]] * (lights + 12 * P) < _BATCH_SIZE:
                j += 1
            batch = order[i:j]
            receivers = ragged_rows(tree.order[self.leaf], first[batch], count[batch])
            yield receivers, ragged_rows(sender, start[batch], size[batch])
            i = j


def reaching_senders(K: PatchFormFactors, patches: Array) -> tuple[Array, Array]:
    """Return the senders that may reach each patch from behind, as pairs: an index into `patches`, and a sender.

    No vertex is below two senders of a patch. The pairs are in the order of the patches.

    Args:
        patches: int (p,), nodes of the tree of senders, counted with its vertices.
    """
    s, V = K.senders, len(K.senders.tree.order)
    patch, node = np.arange(len(patches)), np.full(len(patches), len(s.area) - 1)
    accepted: list[Array] = []
    while len(node):
        o = patches[patch]
        between = s.x[node] - s.x[o]
        distance = np.linalg.norm(between, axis=1)
        reach = s.radius[node] + s.radius[o]
        # Bounds of the heights over tangent planes, and of the angles between normals, of any vertices below the two.
        tilt = np.sin(np.minimum(s.cone[o], 0.5 * np.pi)) * (distance + reach)
        height = np.einsum("nd,nd->n", between, s.n[o])
        angle = np.arccos(np.clip(np.einsum("nd,nd->n", s.n[node], s.n[o]), -1.0, 1.0))
        spread = s.cone[node] + s.cone[o]
        may_reach = (height - reach - tilt < 0.0) & (angle + spread > 0.5 * np.pi) & (distance - reach < K.farthest)
        is_all_behind = (height + reach + tilt < 0.0) & (angle - spread > 0.5 * np.pi)
        # A node that is only partly behind is off by more, so it is opened from twice as far away.
        is_large = s.radius[node] > OPENING * np.where(is_all_behind, 1.0, 0.5) * (distance - s.radius[o])
        is_large &= s.area[node] * K.reflectance(np.square(np.maximum(distance - reach, 0.0))).max(axis=0) > K.opened
        accept = may_reach & (~is_large | (node < V))
        accepted.append(np.stack([patch[accept], node[accept]]))
        opened = np.flatnonzero(may_reach & is_large & (node >= V))
        if not len(opened):
            break
        node, owner = s.children(node[opened])
        patch = patch[opened][owner]
    pairs = np.concatenate(accepted, axis=1)
    pairs = pairs[:, np.argsort(pairs[0], kind="stable")]
    return pairs[0], pairs[1]


def ragged_rows(values: Array, first: Array, count: Array) -> Array:
    """Return ranges of `values` as the rows of one array (B, longest), filled up by -1; it has at least one column.

    Args:
        values: (N,).
        first: int (B,), where each range begins.
        count: int (B,), the length of each range.
    """
    column = np.arange(max(int(count.max()), 1))
    is_inside = column < count[:, None]
    return np.append(values, -1)[np.where(is_inside, first[:, None] + column, -1)]
