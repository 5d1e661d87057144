"""Vertices defined as weighted means of other vertices."""

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
        """Create vertices that each equal one of the others, with indices (N,)."""
        weight = np.zeros((len(index), 3))
        weight[:, 0] = 1
        return cls(np.repeat(index[:, None], 3, axis=1), weight)

    def at(self, chosen: Array) -> Blend:
        """Select some of the vertices by index."""
        return Blend(self.index[chosen], self.weight[chosen])

    def of(self, values: Array) -> Array:
        """Interpolate values (V, k) of the others: (N, k).

        A vertex that equals one of the others gets its exact value.
        """
        first, *rest = (self.weight[:, i, None] * values[self.index[:, i]] for i in range(3))
        for more in rest:
            first = first + more
        return first
