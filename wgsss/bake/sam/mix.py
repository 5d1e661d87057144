"""What a vertex receives as a mixture of what it and its neighbours gather.

Vertices side by side that chose other senders err in other ways, which the eye sees as patches. Together they err less,
and alike.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.nonnegative import nonnegative

Array = npt.NDArray[Any]
Gathered = Callable[[Array], Array]
"""Gives for vertices (k,) what they gather, float32 (k, T), of T lights and all channels."""

MIX_BYTES = 48
"""of a vertex: NEIGHBOURS of wgsl/sam/mix.wgsl, each a vertex and a half, and three halves more"""
NEAREST = 12
"""vertices among which those of a mixture are chosen: a twentieth to a tenth less error than by the nearest alone"""
_TIES = 3e-4
"""of the square of a response: the price of parts of it that are not all the same"""
_MOST_TINT = 4.0
_FAINT = 0.03  # of a response: what is smaller is not made as large
_AT_ONCE = 512  # vertices


@dataclass(frozen=True, eq=False)
class Mix:
    """M_back of each of V vertices as a sum of k products, `weight` times what `vertex` gathers, times `tint`."""

    vertex: Array
    """int32 (V, k)"""
    weight: Array
    """float16 (V, k), at least 0, without unit"""
    tint: Array
    """float16 (V, 3), without unit"""

    def colour(self, even: Array, total: Array) -> None:
        """Choose the tint by which `even` (V, 3), what vertices gather under even light, is mixed to `total` (V, 3)."""
        self.tint[:] = 1.0
        mixed = self.of(even)
        self.tint[:] = np.clip(total / np.where(mixed > 0.0, mixed, 1.0), 0.0, _MOST_TINT)

    def of(self, gathered: Array) -> Array:
        """(V, ..., 3): mixtures of what vertices gather (V, ..., 3)."""
        weight, tint = self.weight.astype(gathered.dtype), self.tint.astype(gathered.dtype)
        return np.einsum("vk,vk...c,vc->v...c", weight, gathered[self.vertex], tint)


def mix(x: Array, n: Array, spacing: float, vertices: Array, gathered: Gathered, response: Array) -> Mix:
    """The mixtures that are nearest to the vertices' responses to light in the least squares, in all channels together.

    Args:
        x: (V, 3), mm, where they are.
        n: (V, 3), their unit normals; at a right angle they count as far apart as 1.4 times `spacing`, mm.
        vertices: int64 (k,), those that gather anything. The others are mixtures of nothing.
        gathered: what they gather.
        response: float32 (V, T), what they should.
    """
    from scipy.spatial import KDTree

    most = wgsl.load("sam/mix").constants["NEIGHBOURS"]
    found = Mix(
        np.tile(np.arange(len(x), dtype=np.int32)[:, None], (1, most)),
        np.zeros((len(x), most), np.float16),
        np.ones((len(x), 3), np.float16),
    )
    if not len(vertices):
        return found
    place = np.concatenate([x[vertices] / spacing, n[vertices]], axis=1)
    near = KDTree(place).query(place, k=np.arange(1, min(NEAREST, len(vertices)) + 1), workers=-1)[1]

    def choose(rows: Array) -> None:
        among = vertices[near[rows]]
        part, _ = _parts(among, vertices[rows], gathered, response)
        part[:, 0] = np.inf  # itself, which is the nearest
        # Of those that add as much, the nearest: rounding must not choose.
        kept = np.sort(np.argsort(-part.round(2), axis=1, kind="stable")[:, :most], axis=1)
        found.vertex[vertices[rows], : kept.shape[1]] = np.take_along_axis(among, kept, axis=1)

    in_blocks(choose, np.arange(len(vertices)))
    weigh(found, vertices, gathered, response)
    return found


def weigh(found: Mix, vertices: Array, gathered: Gathered, response: Array) -> None:
    """Choose the weights of mixtures whose vertices are known, as in `mix`."""
    k = min(found.vertex.shape[1], len(vertices))

    def solve(some: Array) -> None:
        part, scale = _parts(found.vertex[some, :k], some, gathered, response)
        found.weight[some, :k] = scale * part

    in_blocks(solve, vertices)


def in_blocks(run: Callable[[Array], None], indices: Array) -> None:
    """Run for some of the indices at a time, on all cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, np.array_split(indices, -(-len(indices) // _AT_ONCE))))


def _parts(among: Array, vertices: Array, gathered: Gathered, response: Array) -> tuple[Array, Array]:
    """Parts (B, k) of responses of vertices (B,), each of what one of `among` (B, k) gathers, made as large as the
    response; and by how much that was (B, k)."""
    read, at = np.unique(among, return_inverse=True)
    seen, wanted = gathered(read)[at.reshape(among.shape)], response[vertices]
    # Each as large as what is wanted, so that the price is that of what they add, and not the largest one's.
    size, own = np.linalg.norm(seen, axis=2), np.linalg.norm(wanted, axis=1)[:, None]
    scale = own / np.maximum(size, np.maximum(_FAINT * own, 1e-30))
    seen *= (scale / np.maximum(own, 1e-30))[..., None]
    k = among.shape[1]
    gram = seen @ seen.transpose(0, 2, 1) + _TIES * np.eye(k, dtype=np.float32)
    moment = seen @ (wanted / np.maximum(own, 1e-30))[..., None] + np.float32(_TIES / k)
    return nonnegative(gram, moment)[..., 0], scale
