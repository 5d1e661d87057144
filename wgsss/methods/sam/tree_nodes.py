"""The passes that compute values of the nodes of a sender tree from those of the senders."""

from __future__ import annotations

import numpy as np

from wgsss import wgsl
from wgsss.gpu import Buffer
from wgsss.graph import Bindings, Graph, Handle, Value
from wgsss.methods.sam.upload import GpuSenderMap


def node_means(graph: Graph, gpu_map: GpuSenderMap, irradiance: Handle, area: Buffer | Handle) -> Handle:
    """Compute the mean irradiance of each tree node, weighted by `area`; without a tree, return `irradiance`.

    Args:
        irradiance: vec4f: L_d, W/m^2, of each point of the map, then space for each node.
        area: f32, mm^2: the areas of the points' fans.
    """
    return _fill_nodes(graph, gpu_map, "sam/node_means", "irradiance", irradiance, area=area)


def node_clusters(graph: Graph, gpu_map: GpuSenderMap, clusters: Handle) -> Handle:
    """Compute the cluster of each tree node; without a tree, return `clusters`.

    Args:
        clusters: array<Cluster> (wgsl/sam/cluster.wgsl): one for each point of the map, then space for each node.
    """
    return _fill_nodes(graph, gpu_map, "sam/cluster_tree", "clusters", clusters)


def _fill_nodes(
    graph: Graph, gpu_map: GpuSenderMap, module: str, name: str, buffer: Handle, **bindings: Value
) -> Handle:
    """Run a module from the leaves to the root, several levels in a dispatch.

    Args:
        name: the binding of `buffer`, which the module completes.
        bindings: what else the module binds, beside `levels` and the tree.
    """
    tree = gpu_map.sender_map.tree
    if tree is None or gpu_map.tree is None:
        return buffer
    counts = np.diff(tree.levels)
    levels_at_once = wgsl.load(module).constants["LEVELS"]
    levels = np.zeros((1 + len(counts) + levels_at_once, 4), np.uint32)  # no nodes below the leaves and above the root
    levels[1 : 1 + len(counts), 0] = len(gpu_map.points.face) + tree.levels[:-1]
    levels[1 : 1 + len(counts), 1] = counts
    for level in range(0, len(counts), levels_at_once):
        values: Bindings = {**bindings, name: buffer}
        buffer = graph.dispatch(
            module,
            size=int(counts[level]),
            label=f"level {level}",
            params={"levels": levels[level : level + levels_at_once + 1], "starts_at_leaves": level == 0},
            leaf_starts=gpu_map.tree.leaf_starts,
            order=gpu_map.tree.order,
            **values,
        )
    return buffer
