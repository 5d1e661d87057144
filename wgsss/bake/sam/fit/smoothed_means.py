"""Means over nodes of a tree that fade into their neighbours, as what scatters below a surface does."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.point_tree import PointTree
from wgsss.bake.sam.sender_map import SmoothedMeans

Array = npt.NDArray[Any]

WIDTHS = (0.7, 1.2)
"""sigmas of their weights by distance, in roots of a node's area. Means that end at borders err a third more; the
second, between one level and the next, takes a tenth off."""


def smoothed_means(tree: PointTree, x: Array, n: Array, area: Array) -> SmoothedMeans:
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
    return SmoothedMeans(np.tile(node, (len(WIDTHS), 1)), weight.reshape(-1, most))
