"""The passes that all methods share, as functions of the graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.environment import rho_dt_table
from wgsss.bake.samples import Samples
from wgsss.emitters import emitters, irradiance_of
from wgsss.graph import Graph, Handle
from wgsss.scene import OrthographicCamera, Scene
from wgsss.scene.scene import TONE_MAPS
from wgsss.stage import Body, Stage

Matrix = npt.NDArray[Any]

NEAREST, CLOSEST = 1e-3, 1e-6
"""Of the greatest depth: from where on things are drawn that the camera is inside of, and from where on any."""
BLOOM_SIGMA = 1.0 / 64.0
"""The standard deviation of bloom, of the image's height."""


@dataclass(frozen=True)
class View:
    """The camera as the shaders see it. `eye`: xyz, 1 the camera's position; xyz, 0 the direction towards it."""

    world_to_clip: Matrix
    clip_to_world: Matrix
    eye: tuple[float, float, float, float]


@dataclass(frozen=True)
class Frame:
    """What methods draw from: the stage, the view, the g-buffer and the lights.

    `gbuffer` has gbuffer_id, normal, base_color and depth; `lighting` has lights, views and shadow_maps, and `unit`: a
    power of two, W/m^2, near the scene's irradiance, in which half floats hold it.
    """

    graph: Graph
    stage: Stage
    size: tuple[int, int]
    view: View
    gbuffer: SimpleNamespace
    lighting: SimpleNamespace
    rho_dt: dict[tuple[float, float], Handle]
    made: dict[Any, Any] = field(default_factory=dict)

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What `make` declares, the first time that it is asked for by `key`."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def rho_dt_table(self, body: Body) -> Handle:
        """The table of rho_dt for a body's surface."""
        return self.rho_dt[body.material.roughness, body.material.eta]

    def light_bindings(self, body: Body) -> dict[str, Any]:
        """What every module that gathers L_d binds."""
        lighting = self.lighting
        return {
            "object": body.object_uniforms,
            "lights": lighting.lights,
            "views": lighting.views,
            "shadow_maps": lighting.shadow_maps,
            "rho_dt_table": self.rho_dt_table(body),
        }

    def gbuffer_bindings(self, *names: str) -> dict[str, Any]:
        """Parts of the g-buffer by binding name."""
        return {name: getattr(self.gbuffer, name) for name in names}


def begin(graph: Graph, stage: Stage, size: tuple[int, int], lighting: SimpleNamespace | None = None) -> Frame:
    """Declare g-buffer, shadows and tables of a frame of `size` (width, height) pixels.

    `lighting` is that of an earlier frame, with its shadow maps as a texture that persists, where nothing has moved.
    """
    view = _view(stage.scene, size)
    gbuffer = _gbuffer(graph, stage, size, view)
    tables = {}
    for body in stage.bodies:
        key = (body.material.roughness, body.material.eta)
        if key not in tables:
            tables[key] = rho_dt_table(graph, body.material)
    return Frame(graph, stage, size, view, gbuffer, lighting or _lighting(graph, stage), tables)


def rectangle(frame: Frame, body: Body) -> Matrix:
    """Left, bottom, right and top in clip space of a rectangle that a body is in, and a pixel more on each side: what
    is drawn and then discarded costs as much on CPUs as what is kept."""
    posed = frame.stage.scene.objects[body.index]
    corners = np.array(np.meshgrid(*posed.mesh.bounds.astype(np.float64).T, indexing="ij")).reshape(3, -1).T
    clip = np.column_stack([corners, np.ones(8)]) @ posed.matrix.T @ frame.view.world_to_clip.T
    if clip[:, 3].min() <= 0.0:  # the camera is beside it, or amid it
        return np.array([-1.0, -1.0, 1.0, 1.0])
    ndc, pixel = clip[:, :2] / clip[:, 3:], 2.0 / np.array(frame.size)
    return np.clip(np.concatenate([ndc.min(axis=0) - pixel, ndc.max(axis=0) + pixel]), -1.0, 1.0)


def _world_points(scene: Scene) -> npt.NDArray[np.float64]:
    return np.concatenate([o.mesh.positions @ o.matrix[:3, :3].T + o.matrix[:3, 3] for o in scene.objects])


def _view(scene: Scene, size: tuple[int, int]) -> View:
    camera = scene.camera
    corners = np.array(np.meshgrid(*scene.bounds.T, indexing="ij")).reshape(3, -1).T
    to_view = camera.view()
    depths = -(corners @ to_view[2, :3] + to_view[2, 3])
    near, far = float(depths.min()) - _margin(depths), float(depths.max()) + _margin(depths)
    orthographic = isinstance(camera, OrthographicCamera)
    if not orthographic:  # inside or in front of the scene
        far = max(far, 1e-3)
        if near < NEAREST * far:
            near = _nearest([-(o.placed @ to_view[2, :3] + to_view[2, 3]) for o in scene.objects], far)
    world_to_clip = camera.projection(size[0] / size[1], near, far) @ to_view
    towards = np.subtract(camera.eye, camera.target)
    eye = (*(towards / np.linalg.norm(towards)), 0.0) if orthographic else (*camera.eye, 1.0)
    return View(world_to_clip, np.linalg.inv(world_to_clip), eye)


def _margin(depths: Matrix) -> float:
    return 0.01 * max(float(np.ptp(depths)), 1e-3)


def _nearest(depths: Sequence[Matrix], far: float) -> float:
    """From which depth on objects are drawn whose vertices are at these depths: all that lie in front of the camera are
    drawn, but what the camera is inside of is cut off, or depths farther away would not be told apart."""
    lowest = [float(of_one.min()) - _margin(of_one) for of_one in depths if of_one.max() > 0.0]
    return max(min((low if low > 0.0 else NEAREST * far for low in lowest), default=far / 2), CLOSEST * far)


def _gbuffer(graph: Graph, stage: Stage, size: tuple[int, int], view: View) -> SimpleNamespace:
    params = {"world_to_clip": view.world_to_clip, "eye": view.eye}
    drawn: Any = None
    for body in stage.bodies:
        kept = {} if drawn is None else {n: getattr(drawn, n) for n in ("gbuffer_id", "normal", "base_color")}
        drawn = graph.draw(
            "frame/gbuffer",
            size=size,
            indices=body.indices,
            depth_buffer="new" if drawn is None else drawn.depth,
            into=kept,
            params=params,
            object=body.object_uniforms,
            vertices=body.vertices,
            colors=body.colors,
            **vars(body.maps),
        )
    return drawn


def _lighting(graph: Graph, stage: Stage) -> SimpleNamespace:
    """Lights and the shadow maps of those that cast shadows."""
    points = _world_points(stage.scene)
    found = emitters(stage.lights, points)
    side = found.shadow_size
    if found.views:
        maps: Any = graph.texture("shadow_maps", (side, side, len(found.views)), "depth32float")
        for layer, shadow_view in enumerate(found.views):
            for body in stage.bodies:
                to_clip = shadow_view["world_to_clip"] @ body.rest.matrix
                maps = graph.draw(
                    "frame/shadow",
                    size=(side, side),
                    indices=body.indices,
                    depth_buffer=maps,
                    layer=layer,
                    params={"object_to_clip": to_clip},
                    vertices=body.vertices,
                    label=str(layer),
                )
    else:
        maps = stage.gpu.no_depth
    brightness = irradiance_of(found, points) + math.pi * stage.sky
    unit = 2.0 ** round(math.log2(brightness)) if brightness > 0 else 1.0
    return SimpleNamespace(lights=found.lights, views=found.views, shadow_maps=maps, unit=unit)


def irradiance_pixels(frame: Frame) -> Handle:
    """L_d, W/m^2, at each pixel."""
    return frame.once("irradiance", lambda: _irradiance_pixels(frame))


def _irradiance_pixels(frame: Frame) -> Handle:
    irradiance: Any = None
    for body in frame.stage.bodies:
        irradiance = frame.graph.draw(
            "frame/irradiance_pixels",
            into=irradiance,
            size=frame.size,
            count=6,
            params={"clip_to_world": frame.view.clip_to_world, "rectangle": rectangle(frame, body)},
            environment=body.environment.irradiance,
            **frame.gbuffer_bindings("gbuffer_id", "normal", "depth"),
            **frame.light_bindings(body),
        )
    return irradiance


def irradiance_texels(
    frame: Frame, body: Body, map_size: int, *, least_cosines: Any = None, planes: Matrix | None = None
) -> Handle:
    """L_d over a body's atlas, in `lighting.unit`, times the base colour's share that is applied before diffusion.

    Texels are left empty, with an alpha of 0, where the angle between normal and viewer has a cosine below that of
    `least_cosines`, a buffer with one for each render vertex or one for all; and behind any of six `planes` (6, 4):
    where dot(plane, (x, 1)) < 0, x in world space, mm.
    """
    return frame.graph.draw(
        "frame/irradiance_texels",
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
        environment=body.environment.irradiance,
        **vars(body.maps),
        **frame.light_bindings(body),
    )


def irradiance_points(frame: Frame, body: Body, points: Any, count: int, samples: Samples | None = None) -> Handle:
    """L_d, W/m^2, at `count` points on a body, times the base colour's share that is applied before diffusion.

    `points`: a buffer of array<Vertex>: `body.vertices`, or `body.points` of `samples`. Gives a buffer of vec4f.
    """
    maps = vars(body.maps)
    return frame.graph.dispatch(
        "frame/irradiance_points",
        size=count,
        points=points,
        colors=body.colors if samples is None else body.colors_at(samples),
        environment=body.environment.irradiance,
        base_color_map=maps["base_color_map"],
        specular_map=maps["specular_map"],
        **frame.light_bindings(body),
    )


def specular(frame: Frame) -> Handle | None:
    """Radiance reflected at the surface, W/(m^2 sr); None where no material reflects any."""
    return frame.once("specular", lambda: _specular(frame))


def _specular(frame: Frame) -> Handle | None:
    reflected: Any = None
    for body in (body for body in frame.stage.bodies if body.material.specular > 0.0):
        params = {
            "clip_to_world": frame.view.clip_to_world,
            "eye": frame.view.eye,
            "rectangle": rectangle(frame, body),
            "alpha": body.material.roughness**2,
            "eta": body.material.eta,
        }
        reflected = frame.graph.draw(
            "frame/specular",
            into=reflected,
            size=frame.size,
            count=6,
            params=params,
            reflection=body.environment.reflection,
            **frame.gbuffer_bindings("gbuffer_id", "normal", "depth"),
            **frame.light_bindings(body),
        )
    return reflected


def composite(frame: Frame, M_front: Handle, M_back: Handle | None, reflected: Handle | None) -> Handle:
    """Radiance towards the viewer with coverage in alpha (Maisch & Ropinski 2017, eq. 5)."""
    radiance: Any = None
    for body in frame.stage.bodies:
        radiance = frame.graph.draw(
            "frame/composite",
            into=radiance,
            size=frame.size,
            count=6,
            object=body.object_uniforms,
            params={
                "clip_to_world": frame.view.clip_to_world,
                "eye": frame.view.eye,
                "rectangle": rectangle(frame, body),
            },
            rho_dt_table=frame.rho_dt_table(body),
            M_front=M_front,
            M_back=M_back or frame.stage.gpu.black,
            specular=reflected or frame.stage.gpu.black,
            **frame.gbuffer_bindings("gbuffer_id", "normal", "depth"),
        )
    return radiance


def bloom(graph: Graph, radiance: Handle, strength: float) -> Handle:
    """The radiance, a share `strength` of it spread over the pixels around by a Gaussian. With 0 it is what it was."""
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
    """The image for a display, sRGB in 8 bits. `exposure` in stops; `curve` is one of TONE_MAPS."""
    params = {"scale": 2.0**exposure, "curve": TONE_MAPS.index(curve)}
    return graph.draw("frame/tone_map", params=params, radiance=radiance)
