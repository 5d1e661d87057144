"""Vertices that lie between others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Blend:
    """N vertices, each a weighted mean of up to three of V others."""

    index: Array
    """int64 (N, 3)"""
    weight: Array
    """float64 (N, 3), rows sum to 1"""

    @classmethod
    def same(cls, index: Array) -> Blend:
        """Vertices that are each one of the others (N,)."""
        weight = np.zeros((len(index), 3))
        weight[:, 0] = 1
        return cls(np.repeat(index[:, None], 3, axis=1), weight)

    def at(self, chosen: Array) -> Blend:
        """Some of the vertices, by index."""
        return Blend(self.index[chosen], self.weight[chosen])

    def of(self, values: Array) -> Array:
        """(N, k) of the others' (V, k). What is one of them has its value to the bit."""
        first, *rest = (self.weight[:, i, None] * values[self.index[:, i]] for i in range(3))
        for more in rest:
            first = first + more
        return first
