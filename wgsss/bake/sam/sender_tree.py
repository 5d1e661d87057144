"""What reaches a patch of vertices through the object: the nodes of a tree over all vertices, each near enough to be
told from its neighbours and no nearer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.tree import Tree, tree
from wgsss.scene.mesh import Mesh

if TYPE_CHECKING:
    from wgsss.bake.sam.fit.patch_form_factors import QuickFormFactors

Array = npt.NDArray[Any]

OPENING = 0.35
"""radius of a node over its distance, at most; the published criterion of the same kind (004 eq. 42) takes sizes"""
NEAR = 4.0
"""roots of a fan's area within which form factors are integrated; a fan is some 1.2 across"""
ORDER = 2
"""of the points in a quad that they are integrated by"""
_AT_ONCE = 1 << 16  # vertices whose neighbours are found at a time


@dataclass(frozen=True, eq=False)
class Senders:
    """The vertices (V) of a mesh and the nodes (N) over them, in this order, in float32."""

    tree: Tree
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


def senders(mesh: Mesh, spread: float) -> Senders:
    """The vertices of a mesh and a tree over them that tells apart what faces opposite ways within `spread` mm."""
    fans = Fans(mesh)
    x, n, area = mesh.positions.astype(np.float64), fans.normal, fans.area
    made = tree(np.concatenate([x, 0.5 * spread * n], axis=1).astype(np.float32))
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
    return Senders(made, *(np.concatenate(pair).astype(np.float32) for pair in zip(of_vertices, of_nodes, strict=True)))


def near_pairs(mesh: Mesh) -> Array:
    """int64 (P, 2): vertices o and i, on the back side of o, whose distance is NEAR roots of the larger fan's area at
    most; in ascending order."""
    from scipy.spatial import KDTree

    x, n, V = mesh.positions.astype(np.float64), mesh.normals, len(mesh.positions)
    reach = NEAR * np.sqrt(fan_areas(mesh))
    everything = KDTree(x)
    found = []
    order = np.argsort(reach, kind="stable")  # of those of one search, which has one radius, few have a smaller one
    for some in np.split(order, _cuts(reach[order])):
        pairs = KDTree(x[some]).sparse_distance_matrix(everything, reach[some[-1]], output_type="ndarray")
        o, i = some[pairs["i"]], pairs["j"]
        kept = (pairs["v"] <= reach[o]) & (np.einsum("pd,pd->p", n[o], n[i]) < 0.0)
        found += [o[kept] * V + i[kept], i[kept] * V + o[kept]]
    o, i = np.divmod(np.unique(np.concatenate(found)), V)
    below = np.einsum("pd,pd->p", x[i] - x[o], n[o]) < 0.0
    return np.stack([o, i], axis=1)[below]


def _cuts(reach: Array) -> Array:
    """Where to cut ascending reaches, so that those of a part are alike by a factor of the root of 2."""
    octave = np.floor(2.0 * np.log2(np.maximum(reach, 1e-30)))
    return np.flatnonzero((np.diff(octave) > 0) | (np.arange(1, len(reach)) % _AT_ONCE == 0)) + 1


def reaching(s: Senders, K: QuickFormFactors, patches: Array) -> tuple[Array, Array]:
    """What may reach nodes `patches` (p,) from behind: pairs of an index into `patches` and a sender, in order.

    Every vertex is under at most one sender of a patch.
    """
    patch, node = np.arange(len(patches)), np.full(len(patches), len(s.area) - 1)
    found: list[Array] = []
    V = len(s.tree.order)
    while len(node):
        o = patches[patch]
        between = s.x[node] - s.x[o]
        distance = np.linalg.norm(between, axis=1)
        reach = s.radius[node] + s.radius[o]
        # How far below the tangent planes, and how far turned away, anything under the two may be at most.
        tilted = np.sin(np.minimum(s.cone[o], 0.5 * np.pi)) * (distance + reach)
        height = np.einsum("nd,nd->n", between, s.n[o])
        turned = np.arccos(np.clip(np.einsum("nd,nd->n", s.n[node], s.n[o]), -1.0, 1.0))
        spread = s.cone[node] + s.cone[o]
        back = (height - reach - tilted < 0.0) & (turned + spread > 0.5 * np.pi) & (distance - reach < K.farthest)
        clear = (height + reach + tilted < 0.0) & (turned - spread > 0.5 * np.pi)
        near = s.radius[node] > OPENING * np.where(clear, 1.0, 0.5) * (distance - s.radius[o])
        near &= s.area[node] * K.reflectance(np.square(np.maximum(distance - reach, 0.0))).max(axis=0) > K.faint
        stays = back & (~near | (node < V))
        found.append(np.stack([patch[stays], node[stays]]))
        opened = np.flatnonzero(back & near & (node >= V))
        if not len(opened):
            break
        node, owner = s.children(node[opened])
        patch = patch[opened][owner]
    pairs = np.concatenate(found, axis=1)
    pairs = pairs[:, np.argsort(pairs[0], kind="stable")]
    return pairs[0], pairs[1]
