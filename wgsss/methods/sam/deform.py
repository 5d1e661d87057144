"""Sender maps of meshes that deform (Maisch & Ropinski 2017, section 3.4): form factors follow areas and distances.

An entry moves on to a neighbour of its sender that has a larger form factor. Such moves are local, so after a while the
entries may miss the parts of the back side that matter most. This does not accumulate: when the rest pose comes back,
so do the baked senders and weights. Maps without entries, which have only a tree, are in `barnes_hut`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.fans import one_ring
from wgsss.gpu import Buffer
from wgsss.graph import Graph, Handle
from wgsss.methods.sam.rest_state import clusters_at_rest, rest_state
from wgsss.methods.sam.tree_nodes import node_clusters
from wgsss.methods.sam.upload import GpuSenderMap
from wgsss.scene import Mesh
from wgsss.stage import Body

Array = npt.NDArray[Any]

_NEIGHBOURS = 6  # of a sender that is no vertex


@dataclass(frozen=True)
class PosedClusters:
    """The clusters of a map as posed."""

    clusters: Handle
    """array<Cluster> (wgsl/sam/cluster.wgsl): of the points, then of the tree's nodes"""
    area: Handle
    """f32: the areas of the points' fans, mm^2"""


def posed_clusters(graph: Graph, body: Body, gpu_map: GpuSenderMap, points: Buffer) -> PosedClusters:
    """Compute the clusters of a body's map as posed.

    Args:
        points: array<Vertex>: the map's points as posed.
    """
    state = rest_state(body, gpu_map)
    size = len(gpu_map.points.face) + gpu_map.node_count
    fans = graph.dispatch_outputs("sam/fans", size=size, points=points, starts=state.starts, corners=state.corners)
    return PosedClusters(node_clusters(graph, gpu_map, fans.clusters), fans.area)


def update_form_factors(
    graph: Graph, body: Body, gpu_map: GpuSenderMap, points: Buffer, *, restart: bool
) -> list[Handle]:
    """Compute the entries of a body's map as posed: array<Entry>, one buffer for each block of entries.

    The map must not have a tree.

    Args:
        points: array<Vertex>: the map's points as posed.
        restart: start from the senders at rest instead of those of the last frame.
    """
    sender_map, state = gpu_map.sender_map, rest_state(body, gpu_map)
    neighbours = body.stage.shared(
        ("neighbours", id(gpu_map)), lambda: body.stage.gpu.buffer(_sender_neighbours(body.rest.mesh, sender_map))
    )
    params = {
        "low": state.low,
        "steps": state.steps,
        "entries_per_row": sender_map.sender.shape[1],
        "first_receiver": 0 if sender_map.sender_samples is None else sender_map.sender_count,
        "restart": restart,
        "equal_areas": sender_map.sender_samples is not None,
    }
    clusters = posed_clusters(graph, body, gpu_map, points).clusters
    return [
        graph.dispatch(
            "sam/update_form_factors",
            size=(block.row_count, sender_map.sender.shape[1]),
            params=params,
            vertices=block.rows,
            rest_entries=block.entries,
            current=block.current_senders,
            clusters=clusters,
            rest_clusters=state.clusters,
            neighbours=neighbours,
            table=state.table,
        )
        for block in gpu_map.entry_blocks
    ]


def _sender_neighbours(mesh: Mesh, sender_map: SenderMap) -> Array:
    """Return the neighbours of each of S senders, uint32 (S + 1 + k,).

    The first S + 1 elements are the index, in this array, of each sender's first neighbour, and the end; the other k
    are the neighbours. Those of a vertex are its one-ring; those of another sender are the nearest senders whose
    normals differ by less than a right angle.
    """
    if sender_map.sender_samples is None:
        ring = one_ring(mesh)
        start, neighbours = ring.start, ring.vertex
    else:
        from scipy.spatial import KDTree

        clusters = clusters_at_rest(mesh, sender_map)
        x, n = (clusters[name][: sender_map.sender_count] for name in ("position", "normal"))
        k = min(_NEIGHBOURS + 1, len(x))
        nearest = KDTree(x).query(x, k=[*range(1, k + 1)])[1]
        accepted = (nearest != np.arange(len(x))[:, None]) & (np.einsum("sd,skd->sk", n, n[nearest]) > 0.0)
        start, neighbours = np.append(0, np.cumsum(accepted.sum(axis=1))), nearest[accepted]
    return np.concatenate([start + len(start), neighbours]).astype(np.uint32)
