"""sam: Spatial Adjacency Maps (Maisch & Ropinski 2017).

Each vertex keeps a few senders on its far side, with the form factors between them. M_back at a vertex is the sum of
what they receive, which is blended over time and drawn between the vertices; M_front is left to another method.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from wgsss import frame as shared
from wgsss.bake.sam import SELECTIONS, Entries, spatial_adjacency_map
from wgsss.bake.sam.fans import fan_areas
from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.methods.lambert import Lambert
from wgsss.methods.method import Diffused, Method
from wgsss.methods.sam_senders import blocks, follow, over_nodes, sender_samples, upload
from wgsss.methods.screen_space import ScreenSpace
from wgsss.methods.texture_space import TextureSpace
from wgsss.stage import Body, Stage

SURFACES: dict[str, type[Method]] = {"texture": TextureSpace, "screen": ScreenSpace, "none": Lambert}
"""What estimates M_front."""
KEPT_A_SECOND = 1e-10
"""share of M_back that is still that of a second before (eq. 18): half of it after 30 ms"""


@dataclass(frozen=True)
class SpatialAdjacencyMaps:
    """M_back as a sum over `samples` senders of each vertex (eq. 12); M_front by another method.

    The paper adds M_back to the irradiance that the surface method then blurs (4.3). Here the two are added as they
    are: the form factors already are means over the receiving fan (eq. 11), and blurring M_back would scale it by the
    profile's total. Frames in the order of their time blend M_back with that of the frame before (eq. 17, 18); the
    first one, one that is not after the last, and a scene that is rendered alone at a time, are as they are.
    """

    samples: int = field(
        default=3, metadata={"unit": "", "range": (1, 256), "help": "senders of a vertex, those it has a use for"}
    )
    select: str = field(
        default="top", metadata={"unit": "", "choices": tuple(SELECTIONS), "help": "how they are chosen"}
    )
    surface: str = field(
        default="texture", metadata={"unit": "", "choices": tuple(SURFACES), "help": "where M_front is estimated"}
    )

    source: ClassVar[str] = "Maisch & Ropinski 2017"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"samples": n} for n in (3, 8, 20))

    def bake(self, stage: Stage) -> None:
        """Choose the senders of each mesh's vertices for its material; what M_front wants baked."""
        for body in stage.bodies:
            self.map(body)
        SURFACES[self.surface]().bake(stage)

    def map(self, body: Body) -> Entries:
        """The spatial adjacency map of a body at rest."""
        mesh, stage = body.rest.mesh, body.stage
        return stage.shared(
            ("sam", id(mesh), id(body.material), self.samples, self.select),
            lambda: spatial_adjacency_map(stage.gpu, mesh, body.material.profile, self.samples, self.select),
        )

    def passes(self, frame: Frame) -> Diffused:
        diffused = SURFACES[self.surface]().passes(frame)
        drawn: Any = None
        for body in frame.stage.bodies:
            if not (self.map(body).sender >= 0).any():
                continue  # nothing shines through
            drawn = frame.graph.draw(
                "sam/show",
                into={} if drawn is None else {"M_back": drawn.M_back},
                size=frame.size,
                depth_buffer="new" if drawn is None else drawn.depth,
                indices=body.indices,
                params={"world_to_clip": frame.view.world_to_clip},
                surface=body.surface,
                vertices=body.vertices,
                M_back_at=self.at_vertices(frame, body),
                **frame.seen("where_seen", "base_color"),
            )
        return replace(diffused, M_back=drawn and drawn.M_back)

    def at_vertices(self, frame: Frame, body: Body) -> Handle:
        """M_back, W/m^2, at the vertices of a body's mesh, without what `color_after` leaves of the base colour."""
        graph, stage, mesh, entries = frame.graph, body.stage, body.rest.mesh, self.map(body)
        V, samples = entries.sender.shape
        last = stage.shared(("M_back", self, body.index), lambda: Last(stage.gpu.buffer(np.zeros((V, 4), np.float32))))
        passed = last.passed(stage.time_s)
        placed, points = self._points(body)
        chosen: list[Any] = stage.shared(("entries", id(entries)), lambda: upload(stage.gpu, entries))
        area: Any = None
        if body.rest.motion is not None:
            chosen, area = follow(graph, body, entries, points, chosen, anew=passed == 0.0)
        nodes = 0 if entries.tree is None else len(entries.tree.first)
        irradiance = shared.irradiance_points(frame, body, points, placed + nodes)
        if entries.tree is not None:
            fans = stage.shared(("fans", id(mesh)), lambda: stage.gpu.buffer(fan_areas(mesh).astype(np.float32)))
            bindings = {"irradiance": irradiance, "area": area or fans}
            irradiance = over_nodes(graph, body, entries, "sam/means", "irradiance", **bindings)
        params = {"kept": KEPT_A_SECOND**passed if passed > 0.0 else 0.0, "samples": samples}
        M_back: Any = None
        for block, some in zip(blocks(entries), chosen, strict=True):
            M_back = graph.dispatch(
                "sam/gather",
                size=V if M_back is None else block.stop - block.start,
                params={**params, "first": block.start},
                entries=some,
                irradiance=irradiance,
                last=last.M_back,
                **({} if M_back is None else {"M_back": M_back}),
            )
        return M_back

    def _points(self, body: Body) -> tuple[int, Any]:
        """How many points a body's map has, and a buffer of array<Vertex> of them as posed. Of a moving body only the
        last pose is kept."""
        stage, mesh, entries = body.stage, body.rest.mesh, self.map(body)
        moving = body.rest.motion is not None
        samples = stage.shared(("senders", id(entries), moving), lambda: sender_samples(mesh, entries, moving=moving))
        last: dict[float, Any] = stage.shared(("points", body.index, id(entries)), dict)
        time_s = stage.time_s if moving else 0.0
        if time_s not in last:
            last.clear()
            last[time_s] = body.points(samples)
        return len(samples.face), last[time_s]


@dataclass
class Last:
    """M_back of the frame before."""

    M_back: Any
    """buffer of vec4f, one for each vertex"""
    time_s: float | None = None

    def passed(self, time_s: float) -> float:
        """Seconds since then; 0 where it is not before a frame at `time_s`, which then starts anew."""
        passed = 0.0 if self.time_s is None else time_s - self.time_s
        self.time_s = time_s
        return max(passed, 0.0)
