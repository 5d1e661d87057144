"""Defaults for a mesh without a scene: a material, lights, and a camera that frames it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from wgsss.scene.camera import PerspectiveCamera
from wgsss.scene.light import DirectionalLight, EnvironmentLight, Light
from wgsss.scene.material import MATERIALS
from wgsss.scene.scene import Object

DEFAULT_MATERIAL = MATERIALS["marble"]
# A key light from the front, upper left; a dimmer one from behind, to show what shines through; a faint surrounding.
DEFAULT_LIGHTS: tuple[Light, ...] = (
    DirectionalLight((0.6, -0.7, -0.8), (2.2, 2.2, 2.2)),
    DirectionalLight((-0.4, -0.3, 1.0), (1.6, 1.6, 1.6)),
    EnvironmentLight((0.1, 0.1, 0.1)),
)
POSES = 9  # of a moving object, all of which the camera shows
_MARGIN = 1.08  # width of the image over the width of the objects in it


def framing(
    objects: Iterable[Object], *, azimuth: float = 20.0, elevation: float = 10.0, fov: float = 30.0
) -> PerspectiveCamera:
    """Create a camera that shows all objects in a square image, with a small margin, during their whole motion.

    Angles are in degrees. By default the camera looks from the front, a little from the right and from above, so that
    symmetric objects do not look flat.
    """
    points = np.concatenate([pose.placed for thing in objects for pose in _poses(thing)])
    camera = PerspectiveCamera.orbit((0, 0, 0), 1.0, azimuth, elevation, fov=fov)
    turn = camera.view()[:3, :3]
    right, up, towards = turn @ points.T
    slope = math.tan(math.radians(fov) / 2) / _MARGIN
    # Both edges of the image touch the object where the middle of its extremes, widened by depth, is the target.
    ends = [((a + slope * towards).max(), (-a + slope * towards).max()) for a in (right, up)]
    distance = max((high + low) / (2 * slope) for high, low in ends)
    target = turn.T @ np.array([*((high - low) / 2 for high, low in ends), 0.0])
    eye = target + turn[2] * distance
    # The point looked at, about which a turning camera goes, lies at the middle of the object's depth.
    target = target + turn[2] * (towards.max() + towards.min()) / 2
    return replace(camera, eye=tuple(eye.tolist()), target=tuple(target.tolist()))


def _poses(thing: Object) -> list[Object]:
    """Return the object at POSES times spread evenly over the period of its motion."""
    if thing.motion is None:
        return [thing]
    return [thing.at(time_s) for time_s in np.linspace(0, thing.motion.period_s, POSES)]
