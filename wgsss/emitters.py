"""Lights as the shaders see them: emitters without extent, and the views of which their shadow maps are drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.camera import Camera, OrthographicCamera, PerspectiveCamera
from wgsss.scene.geometry import fibonacci_sphere
from wgsss.scene.light import DirectionalLight, EnvironmentLight, Light, PointLight, RectLight, SphereLight

Array = npt.NDArray[Any]

DIRECTIONAL, POINT, PATCH = 0, 1, 2  # wgsl/light.wgsl
WIDEST_VIEW = 120.0  # degrees: a light has one view where the scene spans less as seen from it, otherwise a cube of six
PARALLEL = 1 / 2048  # scene radius over distance below which shadows differ by less than a texel from parallel light's
MAX_VIEWS = 256  # layers of an array texture that every adapter has
_SMALLEST = 1e-3  # mm: extent of a view, at least, even where all bodies have been scaled to nothing
_CUBE = (
    ((1, 0, 0), (0, 1, 0)),
    ((-1, 0, 0), (0, 1, 0)),
    ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, 1)),
    ((0, 0, 1), (0, 1, 0)),
    ((0, 0, -1), (0, 1, 0)),
)


class LightValue(TypedDict):
    """A value of struct Light (wgsl/light.wgsl)."""

    position: Any
    kind: int
    power: Any
    first_view: int
    normal: Any
    views: int


class ShadowViewValue(TypedDict):
    """A value of struct ShadowView (wgsl/light.wgsl)."""

    world_to_clip: Array
    texel: float
    perspective: int


@dataclass(frozen=True)
class Emitters:
    """The emitters of all lights, and their shadow views."""

    lights: list[LightValue]
    views: list[ShadowViewValue]
    shadow_size: int
    """side of each view's shadow map, texels"""


@dataclass(frozen=True)
class _Emitter:
    """A light without extent, of one of the kinds that wgsl/light.wgsl knows."""

    position: Array
    kind: int
    power: Array
    normal: Array


@dataclass(frozen=True)
class _View:
    """A shadow view before the size of the shadow maps is known."""

    world_to_clip: Array
    extent: float
    """width of the view, mm; of a perspective view, mm per mm of distance"""
    perspective: int


def emitters(lights: Sequence[Light], points: Array) -> Emitters:
    """Return the emitters and shadow views of lights in a scene with vertices at `points` (N, 3), world mm.

    Area lights become `samples` patches that emit with the cosine. Environments are left out: they cast no shadows.

    Raises InputError where the lights need more shadow views than every adapter allows.
    """
    values: list[LightValue] = []
    views: list[_View] = []
    for light in lights:
        for emitter in _emitters(light, points):
            own = _views(emitter, points)
            values.append(
                {
                    "position": emitter.position,
                    "kind": emitter.kind,
                    "power": emitter.power,
                    "normal": emitter.normal,
                    "first_view": len(views),
                    "views": len(own),
                }
            )
            views += own
    if len(views) > MAX_VIEWS:
        raise InputError(f"the lights need {len(views)} shadow maps, at most {MAX_VIEWS} are possible: lower 'samples'")
    # Many views are many samples of soft shadows, which need less detail each; memory stays below 128 MiB.
    size = next(s for s in (2048, 1024, 512, 256) if len(views) * s * s * 4 <= 128 << 20 or s == 256)
    shadow_views: list[ShadowViewValue] = [
        {"world_to_clip": view.world_to_clip, "texel": view.extent / size, "perspective": view.perspective}
        for view in views
    ]
    return Emitters(values, shadow_views, size)


def irradiance_of(emitted: Emitters, points: Array) -> float:
    """Estimate the irradiance of a surface that faces all emitters, W/m^2, in the brightest channel."""
    centre, radius = _ball(points)
    total = 0.0
    for light in emitted.lights:
        distance = max(float(np.linalg.norm(centre - light["position"])), radius) / 1000  # m
        total += float(np.max(light["power"])) / (1.0 if light["kind"] == DIRECTIONAL else distance**2)
    return total


def _emitters(light: Light, points: Array) -> list[_Emitter]:
    no_normal = np.zeros(3)
    if isinstance(light, DirectionalLight):
        return [_Emitter(-_unit(light.direction), DIRECTIONAL, np.asarray(light.irradiance), no_normal)]
    if isinstance(light, PointLight):
        return [_Emitter(np.asarray(light.position), POINT, np.asarray(light.intensity), no_normal)]
    if isinstance(light, EnvironmentLight):
        return []
    if isinstance(light, RectLight):
        positions, normals, area, kind = *_rect(light), PATCH
    elif _angle(light.position, points) < WIDEST_VIEW:
        positions, normals, area, kind = *_half_sphere(light, points.mean(axis=0)), PATCH
    else:  # inside the scene: a sphere looks like a disc from all sides, and points that emit to all sides replace it
        normals = _spiral(light.samples, -1.0)
        positions = np.asarray(light.position) + light.radius * normals
        area, kind = math.pi * light.radius**2, POINT
    intensity = np.asarray(light.radiance) * (area * 1e-6 / len(positions))  # W/sr along the normal; area in mm^2
    return [_Emitter(x, kind, intensity, n) for x, n in zip(positions, normals, strict=True)]


def _rect(light: RectLight) -> tuple[Array, Array, float]:
    """Return the centres of a grid of cells over the rectangle, their normals, and the area in mm^2."""
    normal = _unit(light.direction)
    right = _unit(np.cross(light.up, -normal))
    up = np.cross(-normal, right)
    rows = max(
        range(1, light.samples + 1),
        key=lambda n: (light.samples % n == 0, -abs(n * n * light.width / light.height - light.samples)),
    )
    columns = light.samples // rows
    across, along = np.meshgrid((np.arange(columns) + 0.5) / columns - 0.5, (np.arange(rows) + 0.5) / rows - 0.5)
    cells = across.reshape(-1, 1) * right * light.width + along.reshape(-1, 1) * up * light.height
    return np.asarray(light.position) + cells, np.broadcast_to(normal, cells.shape), light.width * light.height


def _half_sphere(light: SphereLight, centre: Array) -> tuple[Array, Array, float]:
    """Return points of the hemisphere that faces the scene, their normals, and an area in mm^2 that gives their patches
    the same projected area as the hemisphere's, which is that of a disc of the same radius."""
    towards = _unit(centre - np.asarray(light.position))
    right = _unit(np.cross(towards, (0, 0, 1) if abs(towards[2]) < 0.9 else (1, 0, 0)))
    spiral = _spiral(light.samples, 0.0)
    normals = spiral @ np.stack([right, np.cross(towards, right), towards])
    area = math.pi * light.radius**2 * light.samples / spiral[:, 2].sum()
    return np.asarray(light.position) + light.radius * normals, normals, area


def _spiral(count: int, low: float) -> Array:
    """Return the unit vectors (count, 3) of `fibonacci_sphere` with +z as the axis, down to z = `low`."""
    return np.roll(fibonacci_sphere(count, low), 1, axis=1)


def _ball(points: Array) -> tuple[Array, float]:
    """Return centre and radius of a ball that contains the points."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre, max(float(np.linalg.norm(points - centre, axis=1).max()), _SMALLEST)


def _angle(position: Any, points: Array) -> float:
    """Return the angle that the points span as seen from a position, degrees; 180 inside their ball."""
    centre, radius = _ball(points)
    distance = float(np.linalg.norm(centre - position))
    return 180.0 if distance <= radius else 2 * math.degrees(math.asin(radius / distance))


def _views(emitter: _Emitter, points: Array) -> list[_View]:
    centre, radius = _ball(points)
    position = np.asarray(emitter.position, np.float64)
    if emitter.kind == DIRECTIONAL:
        return [_parallel_view(position, points)]
    distance = float(np.linalg.norm(centre - position))
    if radius < PARALLEL * distance:
        return [_parallel_view((position - centre) / distance, points)]
    angle = _angle(position, points)
    if angle < WIDEST_VIEW:
        fov = 1.02 * angle
        camera = PerspectiveCamera(tuple(position), tuple(centre), _up(centre - position), fov=fov)
        near = max(distance - 1.01 * radius, 1e-3 * distance)
        return [_view(camera, near, distance + 1.01 * radius, 2 * math.tan(math.radians(fov) / 2), perspective=1)]
    far = distance + 1.01 * radius
    cameras = [PerspectiveCamera(tuple(position), tuple(position + d), up, fov=90.0) for d, up in _CUBE]
    return [_view(camera, 1e-3 * radius, far, 2.0, perspective=1) for camera in cameras]


def _parallel_view(towards: Array, points: Array) -> _View:
    """Return the view from a light in direction `towards` that is so far away that its rays are parallel."""
    centre, radius = _ball(points)
    camera = OrthographicCamera(tuple(centre + 2 * radius * towards), tuple(centre), _up(towards))
    rotation = camera.view()[:3, :3]
    rotated = points @ rotation.T
    extent = 1.02 * max(float(np.ptp(rotated, axis=0)[:2].max()), _SMALLEST)
    shift = rotation.T @ (0.5 * (rotated.min(axis=0) + rotated.max(axis=0)) - rotation @ centre)
    camera = OrthographicCamera(tuple(camera.eye + shift), tuple(centre + shift), _up(towards), height=extent)
    return _view(camera, 0.5 * radius, 3.5 * radius, extent, perspective=0)


def _view(camera: Camera, near: float, far: float, extent: float, perspective: int) -> _View:
    return _View(camera.projection(1.0, near, far) @ camera.view(), extent, perspective)


def _unit(v: Any) -> Array:
    v = np.asarray(v, np.float64)
    unit: Array = v / np.linalg.norm(v)
    return unit


def _up(direction: Any) -> tuple[float, float, float]:
    return (0.0, 0.0, 1.0) if abs(_unit(direction)[1]) > 0.9 else (0.0, 1.0, 0.0)
