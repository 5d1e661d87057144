"""The upload of a Spatial Adjacency Map: the buffers that a frame reads."""

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
from wgsss.bake.samples import Samples, vertex_samples
from wgsss.gpu import LIMITS, Buffer, Gpu
from wgsss.scene import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class EntryBlock:
    """Some rows of entries, as many as fit into one storage binding."""

    row_count: int
    rows: Buffer
    """u32: the indices of the rows"""
    entries: Buffer
    """array<Entry> (wgsl/sam/sender_map.wgsl), one row after the other"""
    current_senders: Buffer
    """i32: the senders of the entries in the last frame, for meshes that deform"""


@dataclass(frozen=True, eq=False)
class MixtureBlock:
    """The mixtures of some vertices, as many as fit into one storage binding."""

    vertex_count: int
    vertices: Buffer
    """u32: the indices of the vertices"""
    mixtures: Buffer
    """array<Mixture> (wgsl/sam/neighbour_mixture.wgsl)"""


@dataclass(frozen=True, eq=False)
class GpuTree:
    """The tree over the senders of a map, and the areas that weight means over its nodes."""

    leaf_starts: Buffer
    """u32: the index in `order` of the first sender of each node of the finest level, and the end"""
    order: Buffer
    """u32: the senders, as indices of points, in the order of the tree"""
    area: Buffer
    """f32: the areas of the points' reduced fans at rest, mm^2"""


@dataclass(frozen=True, eq=False)
class GpuSenderMap:
    """A sender map on the GPU, without the senders that no entry reads and the vertices that receive nothing.

    Its points are the senders that entries read. The sender of an entry is an index: first come the points, then the
    nodes of the tree or, if the map has smoothed means, these.
    """

    sender_map: SenderMap
    points: Samples
    """the points of the surface at which a frame computes L_d"""
    entry_blocks: list[EntryBlock]
    receiving_faces: Buffer
    """u32: the render vertices of the faces with a vertex that receives light, three for each face"""
    mixture_blocks: list[MixtureBlock]
    """empty if the map has no mixtures"""
    tree: GpuTree | None = None
    smoothed_means: Buffer | None = None
    """array<SmoothedMean> (wgsl/sam/smoothed_means.wgsl)"""

    @property
    def node_count(self) -> int:
        """The number of nodes of the tree; 0 without a tree."""
        return 0 if self.sender_map.tree is None else len(self.sender_map.tree.first)

    @property
    def smoothed_count(self) -> int:
        """The number of smoothed means."""
        return 0 if self.sender_map.smoothed_means is None else len(self.sender_map.smoothed_means.node)


def upload(gpu: Gpu, mesh: Mesh, faces: Array, sender_map: SenderMap, *, deforms: bool) -> GpuSenderMap | None:
    """Upload the map of a mesh; None: no vertex receives anything.

    Args:
        mesh: the mesh at rest.
        faces: (F, 3), the faces of its render mesh.
        deforms: whether the mesh deforms. Its entries may then come to read any sender, so all senders are points, and
            if the senders are no vertices, the vertices follow them as points.
    """
    has_entries, V = sender_map.sender.max(axis=1) >= 0, len(mesh.positions)
    rows, receives, tree = np.flatnonzero(has_entries), has_entries[:V], sender_map.tree
    if not len(rows):
        return None
    read = np.arange(sender_map.sender_count) if deforms else _senders_read(sender_map)
    samples = vertex_samples(mesh) if sender_map.sender_samples is None else sender_map.sender_samples
    points = Samples(samples.face[read], samples.barycentric[read], samples.share[read])
    if deforms and sender_map.sender_samples is not None:
        points = _concatenated(points, vertex_samples(mesh))
    means = 0 if tree is None else len(tree.first)
    if sender_map.smoothed_means is not None:
        means = len(sender_map.smoothed_means.node)
    point_of = np.full(sender_map.sender_count, -1, np.int32)
    point_of[read] = np.arange(len(read))
    # By sender, then by mean; the last element is for the sender -1 of unused entries.
    index_of = np.concatenate([point_of, len(points.face) + np.arange(means), [-1]])
    entry_blocks = _entry_blocks(gpu, rows, index_of[sender_map.sender[rows]], sender_map.weight[rows])
    receiving_faces = gpu.buffer(faces[receives[mesh.faces].any(axis=1)].astype(np.uint32))
    mixture = sender_map.neighbour_mixture
    mixture_blocks = [] if mixture is None else _mixture_blocks(gpu, rows[rows < V], mixture)
    if tree is None:
        return GpuSenderMap(sender_map, points, entry_blocks, receiving_faces, mixture_blocks)
    leaf_starts = np.append(tree.first[: tree.levels[1]], len(tree.order))
    # A sender that is no point has the index -1. No node that is read is above it, so any index will do.
    order = np.maximum(point_of[tree.order], 0)
    return GpuSenderMap(
        sender_map,
        points,
        entry_blocks,
        receiving_faces,
        mixture_blocks,
        GpuTree(
            gpu.buffer(leaf_starts.astype(np.uint32)),
            gpu.buffer(order.astype(np.uint32)),
            gpu.buffer(fan_areas(mesh)[read].astype(np.float32)),
        ),
        None if sender_map.smoothed_means is None else _smoothed_means(gpu, sender_map.smoothed_means),
    )


def _concatenated(first: Samples, second: Samples) -> Samples:
    return Samples(
        np.concatenate([first.face, second.face]),
        np.concatenate([first.barycentric, second.barycentric]),
        np.concatenate([first.share, second.share]),
    )


def _senders_read(sender_map: SenderMap) -> Array:
    """Return the indices of the senders that entries read, by themselves or in the mean of a node."""
    sender, count = sender_map.sender, sender_map.sender_count
    is_read = np.zeros(count, bool)
    is_read[sender[(sender >= 0) & (sender < count)]] = True
    tree = sender_map.tree
    if tree is not None:
        nodes = np.unique(sender[sender >= count]) - count
        if sender_map.smoothed_means is not None:
            nodes = np.unique(sender_map.smoothed_means.node)
        edges = np.zeros(len(tree.order) + 1, np.int64)  # +1 where the range of a node begins, -1 where it ends
        np.add.at(edges, tree.first[nodes], 1)
        np.add.at(edges, tree.first[nodes] + tree.count[nodes], -1)
        is_read[tree.order[np.cumsum(edges[:-1]) > 0]] = True
    return np.flatnonzero(is_read)


def _entry_blocks(gpu: Gpu, rows: Array, sender: Array, weight: Array) -> list[EntryBlock]:
    """Upload the entries of rows (R,), with senders (R, n) and weights (R, n, 3)."""
    layout = wgsl.load("sam/gather").layout("array<Entry>")
    return [
        EntryBlock(
            len(rows[some]),
            gpu.buffer(rows[some].astype(np.uint32)),
            gpu.buffer(layout.pack({"weight": weight[some].reshape(-1, 3), "sender": sender[some].ravel()})),
            gpu.buffer(sender[some].astype(np.int32)),
        )
        for some in _binding_slices(len(rows), ENTRY_BYTES * sender.shape[1])
    ]


def _mixture_blocks(gpu: Gpu, vertices: Array, mixture: NeighbourMixture) -> list[MixtureBlock]:
    """Upload the mixtures of vertices (k,)."""
    layout = wgsl.load("sam/neighbour_mixture").layout("array<Mixture>")
    blocks = []
    for some in _binding_slices(len(vertices), MIXTURE_BYTES):
        v = vertices[some]
        halves = np.concatenate([mixture.weight[v], mixture.tint[v]], axis=1).view(np.uint32)
        packed = layout.pack({"row": mixture.row[v], "halves": halves})
        blocks.append(MixtureBlock(len(v), gpu.buffer(v.astype(np.uint32)), gpu.buffer(packed)))
    return blocks


def _binding_slices(count: int, item_bytes: int) -> Iterator[slice]:
    """Divide `count` items into slices that each fit into one storage binding."""
    most = LIMITS["max-storage-buffer-binding-size"] // item_bytes
    return (slice(first, first + most) for first in range(0, count, most))


def _smoothed_means(gpu: Gpu, means: SmoothedMeans) -> Buffer | None:
    if not len(means.node):
        return None
    layout = wgsl.load("sam/smoothed_means").layout("array<SmoothedMean>")
    return gpu.buffer(layout.pack({"node": means.node, "weight": means.weight}))
