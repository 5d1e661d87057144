"""deon07's translucency: modified translucent shadow maps (d'Eon & Luebke 2007, 14.5.7; Mikkelsen 2009, 3.4).

From each light a map is drawn of where its rays first meet an object: the place, its coordinates in the atlas, and the
normal there. In it a pixel finds the point x_i where light enters that would come straight through to it. The surface's
irradiance, blurred by each Gaussian, is read at x_i and summed up:

    M_back = sum_k w_k exp(-d^2 / 2 v_k) (G(v_k) * L_d)(x_i)

The way d is the distance from x_i to x_o times the cosine at x_i: what leaves x_o is taken to be what leaves the point
below x_i (Mikkelsen 2009, figure 10). That holds where the surface is level. d'Eon and Luebke correct the distance as
far as the normals at x_i and x_o oppose each other, and so does this: else light that grazes a ball fills its dark
half. Where x_i and x_o are near each other on the surface, M_front has that light already, and M_back is faded out.

Away from the edges of a slab the formula is as far from the integral over the surface as the Gaussians are from the
profile. For marble it is within 0.1 % at 2 mm; at 8 mm, where 9, 5 and 2 % of what diffuses comes through, by -4, +7
and +14 % in red, green and blue; at 16 mm by -78, -60 and -23 %, since a dipole's tail outlasts any Gaussian.

What has entered from one light must not be found along another: where there are several, each has blurred maps of its
own. A single light shares the surface's, and what has entered from the sky shines through along with it; beside several
lights the sky does not shine through. Area lights are seen from their centre. Other objects cast shadows, through which
no light comes; the air between two parts of an object counts as a part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from wgsss.bake.environment import NO_SKY, prefilter
from wgsss.emitters import emitters
from wgsss.frame import Frame, rectangle
from wgsss.graph import Handle
from wgsss.methods.method import Method
from wgsss.methods.texture_space import SLOTS, TextureSpace, by_slot
from wgsss.scene import DirectionalLight, EnvironmentLight, PointLight, RectLight, SphereLight
from wgsss.stage import Body, Stage

Source = DirectionalLight | PointLight | RectLight | SphereLight

SIDE = {1: 1024, 6: 512}
"""of a map, texels, by how many views a light has"""


@dataclass(frozen=True)
class TranslucentShadowMaps:
    """M_back by the blurred irradiance where each light enters, and the way from there."""

    source: ClassVar[str] = "d'Eon & Luebke 2007, GPU Gems 3, chapter 14; Mikkelsen 2009, section 3.4"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()
    beside: ClassVar[type] = TextureSpace

    def bake(self, stage: Stage) -> None:
        """Nothing: what the maps need is the surface's."""

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        assert isinstance(surface, TextureSpace)
        found = list(_lights(frame))
        M_back = None
        for light, emitted in found:
            M_back = _through(frame, surface, light, emitted if len(found) > 1 else None, M_back)
        return M_back


def _lights(frame: Frame) -> Iterator[tuple[Source, list[dict[str, Any]]]]:
    """The lights that are not dark, but for the sky, each with its share of `lighting.lights`."""
    first = 0
    for light in frame.stage.lights:
        if isinstance(light, EnvironmentLight):
            continue
        emitted = frame.lighting.lights[first : first + getattr(light, "samples", 1)]
        first += len(emitted)
        if np.any(emitted[0]["power"]):
            yield light, emitted


def _through(
    frame: Frame, surface: TextureSpace, light: Source, own: list[dict[str, Any]] | None, so_far: Handle | None
) -> Handle:
    """M_back by a light, added to what there is `so_far`. It has maps of what its `own` emitters give, if not the
    surface's."""
    stage = frame.stage
    alone = frame if own is None else _lit_by(frame, own)
    M_back: Any = None
    for body in stage.bodies:
        blurred = surface.blurs(alone, body if own is None else _without_sky(body))
        profile = surface.profile(body)
        gaussians = np.zeros((SLOTS, 4))
        gaussians[:, 3] = 1.0
        gaussians[: len(blurred), :3] = profile.weights * frame.lighting.unit
        gaussians[: len(blurred), 3] = profile.variances
        seen = _seen_from(light, body)
        where = _first_hit(frame, body, seen.views)
        M_back = frame.graph.draw(
            "translucent_shadow_maps/transmit",
            into=M_back,
            size=frame.size,
            count=6,
            constants={"VIEWS": len(seen.views)},
            params={
                "clip_to_world": frame.view.clip_to_world,
                "light": seen.light,
                "rectangle": rectangle(frame, body),
                "gaussians": gaussians,
            },
            object=body.object_uniforms,
            views=seen.views,
            entry=where.x_i,
            entry_normal=where.n_i,
            entry_atlas=where.atlas,
            so_far=so_far or stage.gpu.black,
            **by_slot(blurred),
            **frame.gbuffer_bindings("gbuffer_id", "normal", "base_color", "depth"),
        )
    return M_back


def _seen_from(light: Source, body: Body) -> SimpleNamespace:
    """`views` of a body, as shadows have them; `light`: xyz, 1 where they are from, or xyz, 0 the direction there."""
    points = body.stage.scene.objects[body.index].placed
    if isinstance(light, DirectionalLight):
        return SimpleNamespace(views=emitters([light], points).views, light=(*np.negative(light.direction), 0.0))
    centre = PointLight(light.position, (1.0, 1.0, 1.0))
    return SimpleNamespace(views=emitters([centre], points).views, light=(*light.position, 1.0))


def _first_hit(frame: Frame, body: Body, views: list[dict[str, Any]]) -> SimpleNamespace:
    """Draw where the rays of each view first hit a body: the outputs of `first_hit.wgsl`, one layer for each view."""
    side, layers = SIDE[len(views)], len(views)
    formats = {"x_i": "rgba32float", "n_i": "rgba16float", "atlas": "rg32float", "depth": "depth32float"}
    made = {name: frame.graph.texture(name, (side, side, layers), kind) for name, kind in formats.items()}
    for layer, view in enumerate(views):
        depth = made.pop("depth")
        drawn = frame.graph.draw(
            "translucent_shadow_maps/first_hit",
            size=(side, side),
            indices=body.indices,
            into=made,
            depth_buffer=depth,
            layer=layer,
            params={"world_to_clip": view["world_to_clip"]},
            object=body.object_uniforms,
            vertices=body.vertices,
        )
        made = vars(drawn)
    return SimpleNamespace(**made)


def _lit_by(frame: Frame, emitted: list[dict[str, Any]]) -> Frame:
    """The frame under these emitters alone."""
    return replace(frame, lighting=SimpleNamespace(**{**vars(frame.lighting), "lights": emitted}), made={})


def _without_sky(body: Body) -> Body:
    """The body where there is no environment."""
    dark = copy(body)
    dark.environment = body.stage.shared("no sky", lambda: prefilter(body.stage.gpu, NO_SKY, body.material))
    return dark
