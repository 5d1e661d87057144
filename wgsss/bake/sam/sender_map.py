"""The data of a Spatial Adjacency Map, whichever selection chose its senders.

A map lists a few entries for each vertex, the receiver: a sender and a weight for each colour channel. M_back of the
receiver is the sum of the weights times L_d at the senders (Maisch & Ropinski 2017, eq. 12). The selections `top` and
`coarse` use only this. The selection `fit` also uses means over groups of vertices as senders (`SmoothedMeans`) and
mixes the sums of neighbouring receivers (`NeighbourMixture`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.point_tree import PointTree
from wgsss.bake.samples import Samples
from wgsss.cache import Arrays
from wgsss.optics import Profile

Array = npt.NDArray[Any]

ENTRY_BYTES = 16
"""bytes of one entry on the device: a sender and three weights"""
MIXTURE_BYTES = 48
"""bytes of one mixture on the device: ROWS (wgsl/sam/neighbour_mixture.wgsl) times an index and a float16, and three
float16 more"""
FAINTEST = 1e-3
"""smallest total weight of a receiver, as a share of the total of R_d: receivers with less in all channels have no
entries"""


@dataclass(frozen=True, eq=False)
class SmoothedMeans:
    """U weighted means of L_d, each over a tree node and its neighbours on the same level.

    Mean u is the sum over k of weight[u, k] times the mean of node[u, k].
    """

    node: Array
    """int32 (U, k): nodes of the tree; the first one is the node that the mean replaces"""
    weight: Array
    """float32 (U, k), sums to 1 over k; 0 where there are fewer than k nodes"""

    def apply(self, means: Array) -> Array:
        """Return the smoothed means (U, ...) of the nodes' own means (N, ...)."""
        return np.einsum("uk,uk...->u...", self.weight, means[self.node])

    def subset(self, rows: Array) -> SmoothedMeans:
        """Return only the means with the indices `rows` (r,)."""
        return SmoothedMeans(self.node[rows], self.weight[rows])


@dataclass(frozen=True, eq=False)
class NeighbourMixture:
    """M_back of V vertices as mixtures of the sums that rows of entries gather.

    M_back of vertex v is tint[v] times the sum over k of weight[v, k] times the sum of row[v, k].
    """

    row: Array
    """int32 (V, k): rows of a SenderMap's entries"""
    weight: Array
    """float16 (V, k), at least 0, without unit"""
    tint: Array
    """float16 (V, 3), without unit: a factor for each colour channel"""

    def apply(self, gathered: Array) -> Array:
        """Return M_back (V, ..., 3) from `gathered` (R, ..., 3), the sums of all rows of entries."""
        weight, tint = self.weight.astype(gathered.dtype), self.tint.astype(gathered.dtype)
        return np.einsum("vk,vk...c,vc->v...c", weight, gathered[self.row], tint)


@dataclass(frozen=True, eq=False)
class SenderMap:
    """A Spatial Adjacency Map: R rows of n entries, of which the first V belong to the V vertices of the mesh.

    The sum of row r is the sum over k of weight[r, k] times L_d of sender[r, k] (eq. 12). It is M_back of vertex r,
    unless there is a `neighbour_mixture`, which computes M_back from the sums of all rows. Rows beyond V belong to no
    vertex; only mixtures read them.

    The optional parts say what the senders are. By default they are vertices; with `sender_samples`, they are these
    points of the surface instead. With a `tree`, nodes can be senders, too: the mean of L_d over the vertices below,
    weighted by fan areas. With `smoothed_means`, these means take the place of the nodes.
    """

    sender: Array
    """int32 (R, n): below `sender_count` a vertex or sample; from there on, `sender_count` plus the index of a node or
    smoothed mean; -1 for an entry that is not used"""
    weight: Array
    """float32 (R, n, 3), without unit; 0 for an entry that is not used"""
    sender_count: int
    """the number of vertices or samples that can be senders"""
    sender_samples: Samples | None = None
    tree: PointTree | None = None
    smoothed_means: SmoothedMeans | None = None
    neighbour_mixture: NeighbourMixture | None = None

    @property
    def bytes(self) -> int:
        """Bytes of the entries and mixtures on the device."""
        mixtures = 0 if self.neighbour_mixture is None else len(self.neighbour_mixture.row)
        return ENTRY_BYTES * self.sender.size + MIXTURE_BYTES * mixtures

    def arrays(self) -> Arrays:
        """Return the content as arrays by name, for the cache. Names of optional parts' arrays are 'part.field'."""
        arrays = {"sender": self.sender, "weight": self.weight, "sender_count": np.array(self.sender_count)}
        for part in _PARTS:
            if (value := getattr(self, part)) is not None:
                arrays |= {f"{part}.{field.name}": getattr(value, field.name) for field in fields(value)}
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> SenderMap:
        """Return the map whose method `arrays` returned these arrays."""
        parts: dict[str, Any] = {}
        for part, kind in _PARTS.items():
            head = f"{part}."
            values = {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}
            parts[part] = kind(**values) if values else None
        return cls(arrays["sender"], arrays["weight"], int(arrays["sender_count"]), **parts)


_PARTS: dict[str, type[Any]] = {
    "sender_samples": Samples,
    "tree": PointTree,
    "smoothed_means": SmoothedMeans,
    "neighbour_mixture": NeighbourMixture,
}
"""The optional parts of a map."""


def empty_entries(rows: int, n: int) -> tuple[Array, Array]:
    """Return senders (rows, n) and weights (rows, n, 3) of entries that are not used: -1 and 0."""
    return np.full((rows, n), -1, np.int32), np.zeros((rows, n, 3), np.float32)


def clear_faint_rows(weight: Array, profile: Profile) -> None:
    """Set the weights (R, n, 3) of those rows to 0 that receive less than FAINTEST under uniform light."""
    weight[(weight.sum(axis=1) < FAINTEST * profile.total).all(axis=1)] = 0.0


def gather_rows(sender: Array, weight: Array, light: Array) -> Array:
    """Return the sums of rows of entries under several lights, added over the colour channels, float32 (k, T).

    Args:
        sender: int (k, n), indices into the rows of `light`; -1 is its last row, which must be 0.
        weight: float32 (k, n, 3).
        light: float32 (S, T), the irradiance of each sender under T lights, the same in all channels.
    """
    return np.asarray((weight.sum(axis=2)[:, None] @ light[sender])[:, 0])
