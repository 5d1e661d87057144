"""What a Spatial Adjacency Map holds for each vertex, whichever way it was chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.point_tree import PointTree
from wgsss.bake.samples import Samples
from wgsss.cache import Arrays

Array = npt.NDArray[Any]

ENTRY_BYTES = 16
"""of one entry: a sender and three weights"""


MIXTURE_BYTES = 48
"""of a vertex: ROWS of wgsl/sam/mix.wgsl, each a number and a half, and three halves more"""


@dataclass(frozen=True, eq=False)
class SmoothedMeans:
    """Means of nodes of a tree, each with some of those beside it."""

    node: Array
    """int32 (U, k): nodes of the tree, each mean's own first"""
    weight: Array
    """float32 (U, k), summing to 1; 0 where there are fewer"""

    def apply(self, means: Array) -> Array:
        """(U, ...): blended means (N, ...)."""
        return np.einsum("uk,uk...->u...", self.weight, means[self.node])

    def subset(self, rows: Array) -> SmoothedMeans:
        """Some of them (rows,)."""
        return SmoothedMeans(self.node[rows], self.weight[rows])


@dataclass(frozen=True, eq=False)
class NeighbourMixture:
    """M_back of each of V vertices as a sum of k products, `weight` times what `row` gathers, times `tint`."""

    row: Array
    """int32 (V, k)"""
    weight: Array
    """float16 (V, k), at least 0, without unit"""
    tint: Array
    """float16 (V, 3), without unit"""

    def apply(self, gathered: Array) -> Array:
        """(V, ..., 3): mixtures of what rows gather (R, ..., 3)."""
        weight, tint = self.weight.astype(gathered.dtype), self.tint.astype(gathered.dtype)
        return np.einsum("vk,vk...c,vc->v...c", weight, gathered[self.row], tint)


@dataclass(frozen=True, eq=False)
class SenderMap:
    """M_back at each of V vertices as a sum of n products (000 eq. 12): `weight` times what `sender` receives, L_d.

    Row v of `sender` and `weight` is that of vertex v. Any beyond are only read by the mixtures of a `mix`.

    A sender is a vertex, or one of `samples`; or, where there is a `tree`, a node: the mean over the vertices below it,
    weighted by the areas of their fans; where there is a `blend`, one of its means over such means. Where there is a
    `mix`, the sum is what a row gathers, and M_back a mixture of that.
    """

    sender: Array
    """int32 (R, n): below `senders` a vertex or a sample, else node or blend `sender - senders`; -1 where none is"""
    weight: Array
    """float32 (R, n, 3), without unit; 0 where there is no sender"""
    sender_count: int
    """V, or the number of samples"""
    sender_samples: Samples | None = None
    tree: PointTree | None = None
    smoothed_means: SmoothedMeans | None = None
    neighbour_mixture: NeighbourMixture | None = None

    @property
    def bytes(self) -> int:
        return ENTRY_BYTES * self.sender.size + (
            MIXTURE_BYTES * len(self.neighbour_mixture.row) if self.neighbour_mixture else 0
        )

    def arrays(self) -> Arrays:
        """All of it by name, as the cache keeps it."""
        parts = {
            "sender_samples": self.sender_samples,
            "tree": self.tree,
            "smoothed_means": self.smoothed_means,
            "neighbour_mixture": self.neighbour_mixture,
        }
        found = {f"{part}.{name}": a for part, held in parts.items() if held for name, a in vars(held).items()}
        return {"sender": self.sender, "weight": self.weight, "sender_count": np.array(self.sender_count), **found}

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> SenderMap:
        """The entries that `arrays` gave these arrays."""

        def part(kind: Any, name: str) -> Any:
            held = {key.removeprefix(name): a for key, a in arrays.items() if key.startswith(name)}
            return kind(**held) if held else None

        return cls(
            arrays["sender"],
            arrays["weight"],
            int(arrays["sender_count"]),
            part(Samples, "sender_samples."),
            part(PointTree, "tree."),
            part(SmoothedMeans, "smoothed_means."),
            part(NeighbourMixture, "neighbour_mixture."),
        )


def empty_entries(rows: int, n: int) -> tuple[Array, Array]:
    """Senders and weights of entries that are not there."""
    return np.full((rows, n), -1, np.int32), np.zeros((rows, n, 3), np.float32)


def gather_rows(sender: Array, weight: Array, light: Array) -> Array:
    """What rows (k, n) gather, float32 (k, T), in all channels together, where senders have `light` (S, T); its last
    row is that of no sender."""
    return np.asarray((weight.sum(axis=2)[:, None] @ light[sender])[:, 0])
