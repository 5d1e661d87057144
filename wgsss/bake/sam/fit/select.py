"""The selection `fit`: for each vertex, the few senders whose weighted sum best reproduces its exact M_back.

A sender is a vertex, or a smoothed mean over a node of the tree of senders. The exact M_back of each vertex is computed
under a set of training lights, and matching pursuit chooses senders and weights for it. The few vertices with the
largest errors, near which there are many senders both in light and in shadow, get a second row of entries. At last,
mixtures of neighbouring rows lessen the error further.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.candidates import candidates
from wgsss.bake.sam.fit.neighbour_mixture import fit_tint, in_blocks, neighbour_mixture, solve_weights
from wgsss.bake.sam.fit.omp import omp
from wgsss.bake.sam.fit.refit import refit
from wgsss.bake.sam.fit.smoothed_means import smoothed_means
from wgsss.bake.sam.fit.training import compressed, training_lights
from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.receiver_patches import ReceiverPatches
from wgsss.bake.sam.sender_map import SenderMap, SmoothedMeans, clear_faint_rows, empty_entries, gather_rows
from wgsss.bake.sam.sender_tree import SenderTree, sender_tree, side_separation
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

RECEIVERS_PER_SECOND_ROW = 32
"""of this many receivers, the one with the largest error has a second row of entries. On the scene `statue`, this
lessens the error by a fifth at 20,000 vertices and by half at 5,000"""
REFITS = 3
"""number of times that entries are adjusted to their mixtures, and the mixtures fitted again. This lessens the error by
a tenth to a fifth"""
_EXACT_SUMS = 256  # vertices whose form factors are summed one by one to estimate what the tree misses
_LIGHTS_AT_ONCE = 16  # in `_irradiances`, whose intermediate arrays are several times as large as the result


def select_fit(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
    """Choose n senders and weights for each vertex that best reproduce its exact M_back under the training lights.

    Every receiver has one row of n entries; one in RECEIVERS_PER_SECOND_ROW has two. Rows are mixed at the end.
    """
    V = len(mesh.positions)
    senders = sender_tree(mesh, side_separation(profile))
    K = PatchFormFactors(gpu, mesh, profile, senders)
    means = smoothed_means(senders.tree, senders.x[V:], senders.n[V:], senders.area[V:])
    light = _irradiances(senders, means, compressed(training_lights(mesh), senders.area[:V]))
    sender, weight = empty_entries(V, n)
    response, total = np.zeros((V, light.shape[1]), np.float32), np.zeros((V, 3), np.float32)

    def fit_first_rows(patches: ReceiverPatches) -> None:
        for vertex, chosen, chosen_weight, exact, uniform in _pursuits(K, light, patches, n):
            sender[vertex], weight[vertex], response[vertex], total[vertex] = chosen, chosen_weight, exact, uniform

    def fit_both_rows(patches: ReceiverPatches) -> None:
        for vertex, chosen, chosen_weight, _, _ in _pursuits(K, light, patches, 2 * n):
            sender[vertex], weight[vertex] = chosen[:, :n], chosen_weight[:, :n]
            sender[second_row[vertex]], weight[second_row[vertex]] = chosen[:, n:], chosen_weight[:, n:]

    def gather(rows: Array) -> Array:
        return gather_rows(sender[rows], weight[rows], light)

    ReceiverPatches.of(senders, np.arange(V)).each(fit_first_rows, f"fitting {n} senders per vertex")
    clear_faint_rows(weight, profile)
    worst = _worst(np.flatnonzero(weight.any(axis=(1, 2))), gather, response)
    second_row = np.full(V, -1)
    second_row[worst] = V + np.arange(len(worst))
    owner = np.concatenate([np.arange(V), worst])
    sender, weight = (np.concatenate(pair) for pair in zip((sender, weight), empty_entries(len(worst), n), strict=True))
    ReceiverPatches.of(senders, worst).each(fit_both_rows, f"fitting {2 * n} senders for the worst vertices")
    sender[~weight.any(axis=2)] = -1

    total *= _correction(K, total)
    rows = np.flatnonzero(weight.any(axis=(1, 2)))
    receivers = rows[rows < V]
    spacing = float(np.sqrt(senders.area[:V].mean()))
    mixture = neighbour_mixture(mesh.positions, mesh.normals, spacing, owner, rows, gather, response)
    for _ in range(REFITS if len(receivers) else 0):
        refit(mixture, receivers, rows, sender, weight, light, response)
        solve_weights(mixture, receivers, gather, response)
    fit_tint(mixture, weight.sum(axis=1), total)

    is_mean = sender >= V
    used, index = np.unique(sender[is_mean] - len(senders.area), return_inverse=True)
    sender[is_mean] = V + index
    return SenderMap(sender, weight, V, tree=senders.tree, smoothed_means=means.subset(used), neighbour_mixture=mixture)


def _pursuits(K: PatchFormFactors, light: Array, patches: ReceiverPatches, n: int) -> Iterator[tuple[Array, ...]]:
    """Choose n senders for each receiver of some patches; yield the results for batches of k receivers.

    Args:
        light: float32 (V + N + U + 1, T), irradiances as `_irradiances` returns them.

    Yields:
        The receivers (k,); their senders (k, n) and weights (k, n, 3); and exact M_back under the training lights,
        added over the channels (k, T), and under uniform light (k, 3).
    """
    for receiver, reaching in patches.batches(K, light.shape[1]):
        k = K(receiver, reaching)
        candidate = candidates(K.senders, k.sum(axis=1), reaching)
        B, _, P, C = k.shape
        response = (k.reshape(B, 3 * P, C) @ light[reaching]).reshape(B, 3, P, -1)
        index, weight = omp(light[candidate], response, n)
        chosen = np.take_along_axis(candidate, index.reshape(B, -1), axis=1).reshape(index.shape)
        is_receiver, uniform = receiver >= 0, k.sum(axis=3).transpose(0, 2, 1)
        yield tuple(a[is_receiver] for a in (receiver, chosen, weight, response.sum(axis=1), uniform))


def _worst(receivers: Array, gather: Callable[[Array], Array], response: Array) -> Array:
    """Return the receivers whose sums are farthest from their responses, one in RECEIVERS_PER_SECOND_ROW, ascending.

    Args:
        receivers: int (k,).
        gather: returns the sums of rows (m,) under the training lights, (m, T).
        response: (V, T), exact M_back under these lights.
    """
    error = np.zeros(len(response))

    def measure(block: Array) -> None:
        error[block] = np.square(response[block] - gather(block)).sum(axis=1)

    in_blocks(measure, receivers)
    order = np.argsort(-error[receivers], kind="stable")
    return np.sort(receivers[order[: -(-len(receivers) // RECEIVERS_PER_SECOND_ROW)]])


def _correction(K: PatchFormFactors, total: Array) -> Array:
    """Estimate the ratio of exact to computed M_back under uniform light, float32 (3,), from a sample of vertices.

    The computed sums treat nodes as points at their centroids and ignore distant senders.

    Args:
        total: float32 (V, 3), the computed sums of form factors.
    """
    sample = np.random.default_rng(0).permutation(np.flatnonzero(total.any(axis=1)))[:_EXACT_SUMS]
    computed, exact = total[sample].sum(axis=0, dtype=np.float64), np.zeros(3)
    for vertex in sample:
        exact += K(np.array([[vertex]]), np.arange(len(total))[None])[0, :, 0].sum(axis=1, dtype=np.float64)
    return np.where(computed > 0.0, exact / _divisor(computed), 1.0).astype(np.float32)


def _irradiances(senders: SenderTree, means: SmoothedMeans, lights: Array) -> Array:
    """Return the irradiance at all senders, float32 (V + N + U + 1, T), from that at the vertices, `lights` (V, T).

    The rows are the V vertices, the means of the N nodes, the U smoothed means, and one row of 0 for no sender.
    """
    (V, T), end = lights.shape, len(senders.area)
    irradiance = np.zeros((end + len(means.node) + 1, T), np.float32)
    irradiance[:V] = lights
    levels, finest = V + senders.tree.levels, senders.tree.first[: senders.tree.levels[1]]
    for first in range(0, T, _LIGHTS_AT_ONCE):
        chunk = slice(first, first + _LIGHTS_AT_ONCE)
        sums = np.add.reduceat((lights[:, chunk] * senders.area[:V, None])[senders.tree.order], finest)
        for a, b in pairwise(levels):
            irradiance[a:b, chunk] = sums / _divisor(senders.area[a:b, None])
            sums = sums.reshape(-1, 4, sums.shape[1]).sum(axis=1) if b - a > 1 else sums
        irradiance[end:-1, chunk] = means.apply(irradiance[V:end, chunk])
    return irradiance


def _divisor(values: Array) -> Array:
    """Return the values, with 1 in place of those that are too small to divide by in float32."""
    return np.where(values > 1e-30, values, 1.0)
