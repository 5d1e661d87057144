"""Vertices that are side by side, and what may reach them from behind, many patches at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.patch_form_factors import QuickFormFactors
from wgsss.bake.sam.fit.smoothed_means import WIDTHS
from wgsss.bake.sam.sender_tree import Senders, reaching
from wgsss.console import progress_bar

Array = npt.NDArray[Any]

DRAWS = 32
"""equal shares of a vertex's form factors: what holds the middle of one is a candidate, as are all nodes above it"""
PATCH = 1
"""level of the tree whose nodes, of 4 to 16 vertices, share candidates"""
_AT_ONCE = 256  # patches of a thread's task
_BLOCK = 4_000_000  # numbers that a batch of patches holds at a time, about


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches (p,), nodes of a tree, of chosen vertices."""

    node: Array
    """int64 (p,): their nodes"""
    leaf: Array
    """int64 (v,), ascending: where the vertices are in the tree's order"""

    @classmethod
    def of(cls, s: Senders, vertices: Array) -> Patches:
        """Those that chosen vertices (v,) are in."""
        levels = s.tree.levels
        level = min(PATCH, len(levels) - 2)
        place = np.empty(len(s.tree.order), np.int64)
        place[s.tree.order] = np.arange(len(place))
        leaf = np.sort(place[vertices])
        node = np.searchsorted(s.tree.first[levels[level] : levels[level + 1]], leaf, side="right") - 1
        return cls(levels[level] + np.unique(node), leaf)

    def each(self, work: Callable[[Patches], None], label: str) -> None:
        """Work on some at a time, on all cores."""
        parts = [Patches(self.node[i : i + _AT_ONCE], self.leaf) for i in range(0, len(self.node), _AT_ONCE)]
        with (
            progress_bar(total=len(self.node), desc=label, unit=" patches") as bar,
            ThreadPoolExecutor(os.cpu_count()) as pool,
        ):
            for part, _ in zip(parts, pool.map(work, parts), strict=True):
                bar.update(len(part.node))

    def batches(self, s: Senders, K: QuickFormFactors, lights: int) -> Iterator[tuple[Array, Array]]:
        """Those that much reaches last: their vertices (B, P) and what reaches them (B, C); -1 fills up."""
        made, V = s.tree, len(s.tree.order)
        patch, reached = reaching(s, K, V + self.node)
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
            yield _ranges(made.order[self.leaf], first[here], count[here]), _ranges(reached, start[here], size[here])
            i = j


def candidates(s: Senders, k: Array, reached: Array) -> Array:
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
    found = _ranges(sender, start[:-1], np.diff(start))
    V, nodes = len(s.tree.order), all_ - len(s.tree.order)
    is_mean = found >= V
    wider = [np.where(is_mean, found + width * nodes, -1) for width in range(2, 1 + len(WIDTHS))]
    return np.concatenate([np.where(is_mean, found + nodes, found), *wider], axis=1)


def _ranges(values: Array, first: Array, count: Array) -> Array:
    """Ranges of values side by side (B, longest), one wide at least, -1 beyond their ends."""
    at = np.arange(max(int(count.max()), 1))
    inside = at < count[:, None]
    return np.append(values, -1)[np.where(inside, first[:, None] + at, -1)]
