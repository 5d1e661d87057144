"""An octree over points on a surface, in the order in which it is walked without a stack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

LEAF = 8  # points that a cell may hold uncut (Jensen & Buhler 2002; Mikkelsen 2009, 3.2)
_BITS = 21  # of each coordinate: three of them fit into 64 bits


@dataclass(frozen=True, eq=False)
class Octree:
    """Nodes, parents before their children: the first child of an inner node is the one after it, and `next` of a child
    is its sibling. The lowest nodes are single points. Cells that would have one child only are left out.

    A node holds the points from `first` to `first + count` in the order that `octree` gives.
    """

    first: Array
    """int64 (K,)"""
    count: Array
    """int64 (K,)"""
    next: Array
    """int64 (K,), the node after those below this one; K for the last"""
    height: Array
    """int64 (K,), 0 for points, else one more than the highest child's"""

    def sums(self, values: Array) -> Array:
        """float64 (K, ...): the sum over each node's points of `values` (N, ...)."""
        before = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0, dtype=np.float64)])
        return before[self.first + self.count] - before[self.first]

    def lowest(self, values: Array) -> Array:
        """(K, ...): the least over each node's points of `values` (N, ...)."""
        found = np.empty((len(self.first), *values.shape[1:]), values.dtype)
        for nodes, points, starts in self.levels():
            found[nodes] = np.minimum.reduceat(values[points], starts, axis=0)
        return found

    def levels(self) -> Iterator[tuple[Array, Array, Array]]:
        """By height, from the leaves up: the nodes, their points one node after the other, where each node's begin."""
        for height in range(int(self.height.max()) + 1):
            nodes = np.flatnonzero(self.height == height)
            starts = np.concatenate([[0], np.cumsum(self.count[nodes])])
            points = np.repeat(self.first[nodes] - starts[:-1], self.count[nodes]) + np.arange(starts[-1])
            yield nodes, points, starts[:-1]


def octree(points: Array) -> tuple[Octree, Array]:
    """The octree of points (N, 3), N at least 1, and their order (N,) in it.

    A cell of at most LEAF points is not cut further; nor is one as small as 2^-21 of the box around all.
    """
    key = morton(points)
    order = np.argsort(key, kind="stable")
    key = key[order]
    each = np.arange(len(key))
    starts, ends, found = each[:1], each[-1:] + 1, [np.stack([each, each + 1], axis=1)]
    for level in range(_BITS + 1):
        found.append(np.stack([starts, ends], axis=1))
        large = ends - starts > LEAF
        if level == _BITS or not large.any():
            break
        prefix = key >> np.uint64(3 * (_BITS - 1 - level))
        cuts = np.flatnonzero(prefix[1:] != prefix[:-1]) + 1
        starts, ends = _cut(starts[large], ends[large], cuts)
    ranges = np.unique(np.concatenate(found), axis=0)  # an only child is as long as its parent
    # Parents before children: of those that start together, the longest first.
    ranges = ranges[np.lexsort((-ranges[:, 1], ranges[:, 0]))]
    first, end = ranges.T
    after = np.searchsorted(first, end, side="left")
    return Octree(first, end - first, after, _heights(after)), order


def morton(points: Array) -> Array:
    """uint64 (N,): the bits of the coordinates in the points' box, interleaved, so that each octal digit is a cell."""
    low = points.min(axis=0).astype(np.float64)
    size = max(float((points.max(axis=0) - low).max()), 1e-30)
    cell = np.minimum((points - low) / size * 2.0**_BITS, 2.0**_BITS - 1).astype(np.uint64)
    key = np.zeros(len(points), np.uint64)
    for bit in range(_BITS):
        for axis in range(3):
            key |= (cell[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return key


def _cut(starts: Array, ends: Array, cuts: Array) -> tuple[Array, Array]:
    """The parts of ranges that are cut at `cuts`, ascending."""
    low, high = np.searchsorted(cuts, starts, side="right"), np.searchsorted(cuts, ends, side="left")
    inside = np.zeros(len(cuts) + 1, int)
    np.add.at(inside, low, 1)
    np.add.at(inside, high, -1)
    cuts = cuts[np.cumsum(inside)[:-1] > 0]
    return np.sort(np.concatenate([starts, cuts])), np.sort(np.concatenate([cuts, ends]))


def _heights(after: Array) -> Array:
    """The height of each node above its highest leaf, from the nodes that follow their subtrees."""
    nodes = np.arange(len(after))
    height = np.zeros(len(after), np.int64)
    parent = _parents(after)
    below = nodes[after == nodes + 1]  # leaves
    while len(below):
        up = parent[below]
        below, up = below[up >= 0], up[up >= 0]
        np.maximum.at(height, up, height[below] + 1)
        below = np.unique(up)
    return height


def _parents(after: Array) -> Array:
    """The parent of each node, -1 for the root."""
    parent = np.full(len(after), -1)
    level = np.array([0])
    while len(level):
        inner = level[after[level] > level + 1]
        child, owner, found = inner + 1, inner, []
        while len(child):
            parent[child] = owner
            found.append(child)
            child = after[child]
            more = child < after[owner]
            child, owner = child[more], owner[more]
        level = np.concatenate(found) if found else np.zeros(0, np.int64)
    return parent
