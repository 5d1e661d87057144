"""What a vertex receives as a mixture of what it and its neighbours gather.

Vertices side by side that chose other senders err in other ways, which the eye sees as patches. Together they err less,
and alike.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.nonnegative import nonnegative

Array = npt.NDArray[Any]

MIX_BYTES = 48
"""of a vertex: NEIGHBOURS of wgsl/sam/mix.wgsl, each a vertex and a half, and three halves more"""
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

    def of(self, gathered: Array) -> Array:
        """(V, ..., 3): mixtures of what vertices gather (V, ..., 3)."""
        weight, tint = self.weight.astype(gathered.dtype), self.tint.astype(gathered.dtype)
        return np.einsum("vk,vk...c,vc->v...c", weight, gathered[self.vertex], tint)


def mix(x: Array, n: Array, spacing: float, even: Array, gathered: Any, response: Array, total: Array) -> Mix:
    """The mixtures that are nearest to the vertices' responses to light in the least squares, in all channels together;
    under even light each channel is what it should be.

    Args:
        x: (V, 3), mm, where they are.
        n: (V, 3), their unit normals; at a right angle they count as far apart as 1.4 times `spacing`, mm.
        even: (V, 3), what they gather under even light: those that gather nothing are mixtures of nothing.
        gathered: gives for vertices (k,) what they gather, float32 (k, T), of T lights and all channels.
        response: float32 (V, T), what they should.
        total: (V, 3), what they should under even light.
    """
    from scipy.spatial import KDTree

    most = wgsl.load("sam/mix").constants["NEIGHBOURS"]
    vertices = np.flatnonzero(even.any(axis=1))
    k = min(most, len(vertices))
    found = Mix(
        np.tile(np.arange(len(x), dtype=np.int32)[:, None], (1, most)),
        np.zeros((len(x), most), np.float16),
        np.ones((len(x), 3), np.float16),
    )
    if not k:
        return found
    place = np.concatenate([x[vertices] / spacing, n[vertices]], axis=1)
    found.vertex[vertices, :k] = vertices[KDTree(place).query(place, k=np.arange(1, k + 1), workers=-1)[1]]

    def solve(some: Array) -> None:
        read, at = np.unique(found.vertex[some, :k], return_inverse=True)
        seen, wanted = gathered(read)[at.reshape(-1, k)], response[some]
        # Each as large as what is wanted, so that the price is that of what they add, and not the largest one's.
        size, own = np.linalg.norm(seen, axis=2), np.linalg.norm(wanted, axis=1)[:, None]
        scale = own / np.maximum(size, np.maximum(_FAINT * own, 1e-30))
        seen *= (scale / np.maximum(own, 1e-30))[..., None]
        gram = seen @ seen.transpose(0, 2, 1) + _TIES * np.eye(k, dtype=np.float32)
        moment = seen @ (wanted / np.maximum(own, 1e-30))[..., None] + np.float32(_TIES / k)
        found.weight[some, :k] = scale * nonnegative(gram, moment)[..., 0]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(solve, np.array_split(vertices, -(-len(vertices) // _AT_ONCE))))
    mixed = found.of(even)
    found.tint[:] = np.clip(total / np.where(mixed > 0.0, mixed, 1.0), 0.0, _MOST_TINT)
    return found
