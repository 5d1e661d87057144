"""Means over nodes of a tree that fade into their neighbours, as what scatters below a surface does."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.tree import Tree

Array = npt.NDArray[Any]

WIDTHS = (0.7, 1.2)
"""sigmas of their weights by distance, in roots of a node's area. Means that end at borders err a third more; the
second, between one level and the next, takes a tenth off."""


@dataclass(frozen=True, eq=False)
class Blend:
    """Means of nodes of a tree, each with some of those beside it."""

    node: Array
    """int32 (U, k): nodes of the tree, each mean's own first"""
    weight: Array
    """float32 (U, k), summing to 1; 0 where there are fewer"""

    def of(self, means: Array) -> Array:
        """(U, ...): blended means (N, ...)."""
        return np.einsum("uk,uk...->u...", self.weight, means[self.node])

    def only(self, rows: Array) -> Blend:
        """Some of them (rows,)."""
        return Blend(self.node[rows], self.weight[rows])


def blend(tree: Tree, x: Array, n: Array, area: Array) -> Blend:
    """Every node of a tree with its neighbours, as wide as the first of WIDTHS, then every node as the next, and so on.

    `x` (N, 3) are their places, `n` (N, 3) unit normals, `area` (N,).
    Normals at a right angle count as far apart as 1.4 roots of the level's mean area.
    """
    from scipy.spatial import KDTree

    most = wgsl.load("sam/blends").constants["NEIGHBOURS"]
    node = np.repeat(np.arange(len(area), dtype=np.int32)[:, None], most, axis=1)
    weight = np.zeros((len(WIDTHS), len(area), most), np.float32)
    for a, b in pairwise(tree.levels):
        unit = max(float(np.sqrt(area[a:b].mean())), 1e-30)
        place = np.concatenate([x[a:b] / unit, n[a:b]], axis=1)
        k = min(most, b - a)
        away, near = KDTree(place).query(place, k=np.arange(1, k + 1))
        own = np.arange(b - a)[:, None]
        near = np.where(near == own, near[:, :1], near)  # of several at one place, any may be found first
        near[:, :1] = own
        node[a:b, :k] = a + near
        for of_width, width in zip(weight, WIDTHS, strict=True):
            of_width[a:b, :k] = np.exp(-np.square(away) / (2.0 * width**2)) * np.maximum(area[a:b], 1e-30)[near]
    weight /= weight.sum(axis=2, keepdims=True)
    return Blend(np.tile(node, (len(WIDTHS), 1)), weight.reshape(-1, most))
