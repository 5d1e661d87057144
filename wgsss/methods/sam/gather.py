"""The passes that sum up the entries of a Spatial Adjacency Map: from irradiance to M_back at the vertices."""

from __future__ import annotations

from wgsss import frame as shared
from wgsss.frame import Frame
from wgsss.gpu import Buffer
from wgsss.graph import Bindings, Graph, Handle
from wgsss.methods.sam.tree_nodes import node_means
from wgsss.methods.sam.upload import GpuSenderMap
from wgsss.stage import Body


def irradiance_of_senders(frame: Frame, body: Body, gpu_map: GpuSenderMap, points: Buffer) -> Handle:
    """Compute what entries read, vec4f, W/m^2: L_d at the points, then the means of nodes, then smoothed means."""
    points_end, nodes, smoothed = len(gpu_map.points.face), gpu_map.node_count, gpu_map.smoothed_count
    irradiance = shared.irradiance_points(frame, body, points, points_end + nodes + smoothed, gpu_map.points)
    if gpu_map.tree is not None:
        irradiance = node_means(frame.graph, gpu_map, irradiance, gpu_map.tree.area)
    if smoothed:
        irradiance = frame.graph.dispatch(
            "sam/smoothed_means",
            size=smoothed,
            params={"first_node": points_end, "first_smoothed": points_end + nodes},
            smoothed_means=gpu_map.smoothed_means,
            irradiance=irradiance,
        )
    return irradiance


def gather(
    graph: Graph,
    gpu_map: GpuSenderMap,
    entries: list[Buffer | Handle],
    irradiance: Handle,
    history: Buffer,
    history_weight: float,
) -> Handle:
    """Sum up the entries of each row (eq. 12) and blend with the last frame (eq. 17): vec4f, W/m^2, by row.

    Args:
        entries: array<Entry>, one buffer for each block of entries.
    """
    row_count, entries_per_row = gpu_map.sender_map.sender.shape
    params = {
        "history_weight": history_weight,
        "entries_per_row": entries_per_row,
        "sender_count": len(gpu_map.points.face),
        "skipped_means": gpu_map.node_count if gpu_map.smoothed_count else 0,
    }
    M_back: Handle | None = None
    for block, block_entries in zip(gpu_map.entry_blocks, entries, strict=True):
        output: Bindings = {} if M_back is None else {"M_back": M_back}  # all blocks write into one buffer
        M_back = graph.dispatch(
            "sam/gather",
            size=row_count if M_back is None else block.row_count,
            params=params,
            rows=block.rows,
            entries=block_entries,
            irradiance=irradiance,
            history=history,
            **output,
        )
    assert M_back is not None, "a map on the GPU has entries"
    return M_back


def mix_neighbours(graph: Graph, gpu_map: GpuSenderMap, gathered: Handle, vertex_count: int) -> Handle:
    """Compute M_back of each vertex as its mixture of what rows gathered; without mixtures, return `gathered`."""
    M_back: Handle | None = None
    for block in gpu_map.mixture_blocks:
        output: Bindings = {} if M_back is None else {"M_back": M_back}
        M_back = graph.dispatch(
            "sam/neighbour_mixture",
            size=vertex_count if M_back is None else block.vertex_count,
            vertices=block.vertices,
            mixtures=block.mixtures,
            gathered=gathered,
            **output,
        )
    return M_back or gathered
