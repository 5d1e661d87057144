"""Cameras and lights that follow a dragged pointer, and the point of the scene under the pointer.

`right` and `up` are distances that the pointer moved, relative to the height of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.rays import Caster
from wgsss.scene import Camera, DirectionalLight, EnvironmentLight, Light, Object, OrthographicCamera, Scene
from wgsss.scene.geometry import rotate_about

Array = npt.NDArray[np.float64]

DEGREES_PER_HEIGHT = 180.0
"""rotation for a drag over the height of the picture"""
MAX_ELEVATION = 88.0
"""degrees above and below the horizon that an orbiting camera can reach"""
_Y_AXIS = np.array([0.0, 1.0, 0.0])


def orbit(camera: Camera, right: float, up: float) -> Camera:
    """Rotate the camera about its target, so that what is in front of the target follows the pointer."""
    arm = np.subtract(camera.eye, camera.target)
    pole = _unit(np.asarray(camera.up, np.float64))
    elevation = math.degrees(math.asin(np.clip(arm @ pole / np.linalg.norm(arm), -1.0, 1.0)))
    change = float(np.clip(elevation - DEGREES_PER_HEIGHT * up, -MAX_ELEVATION, MAX_ELEVATION)) - elevation
    across = _unit(np.cross(pole, arm))
    arm = rotate_about(rotate_about(arm, across, -change), pole, -DEGREES_PER_HEIGHT * right)
    return replace(camera, eye=_triple(camera.target + arm))


def pan(camera: Camera, right: float, up: float) -> Camera:
    """Move eye and target across the view, so that a point at the target's distance follows the pointer."""
    view = camera.view()
    step = -height_at_target(camera) * (right * view[0, :3] + up * view[1, :3])
    return replace(camera, eye=_triple(camera.eye + step), target=_triple(camera.target + step))


def zoom(camera: Camera, factor: float) -> Camera:
    """Move the camera, or change its height, so that the picture at the target's distance grows by a factor."""
    if isinstance(camera, OrthographicCamera):
        return replace(camera, height=max(camera.height / factor, 1e-6))
    arm = np.subtract(camera.eye, camera.target) / factor
    return replace(camera, eye=_triple(camera.target + arm)) if np.linalg.norm(arm) > 1e-6 else camera


def focus(camera: Camera, point: npt.ArrayLike) -> Camera:
    """Move the camera so that its target is a point, without a change of direction or distance."""
    step = np.subtract(point, camera.target)
    return replace(camera, eye=_triple(camera.eye + step), target=_triple(point))


def height_at_target(camera: Camera) -> float:
    """Return the height of the scene that the picture shows at the target's distance, mm."""
    if isinstance(camera, OrthographicCamera):
        return camera.height
    distance = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    return 2.0 * distance * math.tan(math.radians(camera.fov) / 2.0)


def turn_light(light: Light, camera: Camera, right: float, up: float, centre: npt.ArrayLike) -> Light:
    """Rotate a light about a centre, as a trackball that the pointer drags would carry it.

    An environment turns about the vertical axis alone.
    """
    if isinstance(light, EnvironmentLight):
        return replace(light, rotation=(light.rotation + DEGREES_PER_HEIGHT * right) % 360.0)
    across, upright = camera.view()[:2, :3]
    return _rotate_light(
        light,
        centre,
        lambda v: rotate_about(rotate_about(v, upright, DEGREES_PER_HEIGHT * right), across, -DEGREES_PER_HEIGHT * up),
    )


def direction_to_light(light: Any, centre: npt.ArrayLike) -> Array:
    """Return the unit vector from a centre to a light that is no environment."""
    arm = np.negative(light.direction) if isinstance(light, DirectionalLight) else np.subtract(light.position, centre)
    direction: Array = arm / (np.linalg.norm(arm) or 1.0)
    return direction


def light_angles(light: Light, centre: npt.ArrayLike) -> tuple[float, float]:
    """Return azimuth and elevation of a light as seen from a centre, degrees, as `PerspectiveCamera.orbit` counts."""
    x, y, z = direction_to_light(light, centre)
    return math.degrees(math.atan2(x, z)), math.degrees(math.asin(np.clip(y, -1.0, 1.0)))


def aim_light(light: Light, centre: npt.ArrayLike, azimuth: float, elevation: float) -> Light:
    """Rotate a light about a centre, from which it is then seen at an azimuth and an elevation in degrees."""
    old_azimuth, old_elevation = light_angles(light, centre)
    side = np.array([math.cos(math.radians(old_azimuth)), 0.0, -math.sin(math.radians(old_azimuth))])
    return _rotate_light(
        light,
        centre,
        lambda v: rotate_about(rotate_about(v, side, old_elevation - elevation), _Y_AXIS, azimuth - old_azimuth),
    )


def pick(scene: Scene, aspect: float, right: float, up: float) -> Array | None:
    """Return the nearest point of the surface of a still scene, world mm, at a position in the picture.

    `right` and `up` run from -1 to 1 across the picture. None: nothing is there.
    """
    camera = scene.camera
    to_world = np.linalg.inv(camera.projection(aspect, 1.0, 2.0) @ camera.view())
    near, far = ((to_world @ (right, up, depth, 1.0)) for depth in (0.0, 1.0))
    start, direction = near[:3] / near[3], _unit(far[:3] / far[3] - near[:3] / near[3])
    start = start - direction * (
        float(np.ptp(scene.bounds, axis=0).max()) if isinstance(camera, OrthographicCamera) else 0
    )
    distance = min(_distance(item, start, direction) for item in scene.objects)
    return start + distance * direction if math.isfinite(distance) else None


def _distance(item: Object, start: Array, direction: Array) -> float:
    """Return the distance from `start` to an object along a unit vector; inf if the ray misses it."""
    face = _caster(item).first(start[None], direction[None])[0]
    if face < 0:
        return math.inf
    a, b, c = item.placed[item.mesh.faces[face]].astype(np.float64)
    normal = np.cross(b - a, c - a)
    return float(normal @ (a - start) / (normal @ direction))


@lru_cache(maxsize=32)
def _caster(item: Object) -> Caster:
    return Caster(item.placed, item.mesh.faces)


def project(camera: Camera, aspect: float, point: npt.ArrayLike) -> tuple[float, float]:
    """Return the position of a point, world mm, in the picture: -1 to 1 to the right and up."""
    clip = camera.projection(aspect, 1.0, 2.0) @ camera.view() @ np.append(point, 1.0)
    return float(clip[0] / clip[3]), float(clip[1] / clip[3])


def _rotate_light(light: Any, centre: npt.ArrayLike, rotate: Callable[[Array], Array]) -> Any:
    """Rotate the position about a centre, and the directions, of a light that is no environment."""

    def rotated(value: npt.ArrayLike) -> tuple[float, float, float]:
        return _triple(rotate(np.asarray(value, np.float64)))

    changes = {name: rotated(getattr(light, name)) for name in ("direction", "up") if hasattr(light, name)}
    if hasattr(light, "position"):
        changes["position"] = _triple(np.asarray(centre) + rotated(np.subtract(light.position, centre)))
    return replace(light, **changes)


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _triple(vector: Any) -> tuple[float, float, float]:
    x, y, z = vector
    return float(x), float(y), float(z)
