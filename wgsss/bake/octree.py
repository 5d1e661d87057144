"""An octree over points on a surface, in an order in which it can be traversed without a stack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

LEAF = 8  # the most points of a cell that is not divided (Jensen & Buhler 2002; Mikkelsen 2009, section 3.2)
_BITS = 21  # of each coordinate: three coordinates fit into 64 bits


@dataclass(frozen=True, eq=False)
class Octree:
    """K nodes, parents before their children.

    The first child of an inner node follows it, and `next` of a child is its sibling. Leaves are single points. Cells
    with one child are left out. A node contains the points from `first` to `first + count`, in the order that `octree`
    returns.
    """

    first: Array
    """int64 (K,): the first point of each node"""
    count: Array
    """int64 (K,): the number of its points"""
    next: Array
    """int64 (K,): the node that follows its subtree; K for the last one"""
    height: Array
    """int64 (K,): 0 for points, else one more than that of the highest child"""

    def sums(self, values: Array) -> Array:
        """Return the sum of `values` (N, ...) over the points of each node: float64 (K, ...)."""
        before = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0, dtype=np.float64)])
        return before[self.first + self.count] - before[self.first]

    def lowest(self, values: Array) -> Array:
        """Return the least of `values` (N, ...) over the points of each node: (K, ...)."""
        least = np.empty((len(self.first), *values.shape[1:]), values.dtype)
        for nodes, points, starts in self.levels():
            least[nodes] = np.minimum.reduceat(values[points], starts, axis=0)
        return least

    def levels(self) -> Iterator[tuple[Array, Array, Array]]:
        """Yield, for each height from the leaves up: the nodes, their points, and where those of each node start."""
        for height in range(int(self.height.max()) + 1):
            nodes = np.flatnonzero(self.height == height)
            starts = np.concatenate([[0], np.cumsum(self.count[nodes])])
            points = np.repeat(self.first[nodes] - starts[:-1], self.count[nodes]) + np.arange(starts[-1])
            yield nodes, points, starts[:-1]


def octree(points: Array) -> tuple[Octree, Array]:
    """Return the octree of points (N, 3), N at least 1, and the order (N,) of the points in it.

    A cell with at most LEAF points is not divided, nor one whose side is 2^-21 of that of the box around all points.
    """
    key = morton(points)
    order = np.argsort(key, kind="stable")
    key = key[order]
    each = np.arange(len(key))
    starts, ends, nodes = each[:1], each[-1:] + 1, [np.stack([each, each + 1], axis=1)]
    for level in range(_BITS + 1):
        nodes.append(np.stack([starts, ends], axis=1))
        large = ends - starts > LEAF
        if level == _BITS or not large.any():
            break
        prefix = key >> np.uint64(3 * (_BITS - 1 - level))
        cuts = np.flatnonzero(prefix[1:] != prefix[:-1]) + 1
        starts, ends = _cut(starts[large], ends[large], cuts)
    ranges = np.unique(np.concatenate(nodes), axis=0)  # an only child has the range of its parent
    # Parents before children: of ranges with the same start, the longest comes first.
    ranges = ranges[np.lexsort((-ranges[:, 1], ranges[:, 0]))]
    first, end = ranges.T
    after = np.searchsorted(first, end, side="left")
    return Octree(first, end - first, after, _heights(after)), order


def morton(points: Array) -> Array:
    """Return the Morton code of each point (N, 3) in their bounding box: uint64 (N,).

    Its octal digits are the cells of the octree that contain the point, from the largest to the smallest.
    """
    low = points.min(axis=0).astype(np.float64)
    size = max(float((points.max(axis=0) - low).max()), 1e-30)
    cell = np.minimum((points - low) / size * 2.0**_BITS, 2.0**_BITS - 1).astype(np.uint64)
    key = np.zeros(len(points), np.uint64)
    for bit in range(_BITS):
        for axis in range(3):
            key |= (cell[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return key


def _cut(starts: Array, ends: Array, cuts: Array) -> tuple[Array, Array]:
    """Return the starts and ends of the parts of ranges that are divided at `cuts`, ascending."""
    low, high = np.searchsorted(cuts, starts, side="right"), np.searchsorted(cuts, ends, side="left")
    inside = np.zeros(len(cuts) + 1, int)
    np.add.at(inside, low, 1)
    np.add.at(inside, high, -1)
    cuts = cuts[np.cumsum(inside)[:-1] > 0]
    return np.sort(np.concatenate([starts, cuts])), np.sort(np.concatenate([cuts, ends]))


def _heights(after: Array) -> Array:
    """Return the height (K,) of each node above its leaves, from the nodes `after` (K,) that follow the subtrees."""
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
    """Return the parent of each node (K,), -1 for the root, from the nodes `after` (K,) that follow the subtrees."""
    parent = np.full(len(after), -1)
    level = np.array([0])
    while len(level):
        inner = level[after[level] > level + 1]
        child, owner, children = inner + 1, inner, []
        while len(child):
            parent[child] = owner
            children.append(child)
            child = after[child]
            more = child < after[owner]
            child, owner = child[more], owner[more]
        level = np.concatenate(children) if children else np.zeros(0, np.int64)
    return parent
