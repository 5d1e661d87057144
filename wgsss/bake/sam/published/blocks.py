"""Vertices in blocks of near ones that face the same way, and what one block can send to another at most."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.form_factors import Reflectance, shift, squares
from wgsss.bake.sam.point_tree import point_tree
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/top"
_ROUNDING = 1e-5  # of cosines in float32
_ROW = 16  # blocks in a row, that are looked at together first
_PER_ROW = 4  # of those, on average, that are worth a look
_NORMALS = 8.0  # spacings of the vertices, about a block's width: how far apart opposite normals count as


@dataclass(frozen=True, eq=False)
class Bounds:
    """Of N groups of fans, float32."""

    low: Array
    """(N, 3), mm, of the fans' centroids"""
    high: Array
    """(N, 3), mm"""
    extent: Array
    """(N,), mm^2: the least mean squared distance of a fan from its centroid"""
    area: Array
    """(N,), mm^2: the largest fan's"""
    axis: Array
    """(N, 3), of length 1: the mean normal"""
    cone: Array
    """(N,), radians about it, within which all normals lie"""

    @classmethod
    def of(cls, fans: Fans, order: Array, first: Array) -> Bounds:
        """Of fans in an `order`, in groups that begin at `first`."""
        none = np.zeros(len(order))
        return cls._around(
            fans.centre[order],
            fans.centre[order],
            fans.extent[order],
            fans.area[order],
            fans.normal[order],
            none,
            first,
        )

    def merged(self, count: int) -> Bounds:
        """Of `count` groups in a row, as one; the last may have fewer."""
        return self._around(
            self.low, self.high, self.extent, self.area, self.axis, self.cone, np.arange(0, len(self.area), count)
        )

    def __getitem__(self, which: Any) -> Bounds:
        return Bounds(*(value[which] for value in vars(self).values()))

    @classmethod
    def _around(
        cls, low: Array, high: Array, extent: Array, area: Array, axis: Array, cone: Array, first: Array
    ) -> Bounds:
        if not len(first):
            return cls(low, high, extent, area, axis, cone)
        mean = np.add.reduceat(axis, first, axis=0)
        mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
        whose = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(area))))
        off = np.arccos(np.clip(np.einsum("nk,nk->n", axis, mean[whose]) - _ROUNDING, -1.0, 1.0)) + cone
        found = (
            np.minimum.reduceat(low, first, axis=0),
            np.maximum.reduceat(high, first, axis=0),
            np.minimum.reduceat(extent, first),
            np.maximum.reduceat(area, first),
            mean,
            np.maximum.reduceat(off, first),
        )
        return cls(*(value.astype(np.float32) for value in found))

    def squared(self, other: Bounds) -> Array:
        """mm^2, (...): the least that the mean squared distance between a fan of one and one of the other can be."""
        square = self.extent + other.extent
        for k in range(3):
            gap = np.maximum(other.low[..., k] - self.high[..., k], self.low[..., k] - other.high[..., k])
            np.maximum(gap, 0.0, out=gap)
            square += np.square(gap, out=gap)
        return square

    def face_away(self, other: Bounds) -> Array:
        """bool (...): whether a normal of one and one of the other can be at more than a right angle."""
        cosine = sum(self.axis[..., k] * other.axis[..., k] for k in range(3))
        away: Array = cosine <= np.sin(np.minimum(self.cone + other.cone, 0.5 * np.pi)) + _ROUNDING
        return away


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
        o = self.order
        vertex = {"position": mesh.positions, "area": fans.area, "normal": mesh.normals, "extent": fans.extent}
        vertex = {name: values[o] for name, values in (*vertex.items(), ("centre", fans.centre))}
        self.vertices = module.layout("array<Vertex>").pack(vertex)

        self.bounds = Bounds.of(fans, o, edges)
        self.ranges = module.layout("array<Block>").pack(
            {"first": edges, "end": self.edges[1:], "area": self.bounds.area}
        )
        self.rows = self.bounds[: self.senders].merged(_ROW)

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
        own = self.bounds[groups[:, None]]
        most, rows, rest = _largest(self._most_between(own, self.rows), max(listed // _PER_ROW, 1))
        inside = (rows[:, :, None] * _ROW + np.arange(_ROW)).reshape(len(groups), -1)
        there = np.minimum(inside, self.senders - 1)
        each = np.where(inside < self.senders, self._most_between(own, self.bounds[there]), np.float32(0.0))
        most, chosen, others = _largest(each, listed)
        return np.take_along_axis(there, chosen, axis=1), most, np.maximum(rest, others)

    def _most_between(self, groups: Bounds, blocks: Bounds) -> Array:
        """float32 (g, k): what a vertex of a block sends to one of a group at most, of all channels together."""
        square = groups.squared(blocks)
        entry = np.maximum(square.view(np.uint32) >> np.uint32(shift()), np.uint32(self.first)) - np.uint32(self.first)
        most = self._most[np.minimum(entry, np.uint32(len(self._most) - 1))] * blocks.area
        most *= groups.face_away(blocks)
        return most


def _largest(values: Array, count: int) -> tuple[Array, Array, Array]:
    """The largest (g, count) of each row, in falling order, which they are, and the largest (g,) of the others."""
    if count < values.shape[1]:
        which = np.argpartition(-values, count, axis=1)
        rest = np.take_along_axis(values, which[:, count : count + 1], axis=1)[:, 0]
        which = which[:, :count]
    else:
        which, rest = np.broadcast_to(np.arange(values.shape[1]), values.shape), np.zeros(len(values), values.dtype)
    found = np.take_along_axis(values, which, axis=1)
    order = np.argsort(-found, axis=1, kind="stable")
    return np.take_along_axis(found, order, axis=1), np.take_along_axis(which, order, axis=1), rest


def _blocks(fans: Fans, which: Array, size: int) -> tuple[Array, Array]:
    """Vertices in blocks of `size` at most, and where each block begins."""
    chosen = np.flatnonzero(which)
    if not len(chosen):
        return chosen, chosen
    spacing = np.sqrt(fans.area[chosen].mean())
    order = point_tree(np.column_stack([fans.centre, _NORMALS * spacing * fans.normal])[chosen]).order
    parts = 1
    while parts * size < len(chosen):
        parts *= 2
    return chosen[order], len(chosen) * np.arange(parts) // parts
