"""What a vertex receives as a mixture of what its entries and those of its neighbours gather.

Vertices side by side that chose other senders err in other ways, which the eye sees as patches. Together they err less,
and alike.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.fit.batched_nnls import batched_nnls
from wgsss.bake.sam.sender_map import NeighbourMixture

Array = npt.NDArray[Any]
Gather = Callable[[Array], Array]
"""Gives what rows of entries (k,) gather, float32 (k, T), of T lights and all channels."""

NEAREST = 12
"""rows among which those of a mixture are chosen: a twentieth to a tenth less error than by the nearest alone"""
_TIES = 3e-4
"""of the square of a response: the price of parts of it that are not all the same"""
_MOST_TINT = 4.0
_FAINT = 0.03  # of a response: what is smaller is not made as large
_AT_ONCE = 512  # vertices


def neighbour_mixture(
    x: Array, n: Array, spacing: float, owner: Array, rows: Array, gather: Gather, response: Array
) -> NeighbourMixture:
    """The mixtures that are nearest to the vertices' responses to light in the least squares, in all channels together.

    Args:
        x: (V, 3), mm, where they are.
        n: (V, 3), their unit normals; at a right angle they count as far apart as 1.4 times `spacing`, mm.
        owner: int64 (R,), the vertices that rows are of, of the first V each its own.
        rows: int64 (k,), in ascending order, those that gather anything. Vertices without are mixtures of nothing.
        gather: what they gather.
        response: float32 (V, T), what vertices should receive.
    """
    from scipy.spatial import KDTree

    most = wgsl.load("sam/mix").constants["ROWS"]
    found = NeighbourMixture(
        np.tile(np.arange(len(x), dtype=np.int32)[:, None], (1, most)),
        np.zeros((len(x), most), np.float16),
        np.ones((len(x), 3), np.float16),
    )
    vertices = rows[rows < len(x)]
    if not len(vertices):
        return found
    place = np.concatenate([x[owner[rows]] / spacing, n[owner[rows]]], axis=1)
    count = min(NEAREST, len(rows))
    near = KDTree(place).query(place[: len(vertices)], k=np.arange(1, count + 1), workers=-1)[1]

    def choose(some: Array) -> None:
        among = rows[near[some]]
        part, _ = _parts(among, vertices[some], gather, response)
        part[owner[among] == vertices[some, None]] = np.inf  # its own
        # Of those that add as much, the nearest: rounding must not choose.
        kept = np.sort(np.argsort(-part.round(2), axis=1, kind="stable")[:, :most], axis=1)
        found.row[vertices[some], : kept.shape[1]] = np.take_along_axis(among, kept, axis=1)

    in_blocks(choose, np.arange(len(vertices)))
    solve_weights(found, vertices, gather, response)
    return found


def solve_weights(found: NeighbourMixture, vertices: Array, gather: Gather, response: Array) -> None:
    """Choose the weights of mixtures whose rows are known, as in `mix`."""
    k = min(found.row.shape[1], len(vertices))

    def solve(some: Array) -> None:
        part, scale = _parts(found.row[some, :k], some, gather, response)
        found.weight[some, :k] = scale * part

    in_blocks(solve, vertices)


def fit_tint(mixture: NeighbourMixture, even: Array, total: Array) -> None:
    """Choose the tint by which `even` (R, 3), what rows gather under even light, is mixed to `total` (V, 3)."""
    mixture.tint[:] = 1.0
    mixed = mixture.apply(even)
    mixture.tint[:] = np.clip(total / np.where(mixed > 0.0, mixed, 1.0), 0.0, _MOST_TINT)


def in_blocks(run: Callable[[Array], None], indices: Array) -> None:
    """Run for some of the indices at a time, on all cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, np.array_split(indices, max(-(-len(indices) // _AT_ONCE), 1))))


def _parts(among: Array, vertices: Array, gather: Gather, response: Array) -> tuple[Array, Array]:
    """Parts (B, k) of responses of vertices (B,), each of what a row of `among` (B, k) gathers, made as large as the
    response; and by how much that was (B, k)."""
    read, at = np.unique(among, return_inverse=True)
    seen, wanted = gather(read)[at.reshape(among.shape)], response[vertices]
    # Each as large as what is wanted, so that the price is that of what they add, and not the largest one's.
    size, own = np.linalg.norm(seen, axis=2), np.linalg.norm(wanted, axis=1)[:, None]
    scale = own / np.maximum(size, np.maximum(_FAINT * own, 1e-30))
    seen *= (scale / np.maximum(own, 1e-30))[..., None]
    k = among.shape[1]
    gram = seen @ seen.transpose(0, 2, 1) + _TIES * np.eye(k, dtype=np.float32)
    moment = seen @ (wanted / np.maximum(own, 1e-30))[..., None] + np.float32(_TIES / k)
    return batched_nnls(gram, moment)[..., 0], scale
