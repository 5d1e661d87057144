"""Lambert: light leaves where it enters. Every diffusion profile tends to this as its width goes to zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from wgsss.frame import Frame, irradiance_pixels
from wgsss.graph import Handle
from wgsss.methods.method import Diffused
from wgsss.stage import Stage


@dataclass(frozen=True)
class Lambert:
    """M_front is the profile's total reflectance times L_d; it contains the light of M_back."""

    source: ClassVar[str] = "the limit of a profile without width"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({},)

    def bake(self, stage: Stage) -> None:
        """Do nothing: there is nothing to precompute."""

    def passes(self, frame: Frame) -> Diffused:
        return Diffused(M_front=reflect(frame, irradiance_pixels(frame)))


def reflect(frame: Frame, irradiance: Handle, label: str = "") -> Handle:
    """Return M, W/m^2, where light leaves at the pixel at which it enters as `irradiance`."""
    return frame.per_object(
        "lambert/reflect", lambda body: {"total": body.profile.total}, label=label, irradiance=irradiance
    )
