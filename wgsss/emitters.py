"""Lights as the shaders see them: emitters without size, and the views from which their shadows are drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.camera import OrthographicCamera, PerspectiveCamera
from wgsss.scene.light import DirectionalLight, EnvironmentLight, Light, PointLight, RectLight, SphereLight

Array = npt.NDArray[Any]

DIRECTIONAL, POINT, PATCH = 0, 1, 2  # wgsl/light.wgsl
WIDEST_VIEW = 120.0  # degrees: a light that sees the scene within less gets one view of it, another a cube of six
PARALLEL = 1 / 2048  # scene radius over distance: from farther away, shadows are within a texel those of parallel light
MAX_VIEWS = 256  # layers of an array texture that every adapter has
_SMALLEST = 1e-3  # mm: of what a view shows, also where a body has been scaled to nothing
_CUBE = (
    ((1, 0, 0), (0, 1, 0)),
    ((-1, 0, 0), (0, 1, 0)),
    ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, 1)),
    ((0, 0, 1), (0, 1, 0)),
    ((0, 0, -1), (0, 1, 0)),
)


@dataclass(frozen=True)
class Emitters:
    """`lights` are values of struct Light, `views` of struct ShadowView (wgsl/light.wgsl); `shadow_size` is the side of
    each view's map, in texels."""

    lights: list[dict[str, Any]]
    views: list[dict[str, Any]]
    shadow_size: int


def emitters(lights: Sequence[Light], points: Array) -> Emitters:
    """What lights the scene and casts shadows in it; `points` (N, 3) are its vertices, world mm. Environments, which
    cast no shadow, are left out. Area lights become `samples` patches that emit by the cosine.

    Raises InputError where the lights need more shadow views than an adapter must have.
    """
    found: list[dict[str, Any]] = []
    views: list[dict[str, Any]] = []
    for light in lights:
        for emitter in _emitters(light, points):
            seen = _views(emitter, points)
            found.append({**emitter, "first_view": len(views), "views": len(seen)})
            views += seen
    if len(views) > MAX_VIEWS:
        raise InputError(f"the lights need {len(views)} shadow maps, at most {MAX_VIEWS} are possible: lower 'samples'")
    # Many views are many samples of soft shadows, where each needs less detail; memory stays below 128 MiB.
    size = next(s for s in (2048, 1024, 512, 256) if len(views) * s * s * 4 <= 128 << 20 or s == 256)
    for view in views:
        view["texel"] = view.pop("extent") / size
    return Emitters(found, views, size)


def irradiance_of(found: Emitters, points: Array) -> float:
    """About what all emitters together give a surface that faces them, W/m^2, of the brightest channel."""
    centre, radius = _ball(points)
    total = 0.0
    for light in found.lights:
        distance = max(float(np.linalg.norm(centre - light["position"])), radius) / 1000  # m
        total += float(np.max(light["power"])) / (1.0 if light["kind"] == DIRECTIONAL else distance**2)
    return total


def _emitters(light: Light, points: Array) -> list[dict[str, Any]]:
    """Position, kind, power and normal of a light's emitters."""
    nowhere = (0.0, 0.0, 0.0)
    if isinstance(light, DirectionalLight):
        return [
            {"position": -_unit(light.direction), "kind": DIRECTIONAL, "power": light.irradiance, "normal": nowhere}
        ]
    if isinstance(light, PointLight):
        return [{"position": light.position, "kind": POINT, "power": light.intensity, "normal": nowhere}]
    if isinstance(light, EnvironmentLight):
        return []
    if isinstance(light, RectLight):
        positions, normals, area, kind = *_rect(light), PATCH
    elif _angle(light.position, points) < WIDEST_VIEW:
        positions, normals, area, kind = *_half_sphere(light, points.mean(axis=0)), PATCH
    else:  # amid the scene: seen from any side as a disc, points that emit to all sides give the same
        normals = _spiral(light.samples, -1.0)
        positions = np.asarray(light.position) + light.radius * normals
        area, kind = math.pi * light.radius**2, POINT
    intensity = np.asarray(light.radiance) * (area * 1e-6 / len(positions))  # W/sr along the normal; area in mm^2
    return [
        {"position": x, "kind": kind, "power": intensity, "normal": n} for x, n in zip(positions, normals, strict=True)
    ]


def _rect(light: RectLight) -> tuple[Array, Array, float]:
    """Centres of a grid of cells over the rectangle, their normals, and the area in mm^2."""
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
    """Points of the half that faces the scene, their normals, and the area in mm^2, scaled so that their cosines sum to
    the disc of the same radius, as the whole half would."""
    towards = _unit(centre - np.asarray(light.position))
    right = _unit(np.cross(towards, (0, 0, 1) if abs(towards[2]) < 0.9 else (1, 0, 0)))
    spiral = _spiral(light.samples, 0.0)
    normals = spiral @ np.stack([right, np.cross(towards, right), towards])
    area = math.pi * light.radius**2 * light.samples / spiral[:, 2].sum()
    return np.asarray(light.position) + light.radius * normals, normals, area


def _spiral(count: int, low: float) -> Array:
    """Points (count, 3) of the unit sphere from z = 1 down to `low`, on a Fibonacci spiral of equal areas."""
    i = np.arange(count) + 0.5
    z = 1 - (1 - low) * i / count
    phi = math.pi * (3 - math.sqrt(5)) * i
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(phi), ring * np.sin(phi), z], axis=1)


def _ball(points: Array) -> tuple[Array, float]:
    """Centre and radius of a ball that holds the points."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre, max(float(np.linalg.norm(points - centre, axis=1).max()), _SMALLEST)


def _angle(position: Any, points: Array) -> float:
    """The angle within which the points are seen from a position, degrees; 180 amid them."""
    centre, radius = _ball(points)
    distance = float(np.linalg.norm(centre - position))
    return 180.0 if distance <= radius else 2 * math.degrees(math.asin(radius / distance))


def _views(emitter: dict[str, Any], points: Array) -> list[dict[str, Any]]:
    """Shadow views: `extent` is the width seen, mm, of a perspective view per mm of distance."""
    centre, radius = _ball(points)
    position = np.asarray(emitter["position"], np.float64)
    if emitter["kind"] == DIRECTIONAL:
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


def _parallel_view(towards: Array, points: Array) -> dict[str, Any]:
    """The view from a light so far away, in direction `towards`, that its rays are parallel."""
    centre, radius = _ball(points)
    camera = OrthographicCamera(tuple(centre + 2 * radius * towards), tuple(centre), _up(towards))
    turn = camera.view()[:3, :3]
    seen = points @ turn.T
    extent = 1.02 * max(float(np.ptp(seen, axis=0)[:2].max()), _SMALLEST)
    shift = turn.T @ (0.5 * (seen.min(axis=0) + seen.max(axis=0)) - turn @ centre)
    camera = OrthographicCamera(tuple(camera.eye + shift), tuple(centre + shift), _up(towards), height=extent)
    return _view(camera, 0.5 * radius, 3.5 * radius, extent, perspective=0)


def _view(camera: Any, near: float, far: float, extent: float, perspective: int) -> dict[str, Any]:
    return {
        "world_to_clip": camera.projection(1.0, near, far) @ camera.view(),
        "extent": extent,
        "perspective": perspective,
    }


def _unit(v: Any) -> Array:
    v = np.asarray(v, np.float64)
    return v / np.linalg.norm(v)


def _up(direction: Any) -> tuple[float, float, float]:
    return (0.0, 0.0, 1.0) if abs(_unit(direction)[1]) > 0.9 else (0.0, 1.0, 0.0)
