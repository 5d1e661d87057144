"""deon07's surface: texture-space diffusion by a sum of Gaussians (d'Eon & Luebke 2007; Mikkelsen 2009, 3.4).

The irradiance is drawn over the object's atlas, dilated across chart borders, and blurred by ever wider Gaussians, each
starting from the last result, since the variances of successive Gaussians add up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from wgsss import frame as shared
from wgsss.bake.charts import Charts, charts
from wgsss.frame import Frame
from wgsss.graph import Graph, Handle
from wgsss.methods.method import Diffused
from wgsss.optics import SumOfGaussians, fit_gaussians
from wgsss.stage import Body, Stage

_SLOTS = 6  # of wgsl/texture_space/gather.wgsl
# The directions of a separable blur are undefined where the surface faces the axis that they turn about. With another
# axis for each Gaussian, no place is undefined for all.
_AXES = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class TextureSpace:
    """M_front as the sum of w_k G(v_k) * L_d over the atlas; M_back is not estimated."""

    map_size: int = field(
        default=1024, metadata={"unit": "texels", "range": (64, 4096), "help": "side of the irradiance map"}
    )
    gaussians: int = field(default=6, metadata={"unit": "", "range": (1, 6), "help": "Gaussians in the sum"})

    source: ClassVar[str] = "d'Eon & Luebke 2007, GPU Gems 3, chapter 14; Mikkelsen 2009, section 3.4"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"map_size": n} for n in (256, 512, 1024, 2048))

    def bake(self, stage: Stage) -> None:
        """Unwrap each mesh and compute its stretch and seams; fit the Gaussians to each material's profile."""
        for body in stage.bodies:
            self.charts(body)
            self.profile(body)

    def charts(self, body: Body) -> Charts:
        """The atlas of a body at this method's map size."""
        surface = body.unwrap()
        mesh, stage = body.rest.mesh, body.stage
        return stage.shared(
            ("charts", id(mesh), self.map_size), lambda: charts(stage.gpu, mesh, surface, self.map_size)
        )

    def profile(self, body: Body) -> SumOfGaussians:
        """The sum of Gaussians of a body's material: its own where it has at most as many, else a fit."""
        profile = body.material.profile
        if isinstance(profile, SumOfGaussians) and len(profile.variances) <= self.gaussians:
            return profile
        return body.stage.shared(
            ("fit", id(body.material), self.gaussians), lambda: fit_gaussians(profile, self.gaussians)
        )

    def passes(self, frame: Frame) -> Diffused:
        M_front: Any = None
        for body in frame.stage.bodies:
            atlas, profile = self.charts(body), self.profile(body)
            irradiance = shared.irradiance_texels(frame, body, self.map_size)
            blurred = blurs(frame.graph, irradiance, atlas, profile)
            weights = np.zeros((_SLOTS, 4))
            weights[: len(blurred), :3] = profile.weights
            maps: dict[str, Any] = {f"blurred_{i}": blurred[min(i, len(blurred) - 1)] for i in range(_SLOTS)}
            M_front = frame.graph.draw(
                "texture_space/gather",
                into=M_front,
                size=frame.size,
                params={"weights": weights},
                surface=body.surface,
                **maps,
                **frame.seen("where_seen", "base_color"),
            )
        return Diffused(M_front)


def blurs(graph: Graph, irradiance: Handle, atlas: Charts, profile: SumOfGaussians) -> list[Handle]:
    """The irradiance map blurred by each Gaussian of the profile, narrowest first."""
    seams: dict[str, Any] = {"ids": atlas.ids, "seams": atlas.seams}
    blurred = graph.draw("texture_space/dilate", source=irradiance, size=irradiance.size, **seams)
    found, reached = [], 0.0
    for k, variance in enumerate(profile.variances):
        for direction in (0, 1):
            params = {
                "axis": _AXES[k % 3],
                "direction": direction,
                "sigma": np.sqrt(variance - reached),
                "smooth_to": np.sqrt(reached),
            }
            blurred = graph.draw(
                "texture_space/blur",
                source=blurred,
                gradient_u=atlas.gradient_u,
                gradient_v=atlas.gradient_v,
                params=params,
                label=f"{variance:.3g} mm2 {'uv'[direction]}",
                **seams,
            )
        reached = float(variance)
        found.append(blurred)
    return found
