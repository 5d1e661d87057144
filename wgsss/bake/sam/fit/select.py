"""`fit`: of all that reaches a vertex from behind, the few means by which its M_back is told best, whatever shines.

What an entry may read is the irradiance at a vertex, or a blended mean over nodes of a tree. Each vertex's exact
response to a set of irradiances is known; matching pursuit finds the senders and weights that come nearest to it. Most
of the error is that of few vertices, near which there are many senders, each in light or in shadow: they have a second
row of entries. Where neighbours choose other ones, mixtures of what they gather come nearer still.
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
from wgsss.bake.sam.fit.training import compressed, training
from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.receiver_patches import ReceiverPatches
from wgsss.bake.sam.sender_map import SenderMap, SmoothedMeans, empty_entries, gather_rows
from wgsss.bake.sam.sender_tree import SenderTree, sender_tree
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

SECOND = 32
"""of how many receivers one has a second row, the one that is told worst: off the error of `statue` this takes a fifth
at 20k vertices, and half at 5k"""
FAINTEST = 1e-3
"""share of what a plane would give back, below which nothing shines through to a vertex"""
COUNTED = 256
"""vertices at which all form factors are summed one by one, to tell what the tree misses"""
REFITS = 3
"""times that entries are refitted to how they are mixed, and mixed anew: a tenth to a fifth off the error"""


def select_fit(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
    """The `n` senders of each vertex, and of some twice as many, and their weights, whose sum is nearest to its
    response to `training`."""
    V = len(mesh.positions)
    K = PatchFormFactors(gpu, mesh, profile)
    s = sender_tree(mesh, float(profile.range(0.01).max()))
    means = smoothed_means(s.tree, s.x[V:], s.n[V:], s.area[V:])
    light = _lights(s, means, compressed(training(mesh), s.area[:V]))
    sender, weight = empty_entries(V, n)
    responses, total = np.zeros((V, light.shape[1]), np.float32), np.zeros((V, 3), np.float32)

    def first(patches: ReceiverPatches) -> None:
        for some, found, w, response, k in _pursued(s, K, light, patches, n):
            sender[some], weight[some], responses[some], total[some] = found, w, response, k

    def second(patches: ReceiverPatches) -> None:
        for some, found, w, _, _ in _pursued(s, K, light, patches, 2 * n):
            sender[some], weight[some] = found[:, :n], w[:, :n]
            sender[row[some]], weight[row[some]] = found[:, n:], w[:, n:]

    def gather(rows: Array) -> Array:
        return gather_rows(sender[rows], weight[rows], light)

    ReceiverPatches.of(s, np.arange(V)).each(first, f"fitting {n} senders")
    weight[(weight.sum(axis=1) < FAINTEST * profile.total).all(axis=1)] = 0.0
    receivers = np.flatnonzero(weight.any(axis=(1, 2)))
    twice = _worst(receivers, gather, responses)
    row = np.full(V, -1)
    row[twice] = V + np.arange(len(twice))
    owner = np.concatenate([np.arange(V), twice])
    sender, weight = (np.concatenate(pair) for pair in zip((sender, weight), empty_entries(len(twice), n), strict=True))
    ReceiverPatches.of(s, twice).each(second, f"fitting {2 * n} senders")
    sender[~weight.any(axis=2)] = -1
    total *= _missed(s, K, total)
    rows = np.flatnonzero(weight.any(axis=(1, 2)))
    receivers = rows[rows < V]
    mixed = neighbour_mixture(
        mesh.positions, mesh.normals, float(np.sqrt(s.area[:V].mean())), owner, rows, gather, responses
    )
    for _ in range(REFITS if len(receivers) else 0):
        refit(mixed, receivers, rows, sender, weight, light, responses)
        solve_weights(mixed, receivers, gather, responses)
    fit_tint(mixed, weight.sum(axis=1), total)
    is_mean = sender >= V
    used, at = np.unique(sender[is_mean] - len(s.area), return_inverse=True)
    sender[is_mean] = V + at
    return SenderMap(sender, weight, V, tree=s.tree, smoothed_means=means.subset(used), neighbour_mixture=mixed)


def _pursued(
    s: SenderTree, K: PatchFormFactors, light: Array, patches: ReceiverPatches, n: int
) -> Iterator[tuple[Array, ...]]:
    """Vertices (k,) with their `n` senders and weights, their responses (k, T) to `light` (V + N + U + 1, T), in all
    channels together, and (k, 3) to even light."""
    for vertices, reached in patches.batches(s, K, light.shape[1]):
        k = K(s, vertices, reached)
        among = candidates(s, k.sum(axis=1), reached)
        B, _, P, C = k.shape
        response = (k.reshape(B, 3 * P, C) @ light[reached]).reshape(B, 3, P, -1)
        chosen, w = omp(light[among], response, n)
        found = np.take_along_axis(among, chosen.reshape(B, -1), axis=1).reshape(chosen.shape)
        there, even = vertices >= 0, k.sum(axis=3).transpose(0, 2, 1)
        yield tuple(a[there] for a in (vertices, found, w, response.sum(axis=1), even))


def _worst(receivers: Array, gather: Callable[[Array], Array], responses: Array) -> Array:
    """One in SECOND of the receivers (k,), in ascending order: those whose responses (V, T) are missed by most."""
    missed = np.zeros(len(responses))

    def tell(some: Array) -> None:
        missed[some] = np.square(responses[some] - gather(some)).sum(axis=1)

    in_blocks(tell, receivers)
    order = np.argsort(-missed[receivers], kind="stable")
    return np.sort(receivers[order[: -(-len(receivers) // SECOND)]])


def _missed(s: SenderTree, K: PatchFormFactors, total: Array) -> Array:
    """How much more (3,) arrives at some vertices in all than `total` (V, 3), which nodes told: these are as if all of
    one were at its middle, and those far away are left out."""
    some = np.random.default_rng(0).permutation(np.flatnonzero(total.any(axis=1)))[:COUNTED]
    told, exact = total[some].sum(axis=0, dtype=np.float64), np.zeros(3)
    for vertex in some:
        exact += K(s, np.array([[vertex]]), np.arange(len(total))[None])[0, :, 0].sum(axis=1, dtype=np.float64)
    return np.where(told > 0.0, exact / _positive(told), 1.0).astype(np.float32)


def _lights(s: SenderTree, means: SmoothedMeans, lights: Array) -> Array:
    """Irradiances (V + N + U + 1, T): (V, T) of vertices, nodes and blended means; the last row, of none, is 0."""
    (V, T), end = lights.shape, len(s.area)
    found = np.zeros((end + len(means.node) + 1, T), np.float32)
    found[:V] = lights
    levels, finest = V + s.tree.levels, s.tree.first[: s.tree.levels[1]]
    for first in range(0, T, 16):  # what is summed or blended takes several times as much
        some = slice(first, first + 16)
        sums = np.add.reduceat((lights[:, some] * s.area[:V, None])[s.tree.order], finest)
        for a, b in pairwise(levels):
            found[a:b, some] = sums / _positive(s.area[a:b, None])
            sums = sums.reshape(-1, 4, sums.shape[1]).sum(axis=1) if b - a > 1 else sums
        found[end:-1, some] = means.apply(found[V:end, some])
    return found


def _positive(values: Array) -> Array:
    return np.where(values > 1e-30, values, 1.0)  # whose inverse float32 holds, too
