"""The translucency method of deon07: modified translucent shadow maps (d'Eon & Luebke 2007, 14.5.7; Mikkelsen 2009,
3.4).

For each light, a map stores where its rays first hit an object: position, atlas coordinates and normal. A pixel looks
up the point x_i at which light enters that would arrive at it on a straight line. M_back is the sum of the irradiance
at x_i, blurred with each Gaussian by the surface method:

    M_back = sum_k w_k exp(-d^2 / 2 v_k) (G(v_k) * L_d)(x_i)

The distance d is that from x_i to x_o times the cosine at x_i: the light at x_o is taken to be that at the point
directly below x_i (Mikkelsen 2009, figure 10), which holds on a level surface. As d'Eon & Luebke do, this method
corrects the distance only as far as the normals at x_i and x_o are opposed; otherwise light that grazes a ball would
fill its dark half. Where x_i and x_o are close on the surface, M_front contains this light already, and M_back is faded
out.

Away from the edges of a slab the formula is as accurate as the Gaussians fit the profile. For marble it is within 0.1 %
of the integral over the surface at a thickness of 2 mm. At 8 mm, where 9, 5 and 2 % of the diffused light comes
through, the error is -4, +7 and +14 % in red, green and blue; at 16 mm it is -78, -60 and -23 %, since the tail of a
dipole decays more slowly than any Gaussian.

Light that has entered from one source must not be found along the rays of another. With several lights, each has
blurred maps of its own. A single light shares those of the surface method, and the light of the environment shines
through along with it; beside several lights the environment does not shine through. Area lights are seen from their
centres. Other objects cast shadows that no light passes; the air between two parts of an object counts as part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from wgsss.bake.environment import NO_SKY, prefilter
from wgsss.emitters import LightValue, ShadowViewValue, emitters
from wgsss.frame import Frame
from wgsss.graph import Handle, Outputs
from wgsss.methods.method import Method
from wgsss.methods.texture_space import SLOTS, TextureSpace, by_slot
from wgsss.scene import DirectionalLight, EnvironmentLight, PointLight, RectLight, SphereLight
from wgsss.stage import Body, Stage

Source = DirectionalLight | PointLight | RectLight | SphereLight

SIDE = {1: 1024, 6: 512}
"""the size of a light's maps, texels, by the number of its views"""


@dataclass(frozen=True)
class TranslucentShadowMaps:
    """M_back by the blurred irradiance where each light enters, and the distance from there."""

    source: ClassVar[str] = "d'Eon & Luebke 2007, GPU Gems 3, chapter 14; Mikkelsen 2009, section 3.4"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()
    beside: ClassVar[type] = TextureSpace

    def bake(self, stage: Stage) -> None:
        """Do nothing: the surface method bakes what the maps need."""

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        assert isinstance(surface, TextureSpace)
        lights = list(_lights(frame))
        M_back = None
        for light, emitted in lights:
            M_back = _through(frame, surface, light, emitted if len(lights) > 1 else None, M_back)
        return M_back


def _lights(frame: Frame) -> Iterator[tuple[Source, list[LightValue]]]:
    """Yield the lights that are not black, but for environments, each with its part of `lighting.lights`."""
    first = 0
    for light in frame.stage.lights:
        if isinstance(light, EnvironmentLight):
            continue
        emitted = frame.lighting.lights[first : first + getattr(light, "samples", 1)]
        first += len(emitted)
        if np.any(emitted[0]["power"]):
            yield light, emitted


def _through(
    frame: Frame, surface: TextureSpace, light: Source, own: list[LightValue] | None, so_far: Handle | None
) -> Handle:
    """Return M_back by one light, added to that of the lights before, `so_far`. Its maps are those of the irradiance by
    its `own` emitters alone or, where that is None, the surface's."""
    stage = frame.stage
    lit = frame if own is None else _lit_by(frame, own)
    M_back: Handle | None = None
    for body in stage.bodies:
        blurred = surface.blurs(lit, body if own is None else _without_sky(body))
        profile = surface.profile(body)
        gaussians = np.zeros((SLOTS, 4))
        gaussians[:, 3] = 1.0
        gaussians[: len(blurred), :3] = profile.weights * frame.lighting.unit
        gaussians[: len(blurred), 3] = profile.variances
        towards, views = _views_of(light, body)
        hit = _first_hit(frame, body, views)
        M_back = frame.draw_object(
            "translucent_shadow_maps/transmit",
            body,
            into=M_back,
            constants={"VIEWS": len(views)},
            params={"light": towards, "gaussians": gaussians},
            views=views,
            entry=hit.x_i,
            entry_normal=hit.n_i,
            entry_atlas=hit.atlas,
            so_far=so_far or stage.gpu.black,
            **by_slot(blurred),
        )
    assert M_back is not None, "a stage has a body"
    return M_back


def _views_of(light: Source, body: Body) -> tuple[tuple[float, ...], list[ShadowViewValue]]:
    """Return where a light is (xyz, 1) or the direction towards it (xyz, 0), and its shadow views of a body."""
    points = body.stage.scene.objects[body.index].placed
    if isinstance(light, DirectionalLight):
        return (*np.negative(light.direction), 0.0), emitters([light], points).views
    centre = PointLight(light.position, (1.0, 1.0, 1.0))
    return (*light.position, 1.0), emitters([centre], points).views


def _first_hit(frame: Frame, body: Body, views: list[ShadowViewValue]) -> Outputs:
    """Draw where the rays of each view first hit a body: the outputs of `first_hit.wgsl`, one layer for each view."""
    side, layers = SIDE[len(views)], len(views)
    formats = {"x_i": "rgba32float", "n_i": "rgba16float", "atlas": "rg32float", "depth": "depth32float"}
    hit = Outputs({name: frame.graph.texture(name, (side, side, layers), kind) for name, kind in formats.items()})
    for layer, view in enumerate(views):
        hit = frame.graph.draw_outputs(
            "translucent_shadow_maps/first_hit",
            size=(side, side),
            indices=body.indices,
            into=hit,
            depth_buffer=hit.depth,
            layer=layer,
            params={"world_to_clip": view["world_to_clip"]},
            object=body.object_uniforms,
            vertices=body.vertices,
        )
    return hit


def _lit_by(frame: Frame, emitted: list[LightValue]) -> Frame:
    """Return the frame lit by these emitters alone."""
    return replace(frame, lighting=replace(frame.lighting, lights=emitted), shared={})


def _without_sky(body: Body) -> Body:
    """Return the body without light from environments."""
    dark = copy(body)
    dark.environment = body.stage.shared("no sky", lambda: prefilter(body.stage.gpu, NO_SKY, body.material))
    return dark
