"""Vertices that are side by side, and what may reach them from behind, many patches at a time."""

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
"""radius of a node over its distance, at most; the published criterion of the same kind (004 eq. 42) takes sizes"""
PATCH = 1
"""level of the tree whose nodes, of 4 to 16 vertices, share candidates"""
_AT_ONCE = 256  # patches of a thread's task
_BLOCK = 4_000_000  # numbers that a batch of patches holds at a time, about


@dataclass(frozen=True, eq=False)
class ReceiverPatches:
    """Patches (p,), nodes of a tree, of chosen vertices."""

    node: Array
    """int64 (p,): their nodes"""
    leaf: Array
    """int64 (v,), ascending: where the vertices are in the tree's order"""

    @classmethod
    def of(cls, s: SenderTree, vertices: Array) -> ReceiverPatches:
        """Those that chosen vertices (v,) are in."""
        levels = s.tree.levels
        level = min(PATCH, len(levels) - 2)
        place = np.empty(len(s.tree.order), np.int64)
        place[s.tree.order] = np.arange(len(place))
        leaf = np.sort(place[vertices])
        node = np.searchsorted(s.tree.first[levels[level] : levels[level + 1]], leaf, side="right") - 1
        return cls(levels[level] + np.unique(node), leaf)

    def each(self, work: Callable[[ReceiverPatches], None], label: str) -> None:
        """Work on some at a time, on all cores."""
        parts = [ReceiverPatches(self.node[i : i + _AT_ONCE], self.leaf) for i in range(0, len(self.node), _AT_ONCE)]
        with (
            progress_bar(total=len(self.node), desc=label, unit=" patches") as bar,
            ThreadPoolExecutor(os.cpu_count()) as pool,
        ):
            for part, _ in zip(parts, pool.map(work, parts), strict=True):
                bar.update(len(part.node))

    def batches(self, s: SenderTree, K: PatchFormFactors, lights: int) -> Iterator[tuple[Array, Array]]:
        """Those that much reaches last: their vertices (B, P) and what reaches them (B, C); -1 fills up."""
        made, V = s.tree, len(s.tree.order)
        patch, reached = reaching_senders(s, K, V + self.node)
        first = np.searchsorted(self.leaf, made.first[self.node])
        count = np.searchsorted(self.leaf, made.first[self.node] + made.count[self.node]) - first
        start = np.searchsorted(patch, np.arange(len(self.node) + 1))
        size = np.diff(start)
        order = np.argsort(size, kind="stable")
        order = order[size[order] > 0]
        P = int(count.max())
        i = 0
        while i < len(order):
            j = i + 1
            while j < len(order) and (j + 1 - i) * size[order[j]] * (lights + 12 * P) < _BLOCK:
                j += 1
            here = order[i:j]
            yield (
                ragged_rows(made.order[self.leaf], first[here], count[here]),
                ragged_rows(reached, start[here], size[here]),
            )
            i = j


def reaching_senders(s: SenderTree, K: PatchFormFactors, patches: Array) -> tuple[Array, Array]:
    """What may reach nodes `patches` (p,) from behind: pairs of an index into `patches` and a sender, in order.

    Every vertex is under at most one sender of a patch.
    """
    patch, node = np.arange(len(patches)), np.full(len(patches), len(s.area) - 1)
    found: list[Array] = []
    V = len(s.tree.order)
    while len(node):
        o = patches[patch]
        between = s.x[node] - s.x[o]
        distance = np.linalg.norm(between, axis=1)
        reach = s.radius[node] + s.radius[o]
        # How far below the tangent planes, and how far turned away, anything under the two may be at most.
        tilted = np.sin(np.minimum(s.cone[o], 0.5 * np.pi)) * (distance + reach)
        height = np.einsum("nd,nd->n", between, s.n[o])
        turned = np.arccos(np.clip(np.einsum("nd,nd->n", s.n[node], s.n[o]), -1.0, 1.0))
        spread = s.cone[node] + s.cone[o]
        back = (height - reach - tilted < 0.0) & (turned + spread > 0.5 * np.pi) & (distance - reach < K.farthest)
        clear = (height + reach + tilted < 0.0) & (turned - spread > 0.5 * np.pi)
        near = s.radius[node] > OPENING * np.where(clear, 1.0, 0.5) * (distance - s.radius[o])
        near &= s.area[node] * K.reflectance(np.square(np.maximum(distance - reach, 0.0))).max(axis=0) > K.faint
        stays = back & (~near | (node < V))
        found.append(np.stack([patch[stays], node[stays]]))
        opened = np.flatnonzero(back & near & (node >= V))
        if not len(opened):
            break
        node, owner = s.children(node[opened])
        patch = patch[opened][owner]
    pairs = np.concatenate(found, axis=1)
    pairs = pairs[:, np.argsort(pairs[0], kind="stable")]
    return pairs[0], pairs[1]


def ragged_rows(values: Array, first: Array, count: Array) -> Array:
    """Ranges of values side by side (B, longest), one wide at least, -1 beyond their ends."""
    at = np.arange(max(int(count.max()), 1))
    inside = at < count[:, None]
    return np.append(values, -1)[np.where(inside, first[:, None] + at, -1)]
