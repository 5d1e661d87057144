"""M_back of meshes that deform by maps that have a tree: the sum over the whole back side of each vertex.

A few senders that are chosen at rest do not stay the best ones: even with weights that are fitted to each pose, three
or eight of them are less accurate than senders chosen for the pose. To choose for a pose, one would walk the tree, and
that walk already computes all of M_back. The entries of the map are therefore not used while a mesh deforms.

Nothing is carried over from pose to pose, so errors do not accumulate. One error remains. Between fans that nearly
touch, the form factor is not area times R_d at the distance of their vertices. The ratio of the exact sum of form
factors to the approximate one is computed at rest, for each vertex, and the same ratio is used in every pose.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import frame as shared
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.patch_form_factors import NEAR_ORDER, near_pairs
from wgsss.cache import Arrays, cached
from wgsss.frame import Frame
from wgsss.gpu import Buffer
from wgsss.graph import Graph, Handle
from wgsss.methods.sam.deform import posed_clusters
from wgsss.methods.sam.rest_state import rest_state
from wgsss.methods.sam.tree_nodes import node_means
from wgsss.methods.sam.upload import GpuSenderMap
from wgsss.stage import Body

Array = npt.NDArray[Any]

_LEVELS = 16  # of wgsl/sam/barnes_hut.wgsl: enough for 4^16 vertices
_FINE = 0.05  # in place of OPENING, for exact sums at rest
_MOST = 16.0  # largest scale: that of a vertex which hardly any light reaches means little


def barnes_hut_sum(
    frame: Frame, body: Body, gpu_map: GpuSenderMap, points: Buffer, history: Buffer, history_weight: float
) -> Handle:
    """Compute M_back, W/m^2 (V, 4), at all vertices of a body as posed (Maisch & Ropinski 2017, eq. 12, 17).

    Args:
        points: array<Vertex>: the map's points as posed, which are the vertices.
        history: vec4f: M_back of the last frame; it is replaced by the result.
        history_weight: share of `history` in the result.
    """
    graph, stage = frame.graph, body.stage
    posed = posed_clusters(graph, body, gpu_map, points)
    count = len(gpu_map.points.face) + gpu_map.node_count
    irradiance = shared.irradiance_points(frame, body, points, count, gpu_map.points)
    irradiance = node_means(graph, gpu_map, irradiance, posed.area)
    scale = stage.shared(("scale", id(gpu_map)), lambda: stage.gpu.buffer(_scale(body, gpu_map)))
    return _sum(
        graph,
        body,
        gpu_map,
        clusters=posed.clusters,
        irradiance=irradiance,
        scale=scale,
        history=history,
        history_weight=history_weight,
    )


def _sum(
    graph: Graph,
    body: Body,
    gpu_map: GpuSenderMap,
    *,
    clusters: Buffer | Handle,
    irradiance: Buffer | Handle,
    scale: Buffer,
    history: Buffer,
    history_weight: float = 0.0,
    constants: dict[str, float] | None = None,
) -> Handle:
    """Declare the walk through the tree. The arguments are the bindings of wgsl/sam/barnes_hut.wgsl."""
    tree, state = gpu_map.sender_map.tree, rest_state(body, gpu_map)
    assert tree is not None and gpu_map.tree is not None
    levels = np.zeros((_LEVELS, 4), np.uint32)
    levels[: len(tree.levels) - 1, 0] = gpu_map.sender_map.sender_count + tree.levels[:-1]
    return graph.dispatch(
        "sam/barnes_hut",
        size=len(tree.order),
        constants=constants,
        params={
            "levels": levels,
            "root_level": len(tree.levels) - 2,
            "low": state.low,
            "steps": state.steps,
            "history_weight": history_weight,
        },
        table=state.table,
        leaf_starts=gpu_map.tree.leaf_starts,
        order=gpu_map.tree.order,
        clusters=clusters,
        irradiance=irradiance,
        scale=scale,
        history=history,
    )


def _scale(body: Body, gpu_map: GpuSenderMap) -> Array:
    """Compute the ratio of the exact sum of form factors to that of the walk, per vertex at rest; cached.

    The exact sum (Maisch & Ropinski 2017, eq. 11) is that of a walk with small clusters, in which the form factors of
    near fans are replaced by integrals over both.

    Returns:
        float32 (V, 4): the ratio in each channel; the last column is 1.
    """
    gpu, mesh, profile, state = body.stage.gpu, body.rest.mesh, body.profile, rest_state(body, gpu_map)
    V = len(mesh.positions)

    def make() -> Arrays:
        o, i = near_pairs(mesh).T
        distance = np.maximum(np.linalg.norm(mesh.positions[o] - mesh.positions[i], axis=1), np.exp2(0.5 * state.low))
        near = FormFactors(gpu, mesh, profile).of(np.stack([o, i], axis=1), max_order=NEAR_ORDER)
        difference = near - fan_areas(mesh)[i, None] * profile.reflectance(distance)
        difference = np.stack([np.bincount(o, difference[:, channel], V) for channel in range(3)], axis=1)

        graph = Graph(gpu)
        ones = gpu.buffer(np.ones((V + gpu_map.node_count, 4), np.float32))
        zeros = gpu.buffer(np.zeros((V, 4), np.float32))
        sums = [
            _sum(
                graph,
                body,
                gpu_map,
                clusters=state.clusters,
                irradiance=ones,
                scale=ones,
                history=zeros,
                constants=constants,
            )
            for constants in (None, {"OPENING": _FINE})
        ]
        graph.run(*sums)
        walk, fine = (graph.read(handle)[:, :3] for handle in sums)
        scale = np.ones((V, 4), np.float32)
        scale[:, :3] = np.clip((fine + difference) / np.maximum(walk, 1e-30), 0.0, _MOST)
        return {"scale": scale}

    key = [mesh, profile, gpu_map.sender_map, gpu.name]
    return cached("sam-scale", key, make, label="summing all form factors at rest")["scale"]
