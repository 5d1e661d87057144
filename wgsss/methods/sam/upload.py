"""What a frame needs of a spatial adjacency map: the vertices that receive, the senders that they read, and means over
the nodes of a tree of senders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.sender_map import ENTRY_BYTES, MIXTURE_BYTES, NeighbourMixture, SmoothedMeans
from wgsss.bake.samples import Samples
from wgsss.gpu import LIMITS, Gpu
from wgsss.graph import Graph
from wgsss.scene import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Block:
    """As many entries as fit in a binding, on the device."""

    count: int
    """of the rows that they are in"""
    rows: Any
    """buffer of u32: those"""
    entries: Any
    """buffer of array<Entry> (wgsl/sam/entries.wgsl)"""
    moved: Any
    """buffer of i32: the senders that they have, from frame to frame, where they may change"""


@dataclass(frozen=True, eq=False)
class Mixes:
    """As many mixtures as fit in a binding, on the device."""

    count: int
    """of the vertices that they belong to"""
    vertices: Any
    """buffer of u32: those"""
    mixes: Any
    """buffer of array<Mix> (wgsl/sam/mix.wgsl)"""


@dataclass(frozen=True, eq=False)
class Plan:
    """A map, less what nobody sends or receives."""

    entries: SenderMap
    points: Samples
    """what L_d is wanted at: the senders that count, in whose order entries name them; nodes follow"""
    blocks: list[Block]
    faces: Any
    """buffer of u32: the corners of the faces that receive"""
    mixes: list[Mixes]
    """where there is a mix"""
    starts: Any = None
    """buffer of u32, where there is a tree: where the senders of the finest nodes begin in `order`, and the end"""
    order: Any = None
    """buffer of u32, where there is a tree: senders"""
    area: Any = None
    """buffer of f32, where there is a tree: of the senders' reduced fans at rest, mm^2"""
    blends: Any = None
    """buffer of array<Blend> (wgsl/sam/blends.wgsl), where there is a tree"""

    @property
    def nodes(self) -> int:
        """How many there are."""
        return 0 if self.entries.tree is None else len(self.entries.tree.first)


def make_plan(gpu: Gpu, mesh: Mesh, faces: Array, entries: SenderMap, *, moving: bool) -> Plan | None:
    """Upload what a frame needs of the map of `mesh`, whose render mesh has `faces` (F, 3); None where nobody receives.

    Where it is `moving`, all senders count, since entries may come to read others; receivers that are no senders follow
    them among the points.
    """
    gathers, V = entries.sender.max(axis=1) >= 0, len(mesh.positions)
    rows, receives, tree = np.flatnonzero(gathers), gathers[:V], entries.tree
    if not len(rows):
        return None
    needed = np.arange(entries.sender_count) if moving else _needed(entries)
    samples = at_vertices(mesh) if entries.sender_samples is None else entries.sender_samples
    points = Samples(samples.face[needed], samples.barycentric[needed], samples.share[needed])
    if moving and entries.sender_samples is not None:
        points = _joined(points, at_vertices(mesh))
    means = (
        0 if tree is None else len(tree.first) if entries.smoothed_means is None else len(entries.smoothed_means.node)
    )
    places = np.full(entries.sender_count, -1, np.int32)
    places[needed] = np.arange(len(needed))
    named = np.concatenate([places, len(points.face) + np.arange(means), [-1]])  # of no sender, -1, is the last
    blocks = _blocks(gpu, rows, named[entries.sender[rows]], entries.weight[rows])
    corners = gpu.buffer(faces[receives[mesh.faces].any(axis=1)].astype(np.uint32))
    mixes = [] if entries.neighbour_mixture is None else _mixes(gpu, rows[rows < V], entries.neighbour_mixture)
    if tree is None:
        return Plan(entries, points, blocks, corners, mixes)
    finest = tree.first[: tree.levels[1]]
    return Plan(
        entries,
        points,
        blocks,
        corners,
        mixes,
        gpu.buffer(np.append(finest, len(tree.order)).astype(np.uint32)),
        gpu.buffer(np.maximum(places[tree.order], 0).astype(np.uint32)),  # what is not needed is in no mean that is
        gpu.buffer(fan_areas(mesh)[needed].astype(np.float32)),
        None if entries.smoothed_means is None else _blends(gpu, entries.smoothed_means),
    )


def at_vertices(mesh: Mesh) -> Samples:
    """The vertices of a mesh as samples of it; where normals split one, it counts as part of one of its sides."""
    used, first = np.unique(mesh.faces, return_index=True)
    corner = np.zeros(len(mesh.positions), np.int64)  # what no face has is sent to nobody, and may be anywhere
    corner[used] = first
    return Samples((corner // 3).astype(np.int32), np.eye(3)[corner % 3], np.zeros(len(corner)))


def _joined(*parts: Samples) -> Samples:
    return Samples(*(np.concatenate([vars(s)[name] for s in parts]) for name in ("face", "barycentric", "share")))


def _needed(entries: SenderMap) -> Array:
    """The senders that are read, by themselves or in a mean."""
    is_read = np.zeros(entries.sender_count, bool)
    is_read[entries.sender[(entries.sender >= 0) & (entries.sender < entries.sender_count)]] = True
    tree = entries.tree
    if tree is not None:
        nodes = np.unique(entries.sender[entries.sender >= entries.sender_count]) - entries.sender_count
        if entries.smoothed_means is not None:
            nodes = np.unique(entries.smoothed_means.node)
        edges = np.zeros(len(tree.order) + 1, np.int64)
        np.add.at(edges, tree.first[nodes], 1)
        np.add.at(edges, tree.first[nodes] + tree.count[nodes], -1)
        is_read[tree.order[np.cumsum(edges[:-1]) > 0]] = True
    return np.flatnonzero(is_read)


def _blocks(gpu: Gpu, rows: Array, sender: Array, weight: Array) -> list[Block]:
    layout = wgsl.load("sam/gather").layout("array<Entry>")
    return [
        Block(
            len(rows[some]),
            gpu.buffer(rows[some].astype(np.uint32)),
            gpu.buffer(layout.pack({"weight": weight[some].reshape(-1, 3), "sender": sender[some].ravel()})),
            gpu.buffer(sender[some].astype(np.int32)),
        )
        for some in _bindings(len(rows), ENTRY_BYTES * sender.shape[1])
    ]


def _mixes(gpu: Gpu, vertices: Array, mix: NeighbourMixture) -> list[Mixes]:
    layout = wgsl.load("sam/mix").layout("array<Mix>")
    found = []
    for some in _bindings(len(vertices), MIXTURE_BYTES):
        v = vertices[some]
        halves = np.concatenate([mix.weight[v], mix.tint[v]], axis=1).view(np.uint32)
        packed = layout.pack({"row": mix.row[v], "halves": halves})
        found.append(Mixes(len(v), gpu.buffer(v.astype(np.uint32)), gpu.buffer(packed)))
    return found


def _bindings(count: int, size: int) -> Iterator[slice]:
    """Of things of so many bytes, those that go into one binding each."""
    most = LIMITS["max-storage-buffer-binding-size"] // size
    return (slice(first, first + most) for first in range(0, count, most))


def _blends(gpu: Gpu, blend: SmoothedMeans) -> Any:
    return gpu.buffer(wgsl.load("sam/blends").layout("array<Blend>").pack(vars(blend))) if len(blend.node) else None


def over_nodes(graph: Graph, plan: Plan, module: str, over: str, **bindings: Any) -> Any:
    """The buffer `over`, one of `bindings`, with its nodes filled bottom-up by `module`."""
    tree = plan.entries.tree
    if tree is None:
        return bindings[over]
    counts = np.diff(tree.levels)
    at_once = wgsl.load(module).constants["LEVELS"]
    rows = np.zeros((1 + len(counts) + at_once, 4), np.uint32)  # none below the finest level, none above the root
    rows[1 : 1 + len(counts), 0] = len(plan.points.face) + tree.levels[:-1]
    rows[1 : 1 + len(counts), 1] = counts
    for level in range(0, len(counts), at_once):
        bindings[over] = graph.dispatch(
            module,
            size=int(counts[level]),
            label=f"level {level}",
            params={"levels": rows[level : level + at_once + 1], "finest": level == 0},
            starts=plan.starts,
            order=plan.order,
            **bindings,
        )
    return bindings[over]
