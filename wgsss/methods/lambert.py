"""Lambert: light leaves where it entered. What every diffusion profile tends to as its width goes to zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from wgsss import frame as shared
from wgsss.frame import Frame
from wgsss.methods.method import Diffused
from wgsss.stage import Stage


@dataclass(frozen=True)
class Lambert:
    """M_front = R_d L_d, R_d being the profile's total reflectance; M_back is part of it."""

    source: ClassVar[str] = "the limit of a profile without width"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({},)

    def bake(self, stage: Stage) -> None:
        """Nothing."""

    def passes(self, frame: Frame) -> Diffused:
        irradiance = shared.irradiance_pixels(frame)
        M_front: Any = None
        for body in frame.stage.bodies:
            M_front = frame.graph.draw(
                "lambert/reflect",
                into=M_front,
                size=frame.size,
                count=6,
                params={"total": body.material.profile.total, "rectangle": shared.rectangle(frame, body)},
                object=body.object_uniforms,
                irradiance=irradiance,
                **frame.gbuffer_bindings("gbuffer_id", "base_color"),
            )
        return Diffused(M_front)
