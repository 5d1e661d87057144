"""Mixtures of the sums of neighbouring receivers, fitted to the exact M_back.

Neighbouring vertices with different senders have different errors, which show as patches in the picture. So M_back of a
vertex is not the sum of its own entries alone, but a mixture of the sums of a few rows of entries around it: the errors
partly cancel, and neighbours become alike.
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
"""Returns the sums of rows (k,) of entries under T training lights, added over the channels, float32 (k, T)."""

NEAREST = 12
"""number of rows near a vertex among which those of its mixture are chosen. The error is a twentieth to a tenth smaller
than if the nearest rows were taken"""
_EQUAL_PARTS = 3e-4
"""penalty for unequal parts of a mixture, as a share of the squared norm of the response"""
_MAX_TINT = 4.0
_MIN_SCALE = 0.03  # of the response: smaller sums are not scaled up to its full size
_AT_ONCE = 512  # vertices


def neighbour_mixture(
    x: Array, n: Array, spacing: float, owner: Array, rows: Array, gather: Gather, response: Array
) -> NeighbourMixture:
    """Choose the rows and weights of each vertex's mixture, so that it is nearest to the vertex's response.

    The fit is a least squares in the sum of the channels; all tints are 1. A vertex whose row gathers nothing has a
    mixture of weights 0.

    Args:
        x: (V, 3), mm, the positions of the vertices.
        n: (V, 3), their unit normals.
        spacing: mm; perpendicular normals count as 1.4 times this distance apart.
        owner: int64 (R,), the vertex that each row of entries belongs to. Row v < V belongs to vertex v.
        rows: int64 (k,), in ascending order, the rows that gather anything.
        gather: returns the sums of rows.
        response: float32 (V, T), exact M_back under the training lights, added over the channels.
    """
    from scipy.spatial import KDTree

    most = wgsl.load("sam/neighbour_mixture").constants["ROWS"]
    mixture = NeighbourMixture(
        np.tile(np.arange(len(x), dtype=np.int32)[:, None], (1, most)),
        np.zeros((len(x), most), np.float16),
        np.ones((len(x), 3), np.float16),
    )
    vertices = rows[rows < len(x)]
    if not len(vertices):
        return mixture
    place = np.concatenate([x[owner[rows]] / spacing, n[owner[rows]]], axis=1)
    count = min(NEAREST, len(rows))
    near = KDTree(place).query(place[: len(vertices)], k=np.arange(1, count + 1), workers=-1)[1]

    def choose_rows(block: Array) -> None:
        nearest = rows[near[block]]
        part, _ = _mixture_parts(nearest, vertices[block], gather, response)
        part[owner[nearest] == vertices[block, None]] = np.inf  # always take the vertex's own rows
        # Rounding makes rows that add as much comparable: of these, the nearest are taken, on every machine.
        column = np.sort(np.argsort(-part.round(2), axis=1, kind="stable")[:, :most], axis=1)
        mixture.row[vertices[block], : column.shape[1]] = np.take_along_axis(nearest, column, axis=1)

    in_blocks(choose_rows, np.arange(len(vertices)))
    solve_weights(mixture, vertices, gather, response)
    return mixture


def solve_weights(mixture: NeighbourMixture, vertices: Array, gather: Gather, response: Array) -> None:
    """Fit the weights of the mixtures of some vertices, whose rows are chosen. Arguments as in `neighbour_mixture`."""
    k = min(mixture.row.shape[1], len(vertices))

    def solve(block: Array) -> None:
        part, scale = _mixture_parts(mixture.row[block, :k], block, gather, response)
        mixture.weight[block, :k] = scale * part

    in_blocks(solve, vertices)


def fit_tint(mixture: NeighbourMixture, uniform: Array, total: Array) -> None:
    """Set the tints so that M_back under uniform light has the right colour.

    Args:
        uniform: (R, 3), the sums of all rows under uniform light.
        total: (V, 3), the sums of all form factors of the vertices, which is exact M_back under uniform light.
    """
    mixture.tint[:] = 1.0
    mixed = mixture.apply(uniform)
    mixture.tint[:] = np.clip(total / np.where(mixed > 0.0, mixed, 1.0), 0.0, _MAX_TINT)


def in_blocks(run: Callable[[Array], None], indices: Array) -> None:
    """Call `run` for blocks of the indices, on all CPU cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, np.array_split(indices, max(-(-len(indices) // _AT_ONCE), 1))))


def _mixture_parts(row: Array, vertices: Array, gather: Gather, response: Array) -> tuple[Array, Array]:
    """Return the part that each row has in the mixtures of vertices (B,), and the scale of each row, both (B, k).

    A row's sum is scaled to the norm of the response; the weight in the mixture is part times scale. The penalty for
    unequal parts then treats all rows alike, however large their sums are.

    Args:
        row: int (B, k), the rows of each mixture.
    """
    read, index = np.unique(row, return_inverse=True)
    sums, target = gather(read)[index.reshape(row.shape)], response[vertices]
    size, target_size = np.linalg.norm(sums, axis=2), np.linalg.norm(target, axis=1)[:, None]
    scale = target_size / np.maximum(size, np.maximum(_MIN_SCALE * target_size, 1e-30))
    sums *= (scale / np.maximum(target_size, 1e-30))[..., None]
    k = row.shape[1]
    gram = sums @ sums.transpose(0, 2, 1) + _EQUAL_PARTS * np.eye(k, dtype=np.float32)
    moment = sums @ (target / np.maximum(target_size, 1e-30))[..., None] + np.float32(_EQUAL_PARTS / k)
    return batched_nnls(gram, moment)[..., 0], scale
