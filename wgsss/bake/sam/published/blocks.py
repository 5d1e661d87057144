"""Blocks of neighbouring vertices, with bounds of what one block can send to another.

The search for the largest form factors (`top`) visits the blocks of senders in the order of an upper bound of what any
of their vertices can contribute, and stops where no later block can contribute more than the senders already found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.form_factors import Reflectance
from wgsss.bake.sam.point_tree import point_tree
from wgsss.optics.lookup import interval_starts, leading_bits
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/top"
_ROUNDING = 1e-5  # error of cosines in float32
_ROW = 16  # blocks in a row: rows are compared first, then the blocks of the best rows
_PER_ROW = 4  # blocks of a row, on average, that are worth a visit
_NORMAL_SCALE = 8.0  # spacings of the vertices, about the width of a block, that opposite normals count as apart


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of N groups of fans: of their places, sizes and normals."""

    low: Array
    """(N, 3), mm: the lower corner of a box around the centroids of a group's fans"""
    high: Array
    """(N, 3), mm: the upper corner"""
    extent: Array
    """(N,), mm^2: the smallest extent of a fan, its mean squared distance from its centroid"""
    area: Array
    """(N,), mm^2: the area of the largest fan"""
    axis: Array
    """(N, 3), unit: the direction of the mean normal"""
    cone: Array
    """(N,), radians: the largest angle between the axis and a normal"""

    @classmethod
    def of_fans(cls, fans: Fans, order: Array) -> Bounds:
        """Return the bounds of single fans, in an order (N,) of vertices."""
        centre = fans.centre[order]
        return cls(centre, centre, fans.extent[order], fans.area[order], fans.normal[order], np.zeros(len(order)))

    def merged(self, first: Array) -> Bounds:
        """Return the bounds, float32, of unions of consecutive groups, which begin at the indices `first` (M,)."""
        if not len(first):
            return self
        mean = np.add.reduceat(self.axis, first, axis=0)
        mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
        union = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(self.area))))
        cosine = np.einsum("nk,nk->n", self.axis, mean[union]) - _ROUNDING
        angle = np.arccos(np.clip(cosine, -1.0, 1.0)) + self.cone
        values = (
            np.minimum.reduceat(self.low, first, axis=0),
            np.maximum.reduceat(self.high, first, axis=0),
            np.minimum.reduceat(self.extent, first),
            np.maximum.reduceat(self.area, first),
            mean,
            np.maximum.reduceat(angle, first),
        )
        return Bounds(*(value.astype(np.float32) for value in values))

    def __getitem__(self, index: Any) -> Bounds:
        """Return the bounds of some groups, by a numpy index of any shape."""
        return Bounds(
            self.low[index], self.high[index], self.extent[index], self.area[index], self.axis[index], self.cone[index]
        )

    def least_square(self, other: Bounds) -> Array:
        """Return a lower bound of the mean squared distance between two fans, one of each group (...), mm^2."""
        square = self.extent + other.extent
        for k in range(3):
            gap = np.maximum(other.low[..., k] - self.high[..., k], self.low[..., k] - other.high[..., k])
            np.maximum(gap, 0.0, out=gap)
            square += np.square(gap, out=gap)
        return square

    def may_face_away(self, other: Bounds) -> Array:
        """Return whether two normals, one of each group, can be at more than a right angle (eq. 14), bool (...)."""
        cosine = sum(self.axis[..., k] * other.axis[..., k] for k in range(3))
        may_face_away: Array = cosine <= np.sin(np.minimum(self.cone + other.cone, 0.5 * np.pi)) + _ROUNDING
        return may_face_away


class Blocks:
    """The vertices of a mesh that have faces, in blocks of at most GROUP, as `wgsl/sam/top.wgsl` reads them."""

    def __init__(self, mesh: Mesh, fans: Fans, R: Reflectance, reach: float, sending: Array | None = None) -> None:
        """Sort the vertices into blocks and prepare the tables of the search.

        Args:
            reach: mm; senders that are farther away are ignored.
            sending: bool (V,); if given, only these vertices send, and only the others receive.
        """
        module = wgsl.load(_MODULE)
        sending = np.ones(len(fans.area), bool) if sending is None else sending
        order, edges = _in_blocks(fans, (fans.area > 0.0) & sending, module.constants["GROUP"])
        self.senders = len(edges)
        """the number of blocks of senders, which are the first blocks"""
        self.receivers = slice(0, self.senders)
        """the blocks of receivers: the same ones, or with `sending` those after them"""
        if not sending.all():
            others, more = _in_blocks(fans, (fans.area > 0.0) & ~sending, module.constants["GROUP"])
            self.receivers = slice(len(edges), len(edges) + len(more))
            order, edges = np.concatenate([order, others]), np.concatenate([edges, len(order) + more])
        self.order = order
        """int (N,): the vertices in the order of the blocks"""
        self.edges = np.append(edges, len(order))
        """int (B + 1,): where each block begins in `order`, and N"""
        vertex = {"position": mesh.positions, "area": fans.area, "normal": mesh.normals, "extent": fans.extent}
        vertex = {name: values[order] for name, values in (*vertex.items(), ("centre", fans.centre))}
        self.vertices = module.layout("array<Vertex>").pack(vertex)

        self.bounds = Bounds.of_fans(fans, order).merged(edges)
        self.ranges = module.layout("array<Block>").pack(
            {"first": edges, "end": self.edges[1:], "area": self.bounds.area}
        )
        self.rows = self.bounds[: self.senders].merged(np.arange(0, self.senders, _ROW))

        end = np.searchsorted(R.squares, reach * reach)
        total = R.R[: max(end, 1), :3].astype(np.float64).sum(axis=1)
        self.first = R.first
        """the leading bits of the first squared distance of `total`"""
        self.total = np.append(total, 0.0).astype(np.float32)
        """float32 (k,), 1/mm^2: R_d, summed over the channels, over the squared distance; the last is 0"""
        self._bound = np.maximum.accumulate(self.total[::-1])[::-1]  # of R_d at this distance or any larger one
        least, largest = leading_bits(self._bound[[-2, 0]]).tolist()
        self.first_reach = max(least, 1)
        """the leading bits of the first value of R_d of `reach`"""
        levels = interval_starts(self.first_reach, max(largest, self.first_reach) + 1)
        ends = np.append(R.squares, np.inf)
        self.reach = ends[np.searchsorted(-self._bound, -levels, side="right")].astype(np.float32)
        """float32 (m,), mm^2: the inverse of `total`, over the leading bits of R_d: the squared distance beyond which
        R_d is smaller"""

    def candidates(self, groups: Array, count: int) -> tuple[Array, Array, Array]:
        """Return, for each group of receivers, the blocks that can contribute most.

        Args:
            groups: int (g,), the blocks of the receivers.
            count: the largest number of blocks to return for each group.

        Returns:
            The blocks (g, k) in falling order of their bounds; the bounds (g, k) of what a vertex of a block can
            contribute to one of the group, 0 for no block; and the largest bound (g,) of the blocks left out.
        """
        own = self.bounds[groups[:, None]]
        _, rows, rest_of_rows = _largest(self._contribution_bound(own, self.rows), max(count // _PER_ROW, 1))
        block = (rows[:, :, None] * _ROW + np.arange(_ROW)).reshape(len(groups), -1)
        existing = np.minimum(block, self.senders - 1)
        bound = self._contribution_bound(own, self.bounds[existing])
        bound, chosen, rest = _largest(np.where(block < self.senders, bound, np.float32(0.0)), count)
        return np.take_along_axis(existing, chosen, axis=1), bound, np.maximum(rest_of_rows, rest)

    def _contribution_bound(self, groups: Bounds, blocks: Bounds) -> Array:
        """Return an upper bound of area times R_d, summed over the channels, between any vertices, float32 (g, k)."""
        square = groups.least_square(blocks)
        entry = np.clip(leading_bits(square) - self.first, 0, len(self._bound) - 1)
        bound = self._bound[entry] * blocks.area
        bound *= groups.may_face_away(blocks)
        return bound


def _largest(values: Array, count: int) -> tuple[Array, Array, Array]:
    """Return the largest values of each row (g, count) in falling order, their columns, and the next largest (g,)."""
    if count < values.shape[1]:
        column = np.argpartition(-values, count, axis=1)
        rest = np.take_along_axis(values, column[:, count : count + 1], axis=1)[:, 0]
        column = column[:, :count]
    else:
        column, rest = np.broadcast_to(np.arange(values.shape[1]), values.shape), np.zeros(len(values), values.dtype)
    largest = np.take_along_axis(values, column, axis=1)
    order = np.argsort(-largest, axis=1, kind="stable")
    return np.take_along_axis(largest, order, axis=1), np.take_along_axis(column, order, axis=1), rest


def _in_blocks(fans: Fans, chosen: Array, size: int) -> tuple[Array, Array]:
    """Return the vertices of a mask (V,) in an order of blocks of at most `size`, and where each block begins."""
    vertices = np.flatnonzero(chosen)
    if not len(vertices):
        return vertices, vertices
    spacing = np.sqrt(fans.area[vertices].mean())
    order = point_tree(np.column_stack([fans.centre, _NORMAL_SCALE * spacing * fans.normal])[vertices]).order
    parts = 1
    while parts * size < len(vertices):
        parts *= 2
    return vertices[order], len(vertices) * np.arange(parts) // parts
