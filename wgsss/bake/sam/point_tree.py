"""A balanced tree over points, in which each node has four children.

The points are halved again and again at the median along the axis in which they vary most, so nodes are compact. With
scaled normals as further coordinates, points that are near but face different ways fall into different nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class PointTree:
    """A tree over V points. Its N nodes are numbered level by level, from the finest level to the root.

    Each node covers a contiguous range of the points in the tree's order. Node k of a level, counted from the first
    node of that level, has the nodes 4 k to 4 k + 3 of the next finer level as children.
    """

    order: Array
    """int32 (V,): the points in the tree's order"""
    levels: Array
    """int32 (levels + 1,): the first node of each level, and N; the last level has one node, the root"""
    first: Array
    """int32 (N,): where the points of each node begin in `order`"""
    count: Array
    """int32 (N,): the number of points of each node, 1 to 4 on the finest level"""

    def sums(self, values: Array) -> Array:
        """Return the sum of `values` (V, ...) over the points of each node, float64 (N, ...)."""
        before = np.zeros((len(self.order) + 1, *values.shape[1:]))
        np.cumsum(values[self.order], axis=0, dtype=np.float64, out=before[1:])
        return before[self.first + self.count] - before[self.first]


def point_tree(coordinates: Array) -> PointTree:
    """Build the tree over points with `coordinates` (V, d), for V of at least 1 and any d."""
    V = len(coordinates)
    order = np.arange(V)
    depth = 0
    while 4 ** (depth + 1) <= V:
        depth += 1
    for halving in range(2 * depth):
        edges = _part_edges(V, 2**halving)
        part = np.repeat(np.arange(2**halving), np.diff(edges))
        ordered = coordinates[order]
        size = np.diff(edges)[:, None]
        mean = np.add.reduceat(ordered, edges[:-1]) / size
        spread = np.add.reduceat(np.square(ordered - mean[part]), edges[:-1])
        along = ordered[np.arange(V), spread.argmax(axis=1)[part]]
        order = order[np.lexsort((along, part))]
    level_edges = [_part_edges(V, 4**level) for level in range(depth, -1, -1)]
    return PointTree(
        order.astype(np.int32),
        np.cumsum([0, *(len(edges) - 1 for edges in level_edges)]).astype(np.int32),
        np.concatenate([edges[:-1] for edges in level_edges]).astype(np.int32),
        np.concatenate([np.diff(edges) for edges in level_edges]).astype(np.int32),
    )


def _part_edges(points: int, parts: int) -> Array:
    """Return where equal parts of a sequence of points begin and end (parts + 1,).

    The edges of twice as many parts include these.
    """
    return points * np.arange(parts + 1) // parts
