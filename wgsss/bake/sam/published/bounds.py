"""Bounds of groups of fans: where they are, how they face, and so how little can be between two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fan_quadrature import Fans

Array = npt.NDArray[Any]

_ROUNDING = 1e-5  # of cosines in float32


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
