"""A scene under one light of each of four types, all of the same mean irradiance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.emitters import DIRECTIONAL, PATCH, emitters
from wgsss.scene import DirectionalLight, EnvironmentLight, PointLight, RectLight, Scene
from wgsss.scene.light import Light

Array = npt.NDArray[Any]

# Direction towards the light in the camera's frame (right, up, towards the viewer). The light is behind the object, so
# that light must pass through it to be seen, and to the side, so that a lit rim is visible too.
_TOWARDS = (0.62, 0.45, -0.64)
_DISTANCE = 3.0  # of a point or area light, in radii of the scene
_SIDE = 1.5  # of an area light, in radii of the scene


def light_types(scene: Scene, time: float = 0.0) -> dict[str, Scene]:
    """Return the scene under one white light of each type, placed behind and to the side of the object.

    The mean irradiance of the surface, without shadows, is that under the scene's own lights.
    """
    posed = scene.at(time)
    centre = posed.bounds.mean(axis=0)
    radius = max(float(np.linalg.norm(posed.bounds[1] - centre)), 1e-3)
    towards = np.asarray(_TOWARDS) @ posed.camera.view()[:3, :3] / np.linalg.norm(_TOWARDS)
    place: Any = tuple(centre + _DISTANCE * radius * towards)
    up = (0.0, 0.0, 1.0) if abs(towards[1]) > 0.9 else (0.0, 1.0, 0.0)
    side = _SIDE * radius
    away: Any = tuple(-towards)
    unit: dict[str, Any] = {
        "directional": DirectionalLight(away, (1.0, 1.0, 1.0)),
        "point": PointLight(place, (1.0, 1.0, 1.0)),
        "area": RectLight(place, away, up, side, side, (1.0, 1.0, 1.0)),
        "environment": EnvironmentLight((1.0, 1.0, 1.0)),
    }
    target = mean_irradiance(posed, posed.lights)
    power = {"directional": "irradiance", "point": "intensity", "area": "radiance", "environment": "radiance"}
    scenes = {}
    for name, light in unit.items():
        scale = target / (mean_irradiance(posed, (light,)) or 1.0)
        lit = replace(light, **{power[name]: (scale,) * 3})
        scenes[name] = replace(scene, name=f"{scene.name}, {name}", lights=(lit,))
    return scenes


def mean_irradiance(scene: Scene, lights: Sequence[Light]) -> float:
    """Return the mean irradiance over the surface of a still scene and over the channels, without shadows, W/m^2."""
    position, normal, area = _triangles(scene)
    total = np.zeros(3)
    for emitter in emitters(lights, np.concatenate([o.placed for o in scene.objects])).lights:
        to_light = np.asarray(emitter["position"], np.float64)
        distance = np.ones(len(position))  # m
        if emitter["kind"] != DIRECTIONAL:
            to_light = to_light - position
            length = np.linalg.norm(to_light, axis=1)
            to_light, distance = to_light / length[:, None], length / 1000.0
        facing = np.maximum(np.sum(normal * to_light, axis=1), 0.0)
        if emitter["kind"] == PATCH:
            facing *= np.maximum(-np.sum(to_light * emitter["normal"], axis=1), 0.0)
        total += np.average(facing / np.square(distance), weights=area) * np.asarray(emitter["power"])
    for light in lights:
        if isinstance(light, EnvironmentLight):
            pixels = light.pixels().astype(np.float64)
            latitude = np.sin((np.arange(len(pixels)) + 0.5) / len(pixels) * math.pi)
            total += math.pi * np.average(pixels.mean(axis=1), axis=0, weights=latitude)
    return float(total.mean())


def _triangles(scene: Scene) -> tuple[Array, Array, Array]:
    """Return the centre (N, 3), normal (N, 3) and area (N,) of all triangles in world space."""
    corners = np.concatenate([o.placed[o.mesh.faces] for o in scene.objects])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(normal, axis=1)
    proper = twice > 0.0
    return corners[proper].mean(axis=1), normal[proper] / twice[proper, None], 0.5 * twice[proper]
