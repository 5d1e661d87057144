"""What a mesh is shown with where nothing else is given: a material, lights, and a camera that frames it."""

from __future__ import annotations

import math
from collections.abc import Iterable

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
_AZIMUTH, _ELEVATION = 20.0, 10.0  # degrees: nearly from the front, but no symmetric thing looks flat
_MARGIN = 1.08  # of the width of the image, over what the objects fill


def framing(objects: Iterable[Object]) -> PerspectiveCamera:
    """A camera in front of the objects, a little to the right and above, with all of them in a square image."""
    points = np.concatenate([o.placed for o in objects])
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    target = (float(middle[0]), float(middle[1]), float(middle[2]))
    camera = PerspectiveCamera.orbit(target, float((high - low).max()), _AZIMUTH, _ELEVATION)
    x, y, z = camera.view()[:3, :3] @ (points - middle).T
    slope = math.tan(math.radians(camera.fov) / 2) / _MARGIN
    distance = float((np.maximum(np.abs(x), np.abs(y)) / slope + z).max())
    return PerspectiveCamera.orbit(target, distance, _AZIMUTH, _ELEVATION)
