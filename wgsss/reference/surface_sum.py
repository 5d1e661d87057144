"""Sums over samples of a surface for many receivers, on the GPU, in short dispatches with cached partial results."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.octree import morton
from wgsss.cache import cached
from wgsss.fingerprint import fingerprint
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.reference.kernel import Kernel

Array = npt.NDArray[Any]

_MODULE = "reference/integral"
_TILE = 1 << 15  # samples of one dispatch: lavapipe ends loops after 65,535 iterations, those of nested loops added up
_SUBMISSION = 0.5  # seconds that a dispatch may take
_GROUPS = 4096  # of receivers in one dispatch, so that their lists of blocks stay small
_FIRST_RATE = 1e7  # pairs of receiver and sample per second that any device achieves
_PART = 1 << 30  # pairs per cache entry: an interrupt loses at most these


@dataclass(frozen=True, eq=False)
class Points:
    """Points of a surface with their normals, in object space: (N, 3) each, mm."""

    position: Array
    normal: Array

    def __getitem__(self, which: Any) -> Points:
        return Points(self.position[which], self.normal[which])


def surface_sum(
    gpu: Gpu, kernel: Kernel, samples: Points, flux: Array, receivers: Points, bar: Any
) -> tuple[Array, Array]:
    """Sum kernel(|x_i - x_o|) times the `flux` (N, 3) of the samples, for each receiver. Returns front and back (M, 3).

    Equal arguments give equal bits on one adapter. Each part of the sum is cached when it is done, so that an
    interrupted computation continues where it was. `bar`, of `console.progress_bar`, counts pairs of a receiver and a
    sample.
    """
    source = _Source(gpu, kernel, samples, flux)
    order = _along_curve(receivers.position)
    part = max(_PART // len(flux) // source.lanes, 1) * source.lanes
    front, back = np.zeros((2, len(order), 3))
    for first in range(0, len(order), part):
        chosen = order[first : first + part]
        some = receivers[chosen]
        sums = _part(source, some, bar)
        front[chosen], back[chosen] = sums["front"], sums["back"]
        bar.update(len(chosen) * len(flux) - bar.n + first * len(flux))
    return front, back


def _part(source: _Source, receivers: Points, bar: Any) -> dict[str, Array]:
    key = [source.fingerprint, receivers, source.gpu.name]
    return cached("integral-part", key, lambda: source.summed(receivers, bar))


class _Source:
    """Samples on the GPU, in blocks. The bounds of a block decide which groups of receivers need it."""

    def __init__(self, gpu: Gpu, kernel: Kernel, samples: Points, flux: Array) -> None:
        self.gpu, self.kernel, self.rate = gpu, kernel, _FIRST_RATE
        module = wgsl.load(_MODULE)
        self.lanes, self.block = module.constants["LANES"], module.constants["BLOCK"]
        self.samples_layout, self.receivers_layout = (
            module.layout(f"array<{name}>") for name in ("Sample", "Receiver")
        )
        self.count = len(samples.position)
        order = _along_curve(samples.position)
        order = np.append(order, np.repeat(order[-1], -len(order) % self.block))  # whole blocks
        flux = flux[order]
        flux[self.count :] = 0.0
        value = {"position": samples.position[order], "normal": samples.normal[order], "flux": flux}
        packed = self.samples_layout.pack(value)
        self.fingerprint = fingerprint([kernel, packed])
        step = _TILE * self.samples_layout.size
        self.tiles = [gpu.buffer(packed[at : at + step]) for at in range(0, len(packed), step)]
        self.table = gpu.buffer(kernel.table)
        self.low, self.high = _bounds(value["position"], self.block)

    def summed(self, receivers: Points, bar: Any) -> dict[str, Array]:
        """Return the sums for some receivers: front and back (n, 3)."""
        count = len(receivers.position)
        whole = np.minimum(np.arange(count + -count % self.lanes), count - 1)
        padded = receivers[whole]
        groups = len(whole) // self.lanes
        packed = self.receivers_layout.pack({"position": padded.position, "normal": padded.normal})
        buffer = self.gpu.buffer(packed)
        bounds = _bounds(padded.position, self.lanes)
        sums = np.zeros((2, len(whole), 3))
        tile_blocks = _TILE // self.block
        for tile, buffered in enumerate(self.tiles):
            low, high = (edge[tile * tile_blocks : (tile + 1) * tile_blocks] for edge in (self.low, self.high))
            first = 0
            while first < groups:
                pairs = self.lanes * self.block * len(low)
                some = int(np.clip(self.rate * _SUBMISSION // pairs, 1, min(groups - first, _GROUPS)))
                chosen = slice(first, first + some)
                near = _near([b[chosen] for b in bounds], (low, high), self.kernel.reach)
                part = self._dispatch(buffered, buffer, near, first)
                lanes = slice(first * self.lanes, (first + some) * self.lanes)
                sums[0, lanes] += part["front"]
                sums[1, lanes] += part["back"]
                first += some
                bar.update((min(lanes.stop, count) - lanes.start) * min(_TILE, self.count - tile * _TILE))
        return {"front": sums[0, :count], "back": sums[1, :count]}

    def _dispatch(self, samples: Any, receivers: Any, near: Array, first: int) -> Array:
        """Return the sums over one tile, for each group over the blocks that `near` (groups, blocks) selects."""
        start = time.perf_counter()
        graph = Graph(self.gpu)
        sums = graph.dispatch(
            _MODULE,
            size=len(near) * self.lanes,
            params={"first_entry": self.kernel.first, "first_group": first},
            kernel=self.table,
            samples=samples,
            receivers=receivers,
            starts=np.append(0, np.cumsum(near.sum(axis=1))),
            blocks=np.nonzero(near)[1],
        )
        graph.run(sums)
        result = graph.read(sums)
        pairs = int(near.sum()) * self.lanes * self.block
        rate = pairs / (time.perf_counter() - start)
        self.rate = float(np.clip(rate, self.rate / 2, self.rate * 4)) if pairs > 1e5 else self.rate
        return result


def _bounds(positions: Array, block: int) -> tuple[Array, Array]:
    """Return the least and greatest coordinates (n, 3) of each block of positions."""
    blocks = positions.reshape(-1, block, 3)
    return blocks.min(axis=1), blocks.max(axis=1)


def _near(a: Any, b: Any, reach: float) -> Array:
    """Return whether box `a` (low, high; (n, 3) each) lies within `reach` of box `b`, for all pairs: bool (n, m)."""
    (a_low, a_high), (b_low, b_high) = a, b
    square = np.zeros((len(a_low), len(b_low)))
    for axis in range(3):
        gap = np.maximum(b_low[:, axis] - a_high[:, axis, None], a_low[:, axis, None] - b_high[:, axis])
        square += np.square(np.maximum(gap, 0.0))
    return square < reach * reach


def _along_curve(positions: Array) -> Array:
    """Return an order of positions in which neighbours are near each other."""
    return np.argsort(morton(positions), kind="stable")
