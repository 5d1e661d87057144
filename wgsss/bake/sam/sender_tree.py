"""What reaches a patch of vertices through the object: the nodes of a tree over all vertices, each near enough to be
told from its neighbours and no nearer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.point_tree import PointTree, point_tree
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class SenderTree:
    """The vertices (V) of a mesh and the nodes (N) over them, in this order, in float32."""

    tree: PointTree
    x: Array
    """(V + N, 3), mm: the vertices; of nodes the means, weighted by area"""
    centre: Array
    """(V + N, 3), mm: the centroids of fans"""
    n: Array
    """(V + N, 3), unit: the direction of the mean normal"""
    area: Array
    """(V + N,), mm^2"""
    radius: Array
    """(V + N,), mm, about `x`, within which the fans of all vertices of a node are; 0 of vertices"""
    cone: Array
    """(V + N,), radians, about `n`, within which all their normals are"""

    @cached_property
    def parent(self) -> Array:
        """int64 (V + N,): the node above; -1 above the root."""
        made, V = self.tree, len(self.tree.order)
        found = np.full(len(self.area), -1)
        finest = np.arange(made.levels[1])
        found[made.order] = V + np.repeat(finest, made.count[finest])
        for level in range(len(made.levels) - 2):
            a, b = made.levels[level : level + 2]
            found[V + a : V + b] = V + b + np.arange(b - a) // 4
        return found

    def children(self, nodes: Array) -> tuple[Array, Array]:
        """The children of nodes (k,) above vertices, and for each the index into `nodes` of its parent."""
        made, V = self.tree, len(self.tree.order)
        node = nodes - V
        level = np.searchsorted(made.levels, node, side="right") - 1
        finest = level == 0
        count = np.where(finest, made.count[node], 4)
        below = made.levels[np.maximum(level - 1, 0)] + 4 * (node - made.levels[level])
        start = np.where(finest, made.first[node], V + below)
        owner = np.repeat(np.arange(len(nodes)), count)
        child = np.repeat(start - (np.cumsum(count) - count), count) + np.arange(count.sum())
        return np.where(finest[owner], made.order[np.minimum(child, V - 1)], child), owner


def sender_tree(mesh: Mesh, spread: float) -> SenderTree:
    """The vertices of a mesh and a tree over them that tells apart what faces opposite ways within `spread` mm."""
    fans = Fans(mesh)
    x, n, area = mesh.positions.astype(np.float64), fans.normal, fans.area
    made = point_tree(np.concatenate([x, 0.5 * spread * n], axis=1).astype(np.float32))
    # Where a node has no area, all of its vertices count alike.
    shares = area + 1e-12 * max(float(area.max()), 1e-30)
    weight = made.sums(shares)
    middle, centre, normal = (made.sums(v * shares[:, None]) / weight[:, None] for v in (x, fans.centre, n))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    radius, cosine = np.zeros(len(weight)), np.ones(len(weight))
    for a, b in pairwise(made.levels):
        own = np.repeat(np.arange(a, b), made.count[a:b])
        off = np.linalg.norm(x[made.order] - middle[own], axis=1) + np.sqrt(area[made.order])
        radius[a:b] = np.maximum.reduceat(off, made.first[a:b])
        cosine[a:b] = np.minimum.reduceat(np.einsum("nd,nd->n", n[made.order], normal[own]), made.first[a:b])
    point = np.zeros(len(x))
    of_vertices = (x, fans.centre, n, area, point, point)
    of_nodes = (middle, centre, normal, made.sums(area), radius, np.arccos(np.clip(cosine, -1.0, 1.0)))
    return SenderTree(
        made, *(np.concatenate(pair).astype(np.float32) for pair in zip(of_vertices, of_nodes, strict=True))
    )
