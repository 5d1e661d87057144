"""One frame: the g-buffer, the lights, and the passes that all methods share."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.environment import rho_dt_table
from wgsss.bake.samples import Samples
from wgsss.emitters import LightValue, ShadowViewValue, emitters, irradiance_of
from wgsss.gpu import Buffer, Texture
from wgsss.graph import Bindings, Graph, Handle, Outputs, Value
from wgsss.scene.scene import TONE_MAPS
from wgsss.stage import Body, Stage
from wgsss.view import View, rectangle, view_of

T = TypeVar("T")

BLOOM_SIGMA = 1.0 / 64.0
"""The standard deviation of bloom, as a share of the image's height."""


@dataclass(frozen=True)
class GBuffer:
    """What each pixel shows, as wgsl/frame/gbuffer.wgsl writes it; 0 in the background."""

    gbuffer_id: Handle
    """rgba32float: atlas u and v, object id, share of the environment's irradiance that the scene lets through"""
    normal: Handle
    """rgba16float: shading normal in world space, scale of the specular lobe"""
    base_color: Handle
    """rgba8unorm-srgb: base colour of map and vertices, without the material's factor"""
    depth: Handle
    """depth32float: in clip space, 1 in the background"""


@dataclass
class Lighting:
    """The lights of a frame but for environments, and their shadows."""

    lights: list[LightValue]
    views: list[ShadowViewValue]
    """of the lights, for their shadow maps"""
    shadow_maps: Handle | Texture
    """depth32float, one layer for each view"""
    unit: float
    """W/m^2: a power of two near the scene's irradiance. Half floats hold irradiance in this unit."""


@dataclass(frozen=True)
class Frame:
    """What the methods' passes draw with: the stage, the view, the g-buffer and the lights."""

    graph: Graph
    stage: Stage
    size: tuple[int, int]
    """width and height, pixels"""
    view: View
    gbuffer: GBuffer
    lighting: Lighting
    rho_dt: Mapping[tuple[float, float], Handle]
    """tables of rho_dt by roughness and refractive index"""
    shared: dict[Hashable, Any] = field(default_factory=dict)

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what `make` returned the first time that it was called for this key in this frame."""
        if key not in self.shared:
            self.shared[key] = make()
        value: T = self.shared[key]
        return value

    def per_object(
        self,
        module: str,
        values: Callable[[Body], Mapping[str, Value]] | None = None,
        *,
        bodies: Iterable[Body] | None = None,
        label: str = "",
        constants: Mapping[str, float] | None = None,
        **bindings: Value,
    ) -> Handle:
        """Declare one pass of `wgsl/<module>.wgsl` for each body, all onto one new target, and return the target.

        Args:
            module: imports `wgsl/per_object.wgsl`, and has one output.
            values: returns the values of bindings that differ from body to body.
            bodies: at least one; by default all of the stage.
            label, constants: as of `Graph.draw_outputs`.
            bindings: values of the other bindings. Those of `Frame.bindings` need not be given.
        """
        target: Handle | None = None
        for body in self.stage.bodies if bodies is None else bodies:
            given: Bindings = {**bindings, **({} if values is None else values(body))}
            target = self.draw_object(module, body, into=target, label=label, constants=constants, **given)
        assert target is not None, "a pass for each object needs an object"
        return target

    def draw_object(
        self,
        module: str,
        body: Body,
        *,
        into: Handle | None = None,
        label: str = "",
        constants: Mapping[str, float] | None = None,
        **bindings: Value,
    ) -> Handle:
        """Declare a pass over the pixels of one body, as `per_object` does, and return the target."""
        return self.graph.draw(
            module,
            size=self.size,
            count=6,
            into=into,
            label=label,
            constants=constants,
            **{**self.bindings(module, body), **bindings},
        )

    def bindings(self, module: str, body: Body) -> Bindings:
        """Return those bindings of a module that the frame knows: the object and its maps, the g-buffer, the lights."""

        def known() -> Bindings:
            return {
                "view": {
                    "clip_to_world": self.view.clip_to_world,
                    "eye": self.view.eye,
                    "rectangle": rectangle(self.view, self.stage.scene.objects[body.index], self.size),
                },
                "object": body.object_uniforms,
                **body.maps.bindings,
                **self.gbuffer_bindings("gbuffer_id", "normal", "base_color", "depth"),
                **self.light_bindings(body),
            }

        values = self.once(("bindings", body), known)
        return {name: values[name] for name in wgsl.load(module).used if name in values}

    def gbuffer_bindings(self, *names: str) -> Bindings:
        """Return parts of the g-buffer by binding name."""
        return {name: getattr(self.gbuffer, name) for name in names}

    def rho_dt_table(self, body: Body) -> Handle:
        """Return the table of rho_dt of a body's surface."""
        return self.rho_dt[body.material.roughness, body.material.eta]

    def light_bindings(self, body: Body) -> Bindings:
        """Return the bindings of wgsl/lights.wgsl for a body."""
        return {
            "lights": self.lighting.lights,
            "views": self.lighting.views,
            "shadow_maps": self.lighting.shadow_maps,
            "rho_dt_table": self.rho_dt_table(body),
            "environment": body.environment.irradiance,
        }


def begin(graph: Graph, stage: Stage, size: tuple[int, int], lighting: Lighting | None = None) -> Frame:
    """Declare g-buffer, shadow maps and tables of a frame of `size` (width, height) pixels.

    `lighting` may be that of an earlier frame, where nothing has moved since and its shadow maps persist as a texture.
    """
    view = view_of(stage.scene, size[0] / size[1])
    gbuffer = _gbuffer(graph, stage, size, view)
    tables: dict[tuple[float, float], Handle] = {}
    for body in stage.bodies:
        key = (body.material.roughness, body.material.eta)
        if key not in tables:
            tables[key] = rho_dt_table(graph, body.material)
    return Frame(graph, stage, size, view, gbuffer, lighting or _lighting(graph, stage), tables)


def _gbuffer(graph: Graph, stage: Stage, size: tuple[int, int], view: View) -> GBuffer:
    drawn: Outputs | None = None
    for body in stage.bodies:
        targets = {} if drawn is None else {name: drawn[name] for name in ("gbuffer_id", "normal", "base_color")}
        drawn = graph.draw_outputs(
            "frame/gbuffer",
            size=size,
            indices=body.indices,
            depth_buffer="new" if drawn is None else drawn.depth,
            into=targets,
            params={"world_to_clip": view.world_to_clip, "eye": view.eye},
            object=body.object_uniforms,
            vertices=body.vertices,
            colors=body.colors,
            **body.maps.bindings,
        )
    assert drawn is not None, "a scene has an object"
    return GBuffer(**drawn)


def _lighting(graph: Graph, stage: Stage) -> Lighting:
    """Declare the shadow maps of the lights that cast shadows."""
    points = np.concatenate([o.mesh.positions @ o.matrix[:3, :3].T + o.matrix[:3, 3] for o in stage.scene.objects])
    emitted = emitters(stage.lights, points)
    side = emitted.shadow_size
    maps = graph.texture("shadow_maps", (side, side, len(emitted.views)), "depth32float")
    for layer, view in enumerate(emitted.views):
        for body in stage.bodies:
            maps = graph.draw(
                "frame/shadow",
                size=(side, side),
                indices=body.indices,
                depth_buffer=maps,
                layer=layer,
                params={"object_to_clip": view["world_to_clip"] @ body.rest.matrix},
                vertices=body.vertices,
                label=str(layer),
            )
    brightness = irradiance_of(emitted, points) + math.pi * stage.sky
    unit = 2.0 ** round(math.log2(brightness)) if brightness > 0 else 1.0
    return Lighting(emitted.lights, emitted.views, maps if emitted.views else stage.gpu.no_depth, unit)


def irradiance_pixels(frame: Frame) -> Handle:
    """Return L_d at each pixel, W/m^2."""
    return frame.once("irradiance", lambda: frame.per_object("frame/irradiance_pixels"))


def irradiance_texels(
    frame: Frame,
    body: Body,
    map_size: int,
    *,
    least_cosines: Buffer | None = None,
    planes: npt.NDArray[Any] | None = None,
) -> Handle:
    """Return L_d over a body's atlas, in `lighting.unit`, times the share of the base colour applied before diffusion.

    Texels that are left out are empty, with an alpha of 0.

    Args:
        least_cosines: buffer of f32, one for each render vertex or one for all: texels are left out where the cosine
            of the angle between normal and viewer is smaller.
        planes: (6, 4), in world space, mm: texels at x are left out where dot(plane, (x, 1)) < 0 for any of them.
    """
    module = "frame/irradiance_texels"
    return frame.graph.draw(
        module,
        size=(map_size, map_size),
        indices=body.indices,
        params={
            "unit": frame.lighting.unit,
            "eye": frame.view.eye,
            "planes": np.zeros((6, 4)) if planes is None else planes,
        },
        vertices=body.vertices,
        colors=body.colors,
        least_cosines=np.array([-2.0], np.float32) if least_cosines is None else least_cosines,
        **frame.bindings(module, body),
    )


def irradiance_points(frame: Frame, body: Body, points: Buffer, count: int, samples: Samples | None = None) -> Handle:
    """Return a buffer of vec4f with L_d, W/m^2, at `count` points on a body, times the share of the base colour applied
    before diffusion. `points` is a buffer of array<Vertex>: `body.vertices`, or `body.points` of `samples`."""
    module = "frame/irradiance_points"
    return frame.graph.dispatch(
        module,
        size=count,
        points=points,
        colors=body.colors if samples is None else body.colors_at(samples),
        **frame.bindings(module, body),
    )


def specular(frame: Frame) -> Handle | None:
    """Return the radiance reflected at the surface, W/(m^2 sr); None where no material reflects."""
    bodies = [body for body in frame.stage.bodies if body.material.specular > 0.0]

    def values(body: Body) -> Bindings:
        lobe = {"alpha": body.material.roughness**2, "eta": body.material.eta}
        return {"params": lobe, "reflection": body.environment.reflection}

    return frame.once("specular", lambda: frame.per_object("frame/specular", values, bodies=bodies) if bodies else None)


def composite(frame: Frame, M_front: Handle, M_back: Handle | None, reflected: Handle | None) -> Handle:
    """Return the radiance towards the viewer, with coverage in alpha (Maisch & Ropinski 2017, eq. 5)."""
    black = frame.stage.gpu.black
    return frame.per_object("frame/composite", M_front=M_front, M_back=M_back or black, specular=reflected or black)


def bloom(graph: Graph, radiance: Handle, strength: float) -> Handle:
    """Return the radiance with the share `strength` of it spread over the surrounding pixels by a Gaussian."""
    if strength == 0.0:
        return radiance
    sigma = BLOOM_SIGMA * radiance.size[1]
    weights = np.exp(-0.5 * (np.arange(math.ceil(3.0 * sigma) + 1) / sigma) ** 2)
    weights /= weights[0] + 2.0 * weights[1:].sum()
    spread = radiance
    for direction in (0, 1):
        spread = graph.draw(
            "frame/bloom",
            label="xy"[direction],
            constants={"DIRECTION": direction},
            params={"strength": strength},
            radiance=radiance,
            spread=spread,
            weights=weights.astype(np.float32),
        )
    return spread


def tone_map(graph: Graph, radiance: Handle, exposure: float, curve: str) -> Handle:
    """Return the image for a display, sRGB in 8 bits. `exposure` is in stops, `curve` one of TONE_MAPS."""
    params = {"scale": 2.0**exposure, "curve": TONE_MAPS.index(curve)}
    return graph.draw("frame/tone_map", params=params, radiance=radiance)
