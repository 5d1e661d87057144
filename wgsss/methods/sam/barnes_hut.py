"""M_back of meshes that deform, where a spatial adjacency map has a tree: the sum over all that is behind a vertex.

No few nodes stay the best ones: with their weights fitted anew to each pose, three or eight chosen at rest fall behind
those chosen for the pose. To know what they miss is to walk the tree, and what the walk finds is all of M_back. So the
map's entries, and how many they are, count for nothing while a mesh deforms.

Nothing is kept from pose to pose, and so nothing drifts but this: how much more than at their distance fans receive
that nearly touch is integrated at rest, and the same wherever they go. It is exact again as the rest pose comes back.
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
from wgsss.graph import Graph, Handle
from wgsss.methods.sam.deform import deforming, posed
from wgsss.methods.sam.upload import Plan, over_nodes
from wgsss.stage import Body

Array = npt.NDArray[Any]

_LEVELS = 16  # of wgsl/sam/sum.wgsl: 4^16 vertices
_FINE = 0.05  # in place of OPENING, by which totals at rest are exact
_MOST = 16.0  # of a scale: what hardly anything reaches tells little


def sum_behind(frame: Frame, body: Body, plan: Plan, points: Any, last: Any, kept: float) -> Handle:
    """M_back, W/m^2, at all vertices of a body as posed: a buffer of vec4f.

    Args:
        points: a buffer of array<Vertex>: the plan's points, which are the vertices, as posed.
        last: a buffer of vec4f: M_back of the frame before, of which the share `kept` stays (eq. 17).
    """
    graph, stage = frame.graph, body.stage
    pose = posed(graph, body, plan, points)
    irradiance = shared.irradiance_points(frame, body, points, len(plan.points.face) + plan.nodes, plan.points)
    irradiance = over_nodes(graph, plan, "sam/means", "irradiance", irradiance=irradiance, area=pose.area)
    scale = stage.shared(("scale", id(plan)), lambda: stage.gpu.buffer(_scale(body, plan)))
    return _sum(graph, body, plan, places=pose.places, irradiance=irradiance, scale=scale, last=last, kept=kept)


def _sum(graph: Graph, body: Body, plan: Plan, constants: Any = None, kept: float = 0.0, **bindings: Any) -> Handle:
    tree, held = plan.entries.tree, deforming(body, plan)
    assert tree is not None
    levels = np.zeros((_LEVELS, 4), np.uint32)
    levels[: len(tree.levels) - 1, 0] = plan.entries.sender_count + tree.levels[:-1]
    params = {"levels": levels, "top": len(tree.levels) - 2, "low": held.low, "steps": held.steps, "kept": kept}
    found: Handle = graph.dispatch(
        "sam/sum",
        size=len(tree.order),
        constants=constants,
        params=params,
        table=held.table,
        starts=plan.starts,
        order=plan.order,
        **bindings,
    )
    return found


def _scale(body: Body, plan: Plan) -> Array:
    """float32 (V, 4): all form factors of the vertices at rest, over what the sum takes them for; cached."""
    gpu, mesh, profile, held = body.stage.gpu, body.rest.mesh, body.material.profile, deforming(body, plan)
    tree, V = plan.entries.tree, len(mesh.positions)
    assert tree is not None

    def make() -> Arrays:
        o, i = near_pairs(mesh).T
        distance = np.maximum(np.linalg.norm(mesh.positions[o] - mesh.positions[i], axis=1), np.exp2(0.5 * held.low))
        near = FormFactors(gpu, mesh, profile).of(np.stack([o, i], axis=1), max_order=NEAR_ORDER)
        more = near - fan_areas(mesh)[i, None] * profile.reflectance(distance)
        more = np.stack([np.bincount(o, more[:, channel], V) for channel in range(3)], axis=1)

        graph = Graph(gpu)
        even, dark = gpu.buffer(np.ones((V + plan.nodes, 4), np.float32)), gpu.buffer(np.zeros((V, 4), np.float32))
        given = {"places": held.rest, "irradiance": even, "scale": even, "last": dark}
        totals = [_sum(graph, body, plan, constants, **given) for constants in (None, {"OPENING": _FINE})]
        graph.run(*totals)
        taken, total = (graph.read(handle)[:, :3] for handle in totals)
        scale = np.ones((V, 4), np.float32)
        scale[:, :3] = np.clip((total + more) / np.maximum(taken, 1e-30), 0.0, _MOST)
        return {"scale": scale}

    key = [mesh, profile, plan.entries, gpu.name]
    return cached("sam-scale", key, make, label="summing all form factors at rest")["scale"]
