"""Smoothed means of L_d: for each node of the tree, a Gaussian-weighted mean over it and its neighbours.

The mean over a node alone ends abruptly at its border, but light that scatters below a surface does not. A mean that
fades into the neighbouring nodes resembles the area from which a receiver's light comes better.
"""

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
"""standard deviations of the Gaussians, in square roots of a node's mean area on its level. With means that end at the
borders of nodes, the error is a third larger. The second width, halfway to the next level, lessens it by a tenth"""


def smoothed_means(tree: PointTree, x: Array, n: Array, area: Array) -> SmoothedMeans:
    """Return the smoothed means of all N nodes for each of WIDTHS, (widths N) means in all: first those of one width.

    Args:
        tree: a tree with N nodes.
        x: (N, 3), the nodes' places, mm.
        n: (N, 3), their unit normals. Perpendicular normals count as 1.4 square roots of the level's mean area apart.
        area: (N,), mm^2.
    """
    from scipy.spatial import KDTree

    most = wgsl.load("sam/smoothed_means").constants["NEIGHBOURS"]
    node = np.repeat(np.arange(len(area), dtype=np.int32)[:, None], most, axis=1)
    weight = np.zeros((len(WIDTHS), len(area), most), np.float32)
    for a, b in pairwise(tree.levels):
        unit = max(float(np.sqrt(area[a:b].mean())), 1e-30)
        place = np.concatenate([x[a:b] / unit, n[a:b]], axis=1)
        k = min(most, b - a)
        distance, near = KDTree(place).query(place, k=np.arange(1, k + 1))
        own = np.arange(b - a)[:, None]
        # Put the node itself first. Of several nodes at one place, the search may find another one first.
        near = np.where(near == own, near[:, :1], near)
        near[:, :1] = own
        node[a:b, :k] = a + near
        for weight_of_width, width in zip(weight, WIDTHS, strict=True):
            gauss = np.exp(-np.square(distance) / (2.0 * width**2))
            weight_of_width[a:b, :k] = gauss * np.maximum(area[a:b], 1e-30)[near]
    weight /= weight.sum(axis=2, keepdims=True)
    return SmoothedMeans(np.tile(node, (len(WIDTHS), 1)), weight.reshape(-1, most))
