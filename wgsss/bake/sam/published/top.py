"""The selection `top`: the vertices of largest form factor on the back side of each vertex.

This is the paper's selection (Maisch & Ropinski 2017, section 3.2). The GPU searches for a few more vertices than are
needed, ranked by the area of the fan times R_d at the root mean square distance. Their form factors (eq. 11) are then
integrated, first coarsely to drop the surplus and then finely.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam.form_factors import MAX_ORDER, FormFactors
from wgsss.bake.sam.published.blocks import Blocks
from wgsss.bake.sam.sender_map import SenderMap, empty_entries
from wgsss.console import progress_bar
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

_MODULE = "sam/top"
IGNORED_SHARE = 1e-3
"""share of the light that leaves a plane beyond the distance at which senders are ignored"""
_CANDIDATES = 256  # blocks that are considered for a group of receivers at first; four times as many if too few
_DISPATCH_SECONDS = 0.4  # that one dispatch should take
_FIRST_RATE = 1e3  # groups per second, which any device manages: replaced by the measured rate
_MAX_GROUPS = 1 << 11  # of receivers in one dispatch
_MAX_ENTRIES = 1 << 21  # in one dispatch, which can have at most 65,535 workgroups


def select_top(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
    """Choose, for each vertex, the n vertices of largest form factor (eq. 11) on its back side (eq. 13, 14)."""
    return SenderMap(*largest_form_factors(gpu, mesh, profile, n), len(mesh.positions))


def largest_form_factors(
    gpu: Gpu, mesh: Mesh, profile: Profile, n: int, sending: Array | None = None
) -> tuple[Array, Array]:
    """Return the n senders of largest form factor for each vertex, in falling order, and these form factors.

    Form factors are compared by the sum of their channels. Senders at distances beyond which only IGNORED_SHARE of the
    light leaves are ignored.

    Args:
        sending: bool (V,); if given, only these vertices send, and only the others receive.

    Returns:
        The senders, int32 (V, n), -1 where there are fewer than n, and the form factors, float32 (V, n, 3).
    """
    sender, weight = empty_entries(len(mesh.positions), n)
    factors = FormFactors(gpu, mesh, profile)
    search = SenderSearch(gpu, mesh, profile, factors, n + 5 + n // 2, sending)
    shown: dict[str, Any] = {"desc": f"spatial adjacency map of {mesh.name}", "unit": " vertices", "unit_scale": True}
    with progress_bar(total=len(mesh.positions), **shown) as bar:
        for receiver, candidate in search:
            rough = _integrated(factors, receiver, candidate, max_order=1).sum(axis=2)
            best = np.argsort(-rough, axis=1, kind="stable")[:, :n]
            candidate = np.take_along_axis(candidate, best, axis=1)
            K = _integrated(factors, receiver, candidate, max_order=MAX_ORDER)
            order = np.argsort(-K.sum(axis=2), axis=1, kind="stable")
            sender[receiver] = np.take_along_axis(candidate, order, axis=1)
            weight[receiver] = np.take_along_axis(K, order[..., None], axis=1)
            bar.update(len(receiver))
    return sender, weight


def _integrated(factors: FormFactors, receiver: Array, candidate: Array, max_order: int) -> Array:
    """Return the form factors (R, k, 3) of receivers (R,) and their candidates (R, k); 0 for a candidate of -1."""
    row, column = np.nonzero(candidate >= 0)
    K = np.zeros((*candidate.shape, 3), np.float32)
    K[row, column] = factors.of(np.stack([receiver[row], candidate[row, column]], axis=1), max_order)
    return K


class SenderSearch:
    """Searches for the `count` senders that contribute most to each vertex, on the GPU.

    Senders are compared by the area of their fan times R_d, summed over the channels, at the root mean square distance
    of the two fans. Iterate over it for batches of receivers (R,) and their senders (R, count), -1 for none.
    """

    def __init__(
        self, gpu: Gpu, mesh: Mesh, profile: Profile, factors: FormFactors, count: int, sending: Array | None = None
    ) -> None:
        self.gpu, self.count, self.rate = gpu, count, _FIRST_RATE
        constants = wgsl.load(_MODULE).constants
        self.group, self.invocations = constants["GROUP"], constants["GROUP"] // constants["PER_INVOCATION"]
        self.blocks = Blocks(mesh, factors.fans, factors.R, float(profile.range(IGNORED_SHARE).max()), sending)
        self.tables = gpu.buffer(np.concatenate([self.blocks.total, self.blocks.reach]))
        self.vertices, self.ranges = gpu.buffer(self.blocks.vertices), gpu.buffer(self.blocks.ranges)

    def __iter__(self) -> Iterator[tuple[Array, Array]]:
        order, edges = self.blocks.order, self.blocks.edges
        first, end = self.blocks.receivers.start, self.blocks.receivers.stop
        most = min(_MAX_GROUPS, _MAX_ENTRIES // (self.group * self.count))
        while first < end:
            groups = np.arange(first, min(first + int(np.clip(self.rate * _DISPATCH_SECONDS, 1, most)), end))
            sender = self._search(groups, _CANDIDATES, 1 + self.count // 8)[self._is_receiver(groups)]
            first = int(groups[-1]) + 1
            yield order[edges[groups[0]] : edges[first]], np.where(sender >= 0, order[sender], -1)

    def _is_receiver(self, groups: Array) -> Array:
        """Return which of the GROUP places of each group hold a receiver, bool (g, GROUP).

        A group is a block of vertices, which may have fewer than GROUP.
        """
        return np.asarray(np.arange(self.group) < np.diff(self.blocks.edges)[groups, None])

    def _search(self, groups: Array, candidates: int, passes: int) -> Array:
        """Return the best senders of the receivers of some groups, int (g, GROUP, count), by their place in the blocks.

        Groups that the search leaves unfinished are searched again, with more dispatches or more candidates.

        Args:
            groups: int (g,), the blocks of the receivers.
            candidates: the number of blocks of senders that are considered for each group.
            passes: the number of dispatches; each visits a limited number of senders and goes on where the last ended.
        """
        blocks, bound, rest = self.blocks.candidates(groups, candidates)
        count = (bound > 0.0).sum(axis=1)
        ends = np.cumsum(count)
        start = time.perf_counter()
        graph = Graph(self.gpu)
        written: dict[str, Any] = {}
        for _ in range(passes):
            result = graph.dispatch_outputs(
                _MODULE,
                size=len(groups) * self.group * self.count,
                params={
                    "count": self.count,
                    "first_entry": self.blocks.first,
                    "reflectances": len(self.blocks.total),
                    "first_reach": self.blocks.first_reach,
                },
                tables=self.tables,
                vertices=self.vertices,
                blocks=self.ranges,
                lists={"group": groups, "first": ends - count, "end": ends},
                candidates={"block": blocks[bound > 0.0], "bound": bound[bound > 0.0]},
                **written,
            )
            written = result
        graph.run(result.cursors, result.entries)
        entries = graph.read(result.entries).reshape(len(groups), self.group, self.count)
        cursors = graph.read(result.cursors)[: len(groups) * self.invocations].reshape(len(groups), self.invocations)
        rate = len(groups) / (time.perf_counter() - start)
        self.rate = float(np.clip(rate, self.rate / 2, self.rate * 4))
        sender = np.where(entries["share"] > 0.0, entries["sender"].astype(np.int64), -1)
        is_receiver = self._is_receiver(groups)
        least = np.where(is_receiver, entries["share"][:, :, -1], np.inf).min(axis=1)
        is_active = is_receiver[:, :: self.group // self.invocations]
        is_unfinished = ((cursors < self.group * count[:, None]) & is_active).any(axis=1)
        needs_more = (rest > least) & ~is_unfinished  # a block that was left out may contribute more
        if is_unfinished.any():
            sender[is_unfinished] = self._search(groups[is_unfinished], candidates, 2 * passes)
        if needs_more.any():
            sender[needs_more] = self._search(groups[needs_more], 4 * candidates, passes)
        return sender
