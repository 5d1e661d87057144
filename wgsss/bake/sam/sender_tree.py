"""The tree of senders: all vertices of a mesh, and nodes over them that stand for distant groups of vertices.

A vertex or a node is one sender, with a place, a mean normal and an area. Far from a receiver one node is enough for
many vertices, as in the hierarchical sum of Jensen & Buhler 2002 (Mikkelsen 2009, eq. 41). Bounds of the places and
normals below a node tell whether it is behind a receiver (Maisch & Ropinski 2017, eq. 13, 14) as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.point_tree import PointTree, point_tree
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class SenderTree:
    """The V vertices of a mesh followed by the N nodes over them, V + N senders in all. Arrays are float32."""

    tree: PointTree
    x: Array
    """(V + N, 3), mm: the positions of vertices; of a node, the area-weighted mean"""
    centre: Array
    """(V + N, 3), mm: the centroids of the fans; of a node, the area-weighted mean"""
    n: Array
    """(V + N, 3): unit normals; of a node, the direction of the area-weighted mean"""
    area: Array
    """(V + N,), mm^2: of the reduced fan; of a node, the sum"""
    radius: Array
    """(V + N,), mm: of a sphere about `x` that contains the fans of all vertices of a node; 0 for a vertex"""
    cone: Array
    """(V + N,), radians: the largest angle between `n` and the normal of a vertex of the node; 0 for a vertex"""

    @cached_property
    def parent(self) -> Array:
        """The node above each vertex and node, int64 (V + N,); -1 for the root."""
        tree, V = self.tree, len(self.tree.order)
        parent = np.full(len(self.area), -1)
        finest = np.arange(tree.levels[1])
        parent[tree.order] = V + np.repeat(finest, tree.count[finest])
        for level in range(len(tree.levels) - 2):
            a, b = tree.levels[level : level + 2]
            parent[V + a : V + b] = V + b + np.arange(b - a) // 4
        return parent

    def children(self, nodes: Array) -> tuple[Array, Array]:
        """Return all children of some nodes (k,), and for each child the index into `nodes` of its parent.

        The children of the finest nodes are vertices. `nodes` must not contain vertices.
        """
        tree, V = self.tree, len(self.tree.order)
        node = nodes - V
        level = np.searchsorted(tree.levels, node, side="right") - 1
        is_finest = level == 0
        count = np.where(is_finest, tree.count[node], 4)
        below = tree.levels[np.maximum(level - 1, 0)] + 4 * (node - tree.levels[level])
        start = np.where(is_finest, tree.first[node], V + below)
        owner = np.repeat(np.arange(len(nodes)), count)
        child = np.repeat(start - (np.cumsum(count) - count), count) + np.arange(count.sum())
        return np.where(is_finest[owner], tree.order[np.minimum(child, V - 1)], child), owner


def side_separation(profile: Profile) -> float:
    """Return the distance in mm up to which the tree must separate opposite sides of an object.

    It is the radius within which 99 % of the light leaves. Within it, light passes from one side to the other, so that
    vertices of both sides must not share a node.
    """
    return float(profile.range(0.01).max())


def sender_tree(mesh: Mesh, separation: float) -> SenderTree:
    """Build the tree over the vertices of a mesh.

    Args:
        separation: mm; vertices with opposite normals count as at least this far apart.
    """
    fans = Fans(mesh)
    x, n, area = mesh.positions.astype(np.float64), fans.normal, fans.area
    tree = point_tree(np.concatenate([x, 0.5 * separation * n], axis=1).astype(np.float32))
    # The small addition gives equal weights to the vertices of a node without area.
    shares = area + 1e-12 * max(float(area.max()), 1e-30)
    weight = tree.sums(shares)
    mean, centre, normal = (tree.sums(v * shares[:, None]) / weight[:, None] for v in (x, fans.centre, n))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    radius, cosine = np.zeros(len(weight)), np.ones(len(weight))
    for a, b in pairwise(tree.levels):
        owner = np.repeat(np.arange(a, b), tree.count[a:b])
        reach = np.linalg.norm(x[tree.order] - mean[owner], axis=1) + np.sqrt(area[tree.order])
        radius[a:b] = np.maximum.reduceat(reach, tree.first[a:b])
        cosine[a:b] = np.minimum.reduceat(np.einsum("nd,nd->n", n[tree.order], normal[owner]), tree.first[a:b])
    zero = np.zeros(len(x))
    vertices = (x, fans.centre, n, area, zero, zero)
    nodes = (mean, centre, normal, tree.sums(area), radius, np.arccos(np.clip(cosine, -1.0, 1.0)))
    return SenderTree(tree, *(np.concatenate(pair).astype(np.float32) for pair in zip(vertices, nodes, strict=True)))
