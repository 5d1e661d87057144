"""sam: Spatial Adjacency Maps (Maisch & Ropinski 2017).

Each vertex keeps a few senders on its far side, with the form factors between them. M_back at a vertex is the sum of
what they receive, which is blended over time and drawn between the vertices; M_front is left to another method.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from wgsss import frame as shared
from wgsss.bake.sam import SELECTIONS, SenderMap, full_sender_tree, spatial_adjacency_map
from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.methods.lambert import Lambert
from wgsss.methods.method import Diffused, Method
from wgsss.methods.sam.barnes_hut import sum_behind
from wgsss.methods.sam.deform import follow
from wgsss.methods.sam.upload import Plan, make_plan, over_nodes
from wgsss.methods.screen_space import ScreenSpace
from wgsss.methods.texture_space import TextureSpace
from wgsss.stage import Body, Stage

SURFACES: dict[str, type[Method]] = {"texture": TextureSpace, "screen": ScreenSpace, "none": Lambert}
"""What estimates M_front."""
KEPT_A_SECOND = 1e-10
"""share of M_back that is still that of a second before (eq. 18): half of it after 30 ms"""


@dataclass(frozen=True)
class Adjacency:
    """M_back as a sum over `samples` senders of each vertex (eq. 12).

    Frames in the order of their time blend M_back with that of the frame before (eq. 17, 18); the first one, one that
    is not after the last, and a scene that is rendered alone at a time, are as they are.
    """

    samples: int = field(
        default=3, metadata={"unit": "", "range": (1, 256), "help": "senders of a vertex, those it has a use for"}
    )
    select: str = field(
        default="fit", metadata={"unit": "", "choices": tuple(SELECTIONS), "help": "how they are chosen"}
    )

    source: ClassVar[str] = "Maisch & Ropinski 2017"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({"samples": 8},)
    beside: ClassVar[type] = object

    def bake(self, stage: Stage) -> None:
        """Choose the senders of each mesh's vertices for its material."""
        for body in stage.bodies:
            self.map(body)

    def map(self, body: Body) -> SenderMap:
        """The spatial adjacency map of a body at rest."""
        mesh, stage, profile = body.rest.mesh, body.stage, body.material.profile
        key = ("sam", id(mesh), id(body.material))
        if self.select == "fit" and body.rest.motion is not None:
            return stage.shared(key, lambda: full_sender_tree(stage.gpu, mesh, profile))
        return stage.shared(
            (*key, self.samples, self.select),
            lambda: spatial_adjacency_map(stage.gpu, mesh, profile, self.samples, self.select),
        )

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        M_back: Any = None
        for body in frame.stage.bodies:
            plan = self.plan(body)
            if plan is None:
                continue  # nothing shines through
            M_back = frame.graph.draw(
                "sam/show",
                into=M_back,
                size=frame.size,
                indices=plan.faces,
                params={"world_to_clip": frame.view.world_to_clip},
                object=body.object_uniforms,
                vertices=body.vertices,
                M_back_at=self.at_vertices(frame, body, plan),
                **frame.gbuffer_bindings("gbuffer_id", "base_color", "depth"),
            )
        return M_back

    def plan(self, body: Body) -> Plan | None:
        """What a frame needs of a body's map, on the device. Bodies share it, unless what it holds changes."""
        entries, stage, mesh = self.map(body), body.stage, body.rest.mesh
        moving = body.rest.motion is not None
        key = ("plan", id(entries), body.index if moving else None)
        return stage.shared(key, lambda: make_plan(stage.gpu, mesh, body.render_mesh.faces, entries, moving=moving))

    def at_vertices(self, frame: Frame, body: Body, plan: Plan) -> Handle:
        """M_back, W/m^2, at the vertices of a body's mesh, without what `color_after` leaves of the base colour."""
        graph, stage = frame.graph, body.stage
        rows, samples = plan.entries.sender.shape
        last = stage.shared(
            ("M_back", self, body.index), lambda: Last(stage.gpu.buffer(np.zeros((rows, 4), np.float32)))
        )
        passed = last.passed(stage.time_s)
        points = _points(body, plan)
        kept = KEPT_A_SECOND**passed if passed > 0.0 else 0.0
        entries = [block.entries for block in plan.blocks]
        if body.rest.motion is not None:
            if plan.nodes:
                return sum_behind(frame, body, plan, points, last.M_back, kept)
            entries = follow(graph, body, plan, points, anew=passed == 0.0)
        senders, nodes = len(plan.points.face), plan.nodes
        blend = plan.entries.smoothed_means
        blended = 0 if blend is None else len(blend.node)
        irradiance = shared.irradiance_points(frame, body, points, senders + nodes + blended, plan.points)
        irradiance = over_nodes(graph, plan, "sam/means", "irradiance", irradiance=irradiance, area=plan.area)
        if blended:
            irradiance = graph.dispatch(
                "sam/blends",
                size=blended,
                params={"means": senders, "blended": senders + nodes},
                blends=plan.blends,
                irradiance=irradiance,
            )
        params = {"kept": kept, "samples": samples, "senders": senders, "means": nodes if blended else 0}
        M_back: Any = None
        for block, of_block in zip(plan.blocks, entries, strict=True):
            M_back = graph.dispatch(
                "sam/gather",
                size=rows if M_back is None else block.count,
                params=params,
                rows=block.rows,
                entries=of_block,
                irradiance=irradiance,
                last=last.M_back,
                **({} if M_back is None else {"M_back": M_back}),
            )
        gathered, mixed = M_back, None
        for part in plan.mixes:
            mixed = graph.dispatch(
                "sam/mix",
                size=len(body.rest.mesh.positions) if mixed is None else part.count,
                vertices=part.vertices,
                mixes=part.mixes,
                gathered=gathered,
                **({} if mixed is None else {"M_back": mixed}),
            )
        return mixed or gathered


@dataclass(frozen=True)
class SpatialAdjacencyMaps(Adjacency):
    """M_back by the senders of each vertex; M_front by another method with its defaults.

    The paper adds M_back to the irradiance that the surface method then blurs (4.3). Here the two are added as they
    are: the form factors already are means over the receiving fan (eq. 11), and blurring M_back would scale it by the
    profile's total.
    """

    surface: str = field(
        default="texture", metadata={"unit": "", "choices": tuple(SURFACES), "help": "where M_front is estimated"}
    )

    sweep: ClassVar[tuple[dict[str, Any], ...]] = (
        *({"surface": "screen", "samples": n} for n in (3, 8)),
        *({"surface": "texture", "samples": n} for n in (3, 8)),
        *({"surface": "texture", "select": other} for other in SELECTIONS if other != "fit"),
    )

    def bake(self, stage: Stage) -> None:
        """Choose the senders of each mesh's vertices for its material; what M_front wants baked."""
        super().bake(stage)
        SURFACES[self.surface]().bake(stage)

    def passes(self, frame: Frame) -> Diffused:
        surface = SURFACES[self.surface]()
        return replace(surface.passes(frame), M_back=self.M_back(frame, surface))


@dataclass
class Last:
    """M_back of the frame before."""

    M_back: Any
    """buffer of vec4f, one for each row of entries, of which each vertex has one"""
    time_s: float | None = None

    def passed(self, time_s: float) -> float:
        """Seconds since then; 0 where it is not before a frame at `time_s`, which then starts anew."""
        passed = 0.0 if self.time_s is None else time_s - self.time_s
        self.time_s = time_s
        return max(passed, 0.0)


def _points(body: Body, plan: Plan) -> Any:
    """A buffer of array<Vertex> of what L_d is wanted at, as posed. Of a moving body only the last pose is kept."""
    last: dict[float, Any] = body.stage.shared(("points", body.index, id(plan)), dict)
    time_s = 0.0 if body.rest.motion is None else body.stage.time_s
    if time_s not in last:
        last.clear()
        last[time_s] = body.points(plan.points)
    return last[time_s]
