"""`fit`: of all that reaches a vertex from behind, the few means by which its M_back is told best, whatever shines.

What an entry may read is the irradiance at a vertex, or a blended mean over nodes of a tree. Each vertex's exact
response to a set of irradiances is known; matching pursuit finds the senders and weights that come nearest to it. Where
neighbours choose other ones, mixtures of what they gather come nearer still.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from wgsss.bake.sam.blend import WIDTHS, Blend, blend
from wgsss.bake.sam.entries import Entries
from wgsss.bake.sam.mix import mix, weigh
from wgsss.bake.sam.pursuit import pursue
from wgsss.bake.sam.quick import QuickFormFactors
from wgsss.bake.sam.refit import refit
from wgsss.bake.sam.rows import Array, Senders, reaching, senders
from wgsss.bake.sam.training import compressed, training
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

DRAWS = 32
"""equal shares of a vertex's form factors: what holds the middle of one is a candidate, as are all nodes above it"""
PATCH = 1
"""level of the tree whose nodes, of 4 to 16 vertices, share candidates"""
FAINTEST = 1e-3
"""share of what a plane would give back, below which nothing shines through to a vertex"""
COUNTED = 256
"""vertices at which all form factors are summed one by one, to tell what the tree misses"""
REFITS = 3
"""times that entries are refitted to how they are mixed, and mixed anew: a tenth to a fifth off the error"""
AT_ONCE = 256
"""patches of a thread's task"""
_BLOCK = 4_000_000  # numbers that a batch of patches holds at a time, about


def select_fit(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> Entries:
    """The `n` senders of each vertex, and their weights, whose sum is nearest to its response to `training`."""
    from threadpoolctl import threadpool_limits
    from tqdm import tqdm

    V = len(mesh.positions)
    K = QuickFormFactors(gpu, mesh, profile)
    s = senders(mesh, float(profile.range(0.01).max()))
    means = blend(s.tree, s.x[V:], s.n[V:], s.area[V:])
    light = _lights(s, means, compressed(training(mesh), s.area[:V]))
    sender, weight = np.full((V, n), -1, np.int32), np.zeros((V, n, 3), np.float32)
    responses, total = np.zeros((V, light.shape[1]), np.float32), np.zeros((V, 3), np.float32)

    def fit(patches: Array) -> int:
        for vertices, reached in _batches(s, K, patches, light.shape[1]):
            k = K(s, vertices, reached)
            candidates = _candidates(s, k.sum(axis=1), reached)
            B, _, P, C = k.shape
            response = (k.reshape(B, 3 * P, C) @ light[reached]).reshape(B, 3, P, -1)
            chosen, w = pursue(light[candidates], response, n)
            there = vertices >= 0
            found = np.take_along_axis(candidates, chosen.reshape(B, -1), axis=1).reshape(chosen.shape)
            sender[vertices[there]], weight[vertices[there]] = found[there], w[there]
            responses[vertices[there]] = response.sum(axis=1)[there]
            total[vertices[there]] = k.sum(axis=3).transpose(0, 2, 1)[there]
        return len(patches)

    def gathered(vertices: Array) -> Array:
        return (weight[vertices].sum(axis=2)[:, None] @ light[sender[vertices]])[:, 0]

    levels = s.tree.levels
    level = min(PATCH, len(levels) - 2)
    patches = np.arange(levels[level], levels[level + 1])
    some = [patches[i : i + AT_ONCE] for i in range(0, len(patches), AT_ONCE)]
    # Threads of ours: products of many small matrices are no work for those of a BLAS.
    with (
        tqdm(total=len(patches), desc=f"fitting {n} senders", unit=" patches", file=sys.stderr, disable=None) as bar,
        threadpool_limits(1, "blas"),
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        for done in pool.map(fit, some):
            bar.update(done)
        weight[(weight.sum(axis=1) < FAINTEST * profile.total).all(axis=1)] = 0.0
        sender[~weight.any(axis=2)] = -1
        total *= _missed(s, K, total)
        receivers = np.flatnonzero(weight.any(axis=(1, 2)))
        mixed = mix(mesh.positions, mesh.normals, float(np.sqrt(s.area[:V].mean())), receivers, gathered, responses)
        for _ in range(REFITS if len(receivers) else 0):
            refit(mixed, receivers, sender, weight, light, responses)
            weigh(mixed, receivers, gathered, responses)
        mixed.colour(weight.sum(axis=1), total)
    is_mean = sender >= V
    used, at = np.unique(sender[is_mean] - len(s.area), return_inverse=True)
    sender[is_mean] = V + at
    return Entries(sender, weight, V, tree=s.tree, blend=means.only(used), mix=mixed)


def _missed(s: Senders, K: QuickFormFactors, total: Array) -> Array:
    """How much more (3,) arrives at some vertices in all than `total` (V, 3), which nodes told: these are as if all of
    one were at its middle, and those far away are left out."""
    some = np.random.default_rng(0).permutation(np.flatnonzero(total.any(axis=1)))[:COUNTED]
    told, exact = total[some].sum(axis=0, dtype=np.float64), np.zeros(3)
    for vertex in some:
        exact += K(s, np.array([[vertex]]), np.arange(len(total))[None])[0, :, 0].sum(axis=1, dtype=np.float64)
    return np.where(told > 0.0, exact / _positive(told), 1.0).astype(np.float32)


def _lights(s: Senders, means: Blend, lights: Array) -> Array:
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
        found[end:-1, some] = means.of(found[V:end, some])
    return found


def _batches(s: Senders, K: QuickFormFactors, patches: Array, lights: int) -> Iterator[tuple[Array, Array]]:
    """Patches, those last that much reaches: their vertices (B, P) and what reaches them (B, C); -1 fills up."""
    made, V = s.tree, len(s.tree.order)
    patch, reached = reaching(s, K, V + patches)
    first, count = made.first[patches], made.count[patches]
    start = np.searchsorted(patch, np.arange(len(patches) + 1))
    size = np.diff(start)
    order = np.argsort(size, kind="stable")
    order = order[size[order] > 0]
    P = int(count.max())
    i = 0
    while i < len(order):
        j = i + 1
        while j < len(order) and (j + 1 - i) * size[order[j]] * (lights + 12 * P) < _BLOCK:
            j += 1
        here = order[i:j]
        yield _ranges(made.order, first[here], count[here]), _ranges(reached, start[here], size[here])
        i = j


def _ranges(values: Array, first: Array, count: Array) -> Array:
    """Ranges of values side by side (B, longest), one wide at least, -1 beyond their ends."""
    at = np.arange(max(int(count.max()), 1))
    inside = at < count[:, None]
    return np.append(values, -1)[np.where(inside, first[:, None] + at, -1)]


def _candidates(s: Senders, k: Array, reached: Array) -> Array:
    """Vertices and blended means (B, candidates) by form factors k (B, P, C), of all channels, of what reaches the
    patches (B, C); -1 fills up."""
    before = np.cumsum(k, axis=2)
    before *= DRAWS / _positive(before[..., -1:])
    share = np.floor(before + 0.5)
    drawn = np.diff(share, axis=2, prepend=np.float32(0.0)) > 0.0
    patch, column = np.nonzero(drawn.any(axis=1))
    sender, all_ = reached[patch, column], len(s.area)
    keys = [patch * all_ + sender]
    while len(patch):
        above = s.parent[sender]
        key = np.unique((patch * all_ + above)[above >= 0])
        patch, sender = key // all_, key % all_
        keys.append(key)
    patch, sender = np.divmod(np.unique(np.concatenate(keys)), all_)
    start = np.searchsorted(patch, np.arange(len(k) + 1))
    found = _ranges(sender, start[:-1], np.diff(start))
    V, nodes = len(s.tree.order), all_ - len(s.tree.order)
    is_mean = found >= V
    wider = [np.where(is_mean, found + width * nodes, -1) for width in range(2, 1 + len(WIDTHS))]
    return np.concatenate([np.where(is_mean, found + nodes, found), *wider], axis=1)


def _positive(values: Array) -> Array:
    return np.where(values > 1e-30, values, 1.0)  # whose inverse float32 holds, too
