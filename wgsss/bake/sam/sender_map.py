"""What a Spatial Adjacency Map holds for each vertex, whichever way it was chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.neighbour_mixture import MIX_BYTES, Mix
from wgsss.bake.sam.fit.smoothed_means import Blend
from wgsss.bake.sam.tree import Tree
from wgsss.bake.samples import Samples
from wgsss.cache import Arrays

Array = npt.NDArray[Any]

BYTES = 16
"""of one entry: a sender and three weights"""


@dataclass(frozen=True, eq=False)
class Entries:
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
    senders: int
    """V, or the number of samples"""
    samples: Samples | None = None
    tree: Tree | None = None
    blend: Blend | None = None
    mix: Mix | None = None

    @property
    def bytes(self) -> int:
        return BYTES * self.sender.size + (MIX_BYTES * len(self.mix.row) if self.mix else 0)

    def arrays(self) -> Arrays:
        """All of it by name, as the cache keeps it."""
        parts = {"samples": self.samples, "tree": self.tree, "blend": self.blend, "mix": self.mix}
        found = {f"{part}.{name}": a for part, held in parts.items() if held for name, a in vars(held).items()}
        return {"sender": self.sender, "weight": self.weight, "senders": np.array(self.senders), **found}

    @classmethod
    def of(cls, arrays: Arrays) -> Entries:
        """The entries that `arrays` gave these arrays."""

        def part(kind: Any, name: str) -> Any:
            held = {key.removeprefix(name): a for key, a in arrays.items() if key.startswith(name)}
            return kind(**held) if held else None

        samples, tree = part(Samples, "samples."), part(Tree, "tree.")
        blend, mix = part(Blend, "blend."), part(Mix, "mix.")
        return cls(arrays["sender"], arrays["weight"], int(arrays["senders"]), samples, tree, blend, mix)


def empty(rows: int, n: int) -> tuple[Array, Array]:
    """Senders and weights of entries that are not there."""
    return np.full((rows, n), -1, np.int32), np.zeros((rows, n, 3), np.float32)


def gathered(sender: Array, weight: Array, light: Array) -> Array:
    """What rows (k, n) gather, float32 (k, T), in all channels together, where senders have `light` (S, T); its last
    row is that of no sender."""
    return np.asarray((weight.sum(axis=2)[:, None] @ light[sender])[:, 0])
