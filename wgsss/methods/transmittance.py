"""jimenez15's translucency: transmittance by thickness (Jimenez et al. 2010, Real-Time Realistic Skin Translucency).

At a pixel, the sum over lights of T(d) E. The thickness d is the way, along the light's rays, from where they first
meet the scene to x_o, by the shadow map; E is what the back receives if it faces the other way than x_o does,

    T(d) = sum_k w_k exp(-d^2 / 2 v_k)        E = max(0.3 - n . l, 0)

times the light's irradiance and rho_dt. T is the integral of the profile over a plane at distance d: that sum where the
material is one of Gaussians, and of any other profile the integral itself, with no fit. The exponent is that of
Gaussians of variance v, in mm^2; the shader that is widely copied has exp(-d^2 / v) and a scale set by eye. As in the
paper, surface diffusion in screen space blurs the sum as if it had entered at the pixels; beside another surface it
stays sharp.

Rays are taken below x_o, the shrinking of the paper: by as much as half of the light travels in the medium where they
graze the surface, and by nothing where they come straight through. Else light that enters next to x_o, where E is not 0
yet, would pass for light from behind, and add a bright seam to what is thick (the RMSE of a ball is 1.3 % with it, 13 %
without). It also takes off some of what slanting rays are longer than the medium is thick, which is what counts for T.

All that is known of the back is a depth for each ray. What lies in front of an object counts as a part of it, and so
does the air between: farther than the profile reaches it keeps the light off, as its shadow does; what nearly touches
lets through what as much of the medium would. Of area lights each part that casts a shadow is a light. The environment
has no depth map and does not shine through.
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

_FAINTEST = 1e-5  # share of the profile's total that may go through more than the table ends at
_ENTRIES = 512


@dataclass(frozen=True)
class Transmittance:
    """M_back by the thickness that shadow maps tell of."""

    source: ClassVar[str] = "Jimenez et al. 2010, Real-Time Realistic Skin Translucency"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()
    beside: ClassVar[type] = object

    def bake(self, stage: Stage) -> None:
        """The table of T of each material."""
        for body in stage.bodies:
            self.table(body)

    def table(self, body: Body) -> tuple[dict[str, float], Buffer]:
        """What a body's material lets through: its lengths, by the names of the shader's parameters, and a buffer."""

        def make() -> tuple[dict[str, float], Buffer]:
            profile = body.material.profile
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
        """One blur in screen space of what enters and what arrives from behind is M_front + M_back of two."""
        arriving = self.arriving(frame)
        if arriving is None or not isinstance(surface, ScreenSpace):
            return None
        return surface.diffuse(frame, irradiance_pixels(frame), arriving)

    def arriving(self, frame: Frame) -> Handle | None:
        """What arrives at the pixels from behind, W/m^2, as a share of the profile's total."""
        if not frame.lighting.views:
            return None  # the sky alone
        return frame.once("arriving", lambda: self._arriving(frame))

    def _arriving(self, frame: Frame) -> Handle:
        def values(body: Body) -> Bindings:
            lengths, through = self.table(body)
            return {"params": lengths, "through": through}

        return frame.per_object("transmittance/transmit", values)


def table(profile: Profile) -> tuple[Array, Array]:
    """T over the profile's total (n, 3) at thicknesses (n,), mm, whose square roots are equally spaced from 0; the last
    is 0.

    A ring of the plane at distance d is farther from x_o by sqrt(r^2 + d^2): the integral over the plane is what leaves
    farther than d from where light enters.
    """
    reach = float(profile.range(_FAINTEST).max()) or 1.0
    thickness = root_spaced(reach, _ENTRIES)
    through = profile.beyond(thickness)
    through[-1] = 0.0
    return thickness, through
