"""The translucency method of jimenez15: transmittance by thickness (Jimenez et al. 2010, Real-Time Realistic Skin
Translucency).

At a pixel, M_back is proportional to the sum over lights of T(d) E. The thickness d is the distance along the light's
rays from where they first hit the scene, according to the shadow map, to x_o. E is the irradiance of the back, which is
taken to have the normal -n:

    T(d) = sum_k w_k exp(-d^2 / 2 v_k)        E = max(0.3 - n . l, 0)

times the light's irradiance and rho_dt. T is the integral of the profile over a plane at distance d. For a profile that
is a sum of Gaussians this is the sum above; for all others it is the integral itself, without a fit. The exponent is
that of Gaussians of variance v in mm^2; the shader that is widely copied has exp(-d^2 / v) and a scale chosen by eye.
As in the paper, surface diffusion in screen space blurs the sum as if this light entered at the pixels. Beside other
surface methods it is not blurred.

As in the paper, x_o is moved below the surface ("shrinking"): by the distance within which half of the light leaves
where the light grazes the surface, and not at all where it passes straight through. Otherwise light that enters next to
x_o, where E is not yet 0, would count as light from behind, and a bright seam would appear on thick objects: the RMSE
of a ball is 1.3 % with shrinking and 13 % without. It also shortens slanted rays, which are longer than the medium is
thick; T depends on the thickness.

The shadow map is all that is known of the back. Objects in front of an object count as parts of it, and so does the air
between them: an object farther away than the profile reaches blocks the light, as its shadow does; one that nearly
touches transmits as much as the same thickness of the medium. Each sample of an area light is a light of its own. The
environment has no shadow map and does not shine through.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from wgsss import wgsl
from wgsss.frame import Frame, irradiance_pixels
from wgsss.gpu import Buffer
from wgsss.graph import Bindings, Handle
from wgsss.methods.lambert import reflect
from wgsss.methods.method import Method
from wgsss.methods.screen_space import ScreenSpace
from wgsss.optics import Profile
from wgsss.optics.lookup import root_spaced
from wgsss.stage import Body, Stage

Array = NDArray[np.float64]

_FAINTEST = 1e-5  # share of the total reflectance that may pass through more than the table's last thickness
_ENTRIES = 512  # of the table


@dataclass(frozen=True)
class Transmittance:
    """M_back by the thickness according to the shadow maps."""

    source: ClassVar[str] = "Jimenez et al. 2010, Real-Time Realistic Skin Translucency"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()
    beside: ClassVar[type] = object

    def bake(self, stage: Stage) -> None:
        """Compute the table of T of each material."""
        for body in stage.bodies:
            self.table(body)

    def table(self, body: Body) -> tuple[dict[str, float], Buffer]:
        """Return the lengths of a body's material, by the names of the shader's parameters, and a buffer with T."""

        def make() -> tuple[dict[str, float], Buffer]:
            profile = body.profile
            thickness, through = table(profile)
            packed = wgsl.load("transmittance/transmit").layout("array<vec3f>").pack(through)
            lengths = {"reach": float(thickness[-1]), "shrink": float(profile.range(0.5).max())}
            return lengths, body.stage.gpu.buffer(packed)

        return body.stage.shared(("transmittance", id(body.material)), make)

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        arriving = self.arriving(frame)
        if arriving is None:
            return None
        if isinstance(surface, ScreenSpace):
            return surface.diffuse(frame, arriving)
        return reflect(frame, arriving, label="back")

    def M(self, frame: Frame, surface: Method) -> Handle | None:
        """Return M_front + M_back beside ScreenSpace: one blur of the sum of both irradiances instead of two blurs."""
        arriving = self.arriving(frame)
        if arriving is None or not isinstance(surface, ScreenSpace):
            return None
        return surface.diffuse(frame, irradiance_pixels(frame), arriving)

    def arriving(self, frame: Frame) -> Handle | None:
        """Return the light that arrives at the pixels from behind divided by the total reflectance, W/m^2; None where
        only environments shine."""
        if not frame.lighting.views:
            return None
        return frame.once("arriving", lambda: self._arriving(frame))

    def _arriving(self, frame: Frame) -> Handle:
        def values(body: Body) -> Bindings:
            lengths, through = self.table(body)
            return {"params": lengths, "through": through}

        return frame.per_object("transmittance/transmit", values)


def table(profile: Profile) -> tuple[Array, Array]:
    """Return thicknesses (n,), mm, whose square roots are equally spaced from 0, and T (n, 3) there, divided by the
    total reflectance. The last T is 0.

    A ring of radius r on the plane at distance d has the distance sqrt(r^2 + d^2) from x_o. The integral of the profile
    over the plane is therefore the light that leaves farther than d from where it enters.
    """
    reach = float(profile.range(_FAINTEST).max()) or 1.0
    thickness = root_spaced(reach, _ENTRIES)
    through = profile.beyond(thickness)
    through[-1] = 0.0
    return thickness, through
