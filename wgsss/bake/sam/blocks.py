"""Vertices in blocks of near ones that face the same way, and what one block can send to another at most."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.form_factors import Reflectance, shift, squares
from wgsss.bake.sam.parts import Fans
from wgsss.bake.sam.tree import tree
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/top"
_NORMALS = 8.0  # spacings of the vertices, about a block's width: how far apart opposite normals count as


class Blocks:
    """The vertices of a mesh that have a fan, in blocks, as `wgsl/sam/top.wgsl` reads them.

    `reach` is in mm: beyond, nothing is sent. Where `sending` (V,) is given, only those vertices send, and only the
    others receive.
    """

    def __init__(self, mesh: Mesh, fans: Fans, R: Reflectance, reach: float, sending: Array | None = None) -> None:
        module = wgsl.load(_MODULE)
        sending = np.ones(len(fans.area), bool) if sending is None else sending
        order, edges = _blocks(fans, (fans.area > 0.0) & sending, module.constants["GROUP"])
        self.senders = len(edges)
        """the first blocks, which send"""
        self.receivers = slice(0, self.senders)
        """the blocks that receive: the same, or where not all vertices send, those of the others"""
        if not sending.all():
            others, more = _blocks(fans, (fans.area > 0.0) & ~sending, module.constants["GROUP"])
            self.receivers = slice(len(edges), len(edges) + len(more))
            order, edges = np.concatenate([order, others]), np.concatenate([edges, len(order) + more])
        self.order = order
        """int (N,): the vertices in the order of the blocks"""
        self.edges = np.append(edges, len(order))
        """int (B + 1,): where blocks begin in it"""
        o, parts = self.order, len(edges)
        vertex = {"position": mesh.positions, "area": fans.area, "normal": mesh.normals, "extent": fans.extent}
        vertex = {name: values[o] for name, values in (*vertex.items(), ("centre", fans.centre))}
        self.vertices = module.layout("array<Vertex>").pack(vertex)

        def each(how: Any, values: Array) -> Array:
            return how.reduceat(values[o], self.edges[:-1], axis=0) if parts else values[o]

        self.area = each(np.maximum, fans.area).astype(np.float32)
        self.ranges = module.layout("array<Block>").pack(
            {"first": self.edges[:-1], "end": self.edges[1:], "area": self.area}
        )
        self._low, self._high = (each(how, fans.centre).astype(np.float32) for how in (np.minimum, np.maximum))
        self._extent = each(np.minimum, fans.extent).astype(np.float32)
        mean = each(np.add, fans.normal)
        self._axis = (mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)).astype(np.float32)
        which = np.repeat(np.arange(parts), np.diff(self.edges))
        apart = np.einsum("nk,nk->n", fans.normal[o], self._axis[which])
        cosine = np.minimum.reduceat(apart, self.edges[:-1]) if parts else apart
        self._cone = np.arccos(np.clip(cosine - 1e-6, -1.0, 1.0)).astype(np.float32)

        end = np.searchsorted(R.squares, reach * reach)
        total = R.R[: max(end, 1), :3].astype(np.float64).sum(axis=1)
        self.first = R.first
        """the leading bits of the first squared distance of `total`"""
        self.total = np.append(total, 0.0).astype(np.float32)
        """float32 (k,): R_d of all channels over the squared distance; 0 in the last"""
        self._most = np.maximum.accumulate(self.total[::-1])[::-1]  # at any larger distance: R may not fall steadily
        least, largest = (int(np.float32(v).view(np.uint32)) >> shift() for v in (self._most[-2], self._most[0]))
        self.first_reach = max(least, 1)
        levels = squares(self.first_reach, max(largest, self.first_reach) + 1)
        edges = np.append(R.squares, np.inf)
        self.reach = edges[np.searchsorted(-self._most, -levels, side="right")].astype(np.float32)
        """float32 (m,), mm^2: the squared distance from which on `total` is less, over its own leading bits"""

    def candidates(self, groups: Array, listed: int) -> tuple[Array, Array, Array]:
        """For each group (g,), a block itself, the blocks that can send the most to one of it: which (g, k) they are,
        the most, 0 for none (g, k), in falling order, and the most (g,) that others can send."""
        most = self._bound(groups)
        listed = min(listed, most.shape[1])
        if listed < most.shape[1]:
            ahead = np.argpartition(-most, listed, axis=1)
            rest = np.take_along_axis(most, ahead[:, listed : listed + 1], axis=1)[:, 0]
            ahead = ahead[:, :listed]
        else:
            ahead, rest = np.broadcast_to(np.arange(listed), most.shape), np.zeros(len(groups), np.float32)
        order = np.argsort(-np.take_along_axis(most, ahead, axis=1), axis=1, kind="stable")
        ahead = np.take_along_axis(ahead, order, axis=1)
        return ahead, np.take_along_axis(most, ahead, axis=1), rest

    def _bound(self, groups: Array) -> Array:
        """float32 (g, senders): what a vertex of a block sends to one of a group at most, of all channels together."""
        s = slice(0, self.senders)
        square = self._extent[groups, None] + self._extent[s]
        for low, high in zip(self._low.T, self._high.T, strict=True):
            gap = np.maximum(low[s] - high[groups, None], low[groups, None] - high[s])
            np.maximum(gap, 0.0, out=gap)
            square += np.square(gap, out=gap)
        entry = np.maximum(square.view(np.uint32) >> np.uint32(shift()), np.uint32(self.first)) - np.uint32(self.first)
        most = self._most[np.minimum(entry, np.uint32(len(self._most) - 1))] * self.area[s]
        # Normals of the two may be at a right angle, or more, if the axes are within both cones of it.
        cosine = self._axis[groups] @ self._axis[s].T
        cone = self._cone[groups, None] + self._cone[s]
        most[cosine > np.sin(np.minimum(cone, 0.5 * np.pi)) + 1e-5] = 0.0
        return most


def _blocks(fans: Fans, which: Array, size: int) -> tuple[Array, Array]:
    """Vertices in blocks of `size` at most, and where each block begins."""
    chosen = np.flatnonzero(which)
    if not len(chosen):
        return chosen, chosen
    spacing = np.sqrt(fans.area[chosen].mean())
    order = tree(np.column_stack([fans.centre, _NORMALS * spacing * fans.normal])[chosen]).order
    parts = 1
    while parts * size < len(chosen):
        parts *= 2
    return chosen[order], len(chosen) * np.arange(parts) // parts
