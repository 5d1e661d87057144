"""A balanced tree over points of a surface: what is near and faces the same way is under one node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class PointTree:
    """Nodes by level, from the finest, each over a range of the points in an order of their own.

    Node k of a level, counted from the level's first, has nodes 4 k to 4 k + 3 of the finer level as children.
    """

    order: Array
    """int32 (V,): the points in the order of the tree"""
    levels: Array
    """int32 (levels + 1,): where each level's nodes begin; the last level is the root alone"""
    first: Array
    """int32 (N,): where a node's points begin in `order`"""
    count: Array
    """int32 (N,): how many they are, 1 to 4 on the finest level"""

    def sums(self, values: Array) -> Array:
        """float64 (N, ...): the sum over each node's points of `values` (V, ...)."""
        before = np.zeros((len(self.order) + 1, *values.shape[1:]))
        np.cumsum(values[self.order], axis=0, dtype=np.float64, out=before[1:])
        return before[self.first + self.count] - before[self.first]


def point_tree(where: Array) -> PointTree:
    """The tree of points at `where` (V, d), V at least 1. Each cut is at the median, along the axis of most spread."""
    V = len(where)
    order = np.arange(V)
    depth = 0
    while 4 ** (depth + 1) <= V:
        depth += 1
    for halving in range(2 * depth):
        edges = _edges(V, 2**halving)
        part = np.repeat(np.arange(2**halving), np.diff(edges))
        here = where[order]
        size = np.diff(edges)[:, None]
        mean = np.add.reduceat(here, edges[:-1]) / size
        spread = np.add.reduceat(np.square(here - mean[part]), edges[:-1])
        along = here[np.arange(V), spread.argmax(axis=1)[part]]
        order = order[np.lexsort((along, part))]
    cuts = [_edges(V, 4**level) for level in range(depth, -1, -1)]
    return PointTree(
        order.astype(np.int32),
        np.cumsum([0, *(len(e) - 1 for e in cuts)]).astype(np.int32),
        np.concatenate([e[:-1] for e in cuts]).astype(np.int32),
        np.concatenate([np.diff(e) for e in cuts]).astype(np.int32),
    )


def _edges(points: int, parts: int) -> Array:
    """Where (parts + 1,) equal parts of points begin; those of twice as many parts are among them."""
    return points * np.arange(parts + 1) // parts
