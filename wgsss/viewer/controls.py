"""What a pointer does to cameras and lights. Distances on the screen are in heights of the picture, y up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.rays import Caster
from wgsss.scene import Camera, DirectionalLight, EnvironmentLight, Object, OrthographicCamera, Scene
from wgsss.scene.light import Light

Array = npt.NDArray[np.float64]

TURN = 180.0
"""degrees, across a height"""
_POLE = np.array([0.0, 1.0, 0.0])
STEEPEST = 88.0
"""degrees above and below the horizon that orbits reach"""


def orbit(camera: Camera, right: float, up: float) -> Camera:
    """The eye moved round the target, so that what is in front follows the pointer."""
    arm = np.subtract(camera.eye, camera.target)
    pole = _unit(np.asarray(camera.up, np.float64))
    elevation = math.degrees(math.asin(np.clip(arm @ pole / np.linalg.norm(arm), -1.0, 1.0)))
    higher = float(np.clip(elevation - TURN * up, -STEEPEST, STEEPEST)) - elevation
    across = _unit(np.cross(pole, arm))
    arm = _turned(_turned(arm, across, -higher), pole, -TURN * right)
    return replace(camera, eye=_triple(camera.target + arm))


def pan(camera: Camera, right: float, up: float) -> Camera:
    """Eye and target moved across the view, so that what is at the target's distance follows the pointer."""
    view = camera.view()
    step = -height_at_target(camera) * (right * view[0, :3] + up * view[1, :3])
    return replace(camera, eye=_triple(camera.eye + step), target=_triple(camera.target + step))


def zoom(camera: Camera, factor: float) -> Camera:
    """The picture's middle `factor` times as large."""
    if isinstance(camera, OrthographicCamera):
        return replace(camera, height=max(camera.height / factor, 1e-6))
    arm = np.subtract(camera.eye, camera.target) / factor
    return replace(camera, eye=_triple(camera.target + arm)) if np.linalg.norm(arm) > 1e-6 else camera


def focus(camera: Camera, point: Any) -> Camera:
    """The target at a point, seen from the same side and distance."""
    step = np.subtract(point, camera.target)
    return replace(camera, eye=_triple(camera.eye + step), target=_triple(point))


def height_at_target(camera: Camera) -> float:
    """What the picture spans at the target's distance, mm."""
    if isinstance(camera, OrthographicCamera):
        return camera.height
    distance = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    return 2.0 * distance * math.tan(math.radians(camera.fov) / 2.0)


def turn_light(light: Light, camera: Camera, right: float, up: float, centre: Any) -> Light:
    """A light moved over the sphere of directions about `centre`, as if the pointer turned that sphere."""
    if isinstance(light, EnvironmentLight):
        return replace(light, rotation=(light.rotation + TURN * right) % 360.0)
    across, upright = camera.view()[:2, :3]
    return _moved(light, centre, lambda v: _turned(_turned(v, upright, TURN * right), across, -TURN * up))


def towards(light: Any, centre: Any) -> Array:
    """The unit vector from `centre` to a light."""
    arm = np.negative(light.direction) if isinstance(light, DirectionalLight) else np.subtract(light.position, centre)
    found: Array = arm / (np.linalg.norm(arm) or 1.0)
    return found


def bearing(light: Light, centre: Any) -> tuple[float, float]:
    """Where a light shines from, seen from `centre`, as of `PerspectiveCamera.orbit`: azimuth, elevation, degrees."""
    x, y, z = towards(light, centre)
    return math.degrees(math.atan2(x, z)), math.degrees(math.asin(np.clip(y, -1.0, 1.0)))


def aim(light: Light, centre: Any, azimuth: float, elevation: float) -> Light:
    """A light moved over the sphere about `centre`, as a body, to where it shines from such angles, degrees."""
    around, above = bearing(light, centre)
    side = np.array([math.cos(math.radians(around)), 0.0, -math.sin(math.radians(around))])
    return _moved(light, centre, lambda v: _turned(_turned(v, side, above - elevation), _POLE, azimuth - around))


def pick(scene: Scene, aspect: float, right: float, up: float) -> Any:
    """The nearest point of a still scene's surface, world mm, at -1 to 1 across and up the picture; None: nothing."""
    camera = scene.camera
    to_world = np.linalg.inv(camera.projection(aspect, 1.0, 2.0) @ camera.view())
    near, far = ((to_world @ (right, up, depth, 1.0)) for depth in (0.0, 1.0))
    start, towards = near[:3] / near[3], _unit(far[:3] / far[3] - near[:3] / near[3])
    start = start - towards * (
        float(np.ptp(scene.bounds, axis=0).max()) if isinstance(camera, OrthographicCamera) else 0
    )
    distance = min(_distance(thing, start, towards) for thing in scene.objects)
    return start + distance * towards if math.isfinite(distance) else None


def _distance(thing: Object, start: Array, towards: Array) -> float:
    """From `start` to an object in the direction of the unit vector `towards`; inf where it is missed."""
    face = _caster(thing).first(start[None], towards[None])[0]
    if face < 0:
        return math.inf
    a, b, c = thing.placed[thing.mesh.faces[face]].astype(np.float64)
    normal = np.cross(b - a, c - a)
    return float(normal @ (a - start) / (normal @ towards))


@lru_cache(maxsize=32)
def _caster(thing: Object) -> Caster:
    return Caster(thing.placed, thing.mesh.faces)


def project(camera: Camera, aspect: float, point: Any) -> tuple[float, float]:
    """Where a point, world mm, is in the picture: -1 to 1 across and up."""
    clip = camera.projection(aspect, 1.0, 2.0) @ camera.view() @ np.append(point, 1.0)
    return float(clip[0] / clip[3]), float(clip[1] / clip[3])


def _moved(light: Any, centre: Any, turned: Callable[[Array], Array]) -> Any:
    """A light with all that it has of places and directions turned about `centre`."""

    def vector(value: Any) -> Any:
        return _triple(turned(np.asarray(value, np.float64)))

    found = {name: vector(getattr(light, name)) for name in ("direction", "up") if hasattr(light, name)}
    if hasattr(light, "position"):
        found["position"] = _triple(np.asarray(centre) + vector(np.subtract(light.position, centre)))
    return replace(light, **found)


def _turned(vector: Array, axis: Array, degrees: float) -> Array:
    """Counter-clockwise seen from the tip of the unit axis (Rodrigues)."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return vector * cos + np.cross(axis, vector) * sin + axis * (axis @ vector) * (1.0 - cos)


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _triple(vector: Any) -> Any:
    return tuple(float(x) for x in vector)
