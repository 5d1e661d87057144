"""The translucency method `sam`: Spatial Adjacency Maps (Maisch & Ropinski 2017).

Each vertex keeps a few senders on its back side, with the form factors between their fans and its own. M_back at a
vertex is the sum of form factor times irradiance over its senders (eq. 12). It is blended with that of the frame before
(eq. 17, 18) and interpolated between the vertices.

The paper adds M_back to the irradiance that the surface method then blurs (section 4.3). Here the two are added as they
are: the form factors already are means over the receiving fan (eq. 11), and the blur would scale M_back by the total of
the profile.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from wgsss.bake.sam import SELECTIONS, SenderMap, full_sender_tree, spatial_adjacency_map
from wgsss.frame import Frame
from wgsss.gpu import Buffer
from wgsss.graph import Handle
from wgsss.methods.method import Method
from wgsss.methods.sam.barnes_hut import barnes_hut_sum
from wgsss.methods.sam.deform import update_form_factors
from wgsss.methods.sam.gather import gather, irradiance_of_senders, mix_neighbours
from wgsss.methods.sam.upload import GpuSenderMap, upload
from wgsss.stage import Body, Stage

HISTORY_AFTER_1_S = 1e-10
"""share of M_back that is left after one second (eq. 18): one half after 30 ms"""


@dataclass(frozen=True)
class SamTranslucency:
    """M_back at each vertex as a sum over `samples` senders (eq. 12).

    A frame blends its M_back with that of the last frame (eq. 17, 18) if its time is later. The first frame of a stage
    and one that is not later than the last are not blended.
    """

    samples: int = field(
        default=3, metadata={"unit": "", "range": (1, 256), "help": "largest number of senders of a vertex"}
    )
    select: str = field(
        default="fit", metadata={"unit": "", "choices": tuple(SELECTIONS), "help": "how senders are chosen"}
    )

    source: ClassVar[str] = "Maisch & Ropinski 2017"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({"samples": 8},)
    beside: ClassVar[type] = object

    def bake(self, stage: Stage) -> None:
        """Choose the senders of each mesh's vertices for its material."""
        for body in stage.bodies:
            self.sender_map(body)

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        """Declare the passes that estimate M_back, W/m^2 per pixel; None: no vertex of the scene receives any.

        Several methods of one frame with the same knobs share the passes.
        """
        return frame.once(("sam M_back", self), lambda: self._M_back(frame))

    def _M_back(self, frame: Frame) -> Handle | None:
        M_back: Handle | None = None
        for body in frame.stage.bodies:
            gpu_map = self.gpu_map(body)
            if gpu_map is None:
                continue
            M_back = frame.graph.draw(
                "sam/show",
                into=M_back,
                size=frame.size,
                indices=gpu_map.receiving_faces,
                params={"world_to_clip": frame.view.world_to_clip},
                object=body.object_uniforms,
                vertices=body.vertices,
                vertex_M_back=self.M_back_at_vertices(frame, body, gpu_map),
                **frame.gbuffer_bindings("gbuffer_id", "base_color", "depth"),
            )
        return M_back

    def sender_map(self, body: Body) -> SenderMap:
        """Return the Spatial Adjacency Map of a body at rest. Bodies of equal mesh and material share it."""
        mesh, stage, profile = body.rest.mesh, body.stage, body.profile
        key = ("sam", id(mesh), id(body.material))
        if self.select == "fit" and body.rest.motion is not None:  # `barnes_hut` reads no entries
            return stage.shared(key, lambda: full_sender_tree(stage.gpu, mesh, profile))
        return stage.shared(
            (*key, self.samples, self.select),
            lambda: spatial_adjacency_map(stage.gpu, mesh, profile, self.samples, self.select),
        )

    def gpu_map(self, body: Body) -> GpuSenderMap | None:
        """Return the map of a body on the GPU; None: none of its vertices receives any light from its back side.

        Bodies of one map share it. A body that deforms has its own, whose entries change from frame to frame.
        """
        sender_map, stage, mesh = self.sender_map(body), body.stage, body.rest.mesh
        deforms, render_mesh = body.rest.motion is not None, body.render_mesh  # another one once the body has an atlas
        return stage.shared(
            ("sam upload", id(sender_map), id(render_mesh), body.index if deforms else None),
            lambda: upload(stage.gpu, mesh, render_mesh.faces, sender_map, deforms=deforms),
        )

    def M_back_at_vertices(self, frame: Frame, body: Body, gpu_map: GpuSenderMap) -> Handle:
        """Declare the passes that estimate M_back at the V vertices of a body's mesh.

        The share of the base colour that is applied after diffusion is left to `sam/show`.

        Returns:
            vec4f, W/m^2, V elements or more.
        """
        points = _points(body, gpu_map)
        history, elapsed_s = self._history(body, gpu_map)
        history_weight = HISTORY_AFTER_1_S**elapsed_s if elapsed_s > 0.0 else 0.0
        entries: list[Buffer | Handle] = [block.entries for block in gpu_map.entry_blocks]
        if body.rest.motion is not None:
            if gpu_map.node_count:
                return barnes_hut_sum(frame, body, gpu_map, points, history.M_back, history_weight)
            entries = [*update_form_factors(frame.graph, body, gpu_map, points, restart=elapsed_s == 0.0)]
        irradiance = irradiance_of_senders(frame, body, gpu_map, points)
        gathered = gather(frame.graph, gpu_map, entries, irradiance, history.M_back, history_weight)
        return mix_neighbours(frame.graph, gpu_map, gathered, len(body.rest.mesh.positions))

    def _history(self, body: Body, gpu_map: GpuSenderMap) -> tuple[MBackHistory, float]:
        """Return M_back of the last frame of a body, and the seconds since then."""
        stage, rows = body.stage, len(gpu_map.sender_map.sender)
        history = stage.shared(
            ("M_back", self, body.index), lambda: MBackHistory(stage.gpu.buffer(np.zeros((rows, 4), np.float32)))
        )
        return history, history.advance(stage.time_s)


@dataclass
class MBackHistory:
    """M_back of a body in the last frame."""

    M_back: Buffer
    """vec4f, W/m^2, by row of entries; row v is that of vertex v"""
    time_s: float | None = None
    """the time of that frame; None: there was none"""

    def advance(self, time_s: float) -> float:
        """Set the time to that of a new frame and return the seconds since the last one.

        They are 0 if there was none or the new frame is not later; the new frame must then not be blended with it.
        """
        elapsed_s = 0.0 if self.time_s is None else time_s - self.time_s
        self.time_s = time_s
        return max(elapsed_s, 0.0)


def _points(body: Body, gpu_map: GpuSenderMap) -> Buffer:
    """Return the map's points as posed, array<Vertex>. Of a body that moves, only the last pose is kept."""
    last: dict[float, Buffer] = body.stage.shared(("points", body.index, id(gpu_map)), dict)
    time_s = 0.0 if body.rest.motion is None else body.stage.time_s
    if time_s not in last:
        last.clear()
        last[time_s] = body.points(gpu_map.points)
    return last[time_s]
