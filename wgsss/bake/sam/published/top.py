"""The vertices that contribute most to each vertex from its back side, as published (000 §3.2)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.form_factors import MOST, FormFactors
from wgsss.bake.sam.published.blocks import Blocks
from wgsss.bake.sam.sender_map import SenderMap, empty_entries
from wgsss.console import progress_bar
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/top"
BEYOND = 1e-3
"""share of the light of a plane that comes from farther away than what is looked at"""
_LISTED = 256  # blocks that a group looks at first; four times as many each time that they are not enough
_SUBMISSION = 0.4  # seconds that a dispatch may take
_FIRST_RATE = 1e3  # groups per second that any device manages
_CHUNK = 1 << 11  # groups at once
_SLOTS = 1 << 21  # of entries at once: a dispatch has 65,535 workgroups at most


def select_top(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
    """The n vertices of largest K_oi (000 eq. 11), all channels together, on each vertex' back side (eq. 13, 14)."""
    return SenderMap(*largest_form_factors(gpu, mesh, profile, n), len(mesh.positions))


def largest_form_factors(
    gpu: Gpu, mesh: Mesh, profile: Profile, n: int, sending: Array | None = None
) -> tuple[Array, Array]:
    """Senders (V, n) and form factors (V, n, 3) of the n largest K_oi, the largest first; -1 where there are no more.

    Of more than n that come nearest to it by their fans' areas and mean squared distances, the n best by points of low
    order are integrated. Beyond the distance from where a share BEYOND of the light of a plane comes, nothing is
    looked for. Where `sending` (V,) is given, only those vertices send, and only the others receive.
    """

    sender, weight = empty_entries(len(mesh.positions), n)
    factors = FormFactors(gpu, mesh, profile)
    search = SenderSearch(gpu, mesh, profile, factors, n + 5 + n // 2, sending)
    shown: dict[str, Any] = {"desc": f"spatial adjacency map of {mesh.name}", "unit": " vertices", "unit_scale": True}
    with progress_bar(total=len(mesh.positions), **shown) as bar:
        for receivers, found in search:
            rough = _factors(factors, receivers, found, most=1).sum(axis=2)
            found = np.take_along_axis(found, np.argsort(-rough, axis=1, kind="stable")[:, :n], axis=1)
            K = _factors(factors, receivers, found, most=MOST)
            order = np.argsort(-K.sum(axis=2), axis=1, kind="stable")
            sender[receivers] = np.take_along_axis(found, order, axis=1)
            weight[receivers] = np.take_along_axis(K, order[..., None], axis=1)
            bar.update(len(receivers))
    return sender, weight


def _factors(factors: FormFactors, receivers: Array, found: Array, most: int) -> Array:
    """K (R, k, 3) of receivers (R,) and what is found for each (R, k)."""
    rows, columns = np.nonzero(found >= 0)
    K = np.zeros((*found.shape, 3), np.float32)
    K[rows, columns] = factors.of(np.stack([receivers[rows], found[rows, columns]], axis=1), most)
    return K


class SenderSearch:
    """Goes over the vertices of a mesh, some at a time, with the `kept` best senders of each: by the area of their fans
    and R_d at the root of the mean squared distance between them. -1 where there are no more."""

    def __init__(
        self, gpu: Gpu, mesh: Mesh, profile: Profile, factors: FormFactors, kept: int, sending: Array | None = None
    ) -> None:
        self.gpu, self.kept, self.rate = gpu, kept, _FIRST_RATE
        constants = wgsl.load(_MODULE).constants
        self.group, self.lanes = constants["GROUP"], constants["GROUP"] // constants["FOUR"]
        self.blocks = Blocks(mesh, factors.fans, factors.R, float(profile.range(BEYOND).max()), sending)
        self.tables = gpu.buffer(np.concatenate([self.blocks.total, self.blocks.reach]))
        self.vertices, self.buffer = gpu.buffer(self.blocks.vertices), gpu.buffer(self.blocks.ranges)

    def __iter__(self) -> Iterator[tuple[Array, Array]]:
        order, edges = self.blocks.order, self.blocks.edges
        first, end = self.blocks.receivers.start, self.blocks.receivers.stop
        most = min(_CHUNK, _SLOTS // (self.group * self.kept))
        while first < end:
            groups = np.arange(first, min(first + int(np.clip(self.rate * _SUBMISSION, 1, most)), end))
            found = self._best(groups, _LISTED, 1 + self.kept // 8)
            is_there = np.arange(self.group) < np.diff(edges)[groups, None]
            listed = found[is_there]
            first = int(groups[-1]) + 1
            yield order[edges[groups[0]] : edges[first]], np.where(listed >= 0, order[listed], -1)

    def _best(self, groups: Array, listed: int, passes: int) -> Array:
        """int (g, GROUP, kept): the best senders, by their place in the order of the blocks."""
        blocks, most, rest = self.blocks.candidates(groups, listed)
        count = (most > 0.0).sum(axis=1)
        ends = np.cumsum(count)
        start = time.perf_counter()
        graph = Graph(self.gpu)
        held: dict[str, Any] = {}
        for _ in range(passes):
            result = graph.dispatch(
                _MODULE,
                size=len(groups) * self.group * self.kept,
                params={
                    "kept": self.kept,
                    "first_entry": self.blocks.first,
                    "reflectances": len(self.blocks.total),
                    "first_reach": self.blocks.first_reach,
                },
                tables=self.tables,
                vertices=self.vertices,
                blocks=self.buffer,
                lists={"group": groups, "first": ends - count, "end": ends},
                candidates={"block": blocks[most > 0.0], "most": most[most > 0.0]},
                **held,
            )
            held = vars(result)
        graph.run(result.cursors, result.entries)
        entries = graph.read(result.entries).reshape(len(groups), self.group, self.kept)
        cursors = graph.read(result.cursors)[: len(groups) * self.lanes].reshape(len(groups), self.lanes)
        rate = len(groups) / (time.perf_counter() - start)
        self.rate = float(np.clip(rate, self.rate / 2, self.rate * 4))
        found = np.where(entries["share"] > 0.0, entries["sender"].astype(np.int64), -1)
        is_there = np.arange(self.group) < np.diff(self.blocks.edges)[groups, None]
        least = np.where(is_there, entries["share"][:, :, -1], np.inf).min(axis=1)
        halted = ((cursors < self.group * count[:, None]) & is_there[:, :: self.group // self.lanes]).any(axis=1)
        short = rest > least
        if halted.any():
            found[halted] = self._best(groups[halted], listed, 2 * passes)
        short &= ~halted
        if short.any():
            found[short] = self._best(groups[short], 4 * listed, passes)
        return found
