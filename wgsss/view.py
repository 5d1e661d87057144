"""The camera of a frame as the shaders see it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene import Object, OrthographicCamera, Scene

Array = npt.NDArray[Any]

_MARGIN, _LEAST_DEPTH = 0.01, 1e-3  # around the scene's depths: as a share of their range, which is at least so many mm
_NEAREST, _CLOSEST = 1e-3, 1e-6  # shares of the greatest depth, see `_near_plane`


@dataclass(frozen=True)
class View:
    """A camera and its clip space."""

    world_to_clip: Array
    """(4, 4)"""
    clip_to_world: Array
    """(4, 4)"""
    eye: tuple[float, float, float, float]
    """xyz, 1: the camera's position; xyz, 0: the direction towards an orthographic camera"""


def view_of(scene: Scene, aspect: float) -> View:
    """Return the view of a scene's camera in an image of `aspect` (width / height), with near and far planes around
    the scene."""
    camera = scene.camera
    corners = np.array(np.meshgrid(*scene.bounds.T, indexing="ij")).reshape(3, -1).T
    to_view = camera.view()
    depths = -(corners @ to_view[2, :3] + to_view[2, 3])
    near, far = float(depths.min()) - _margin(depths), float(depths.max()) + _margin(depths)
    orthographic = isinstance(camera, OrthographicCamera)
    if not orthographic:  # a perspective camera may be inside or in front of the scene
        far = max(far, _LEAST_DEPTH)
        if near < _NEAREST * far:
            near = _near_plane([-(o.placed @ to_view[2, :3] + to_view[2, 3]) for o in scene.objects], far)
    world_to_clip = camera.projection(aspect, near, far) @ to_view
    towards = np.subtract(camera.eye, camera.target)
    eye = (*(towards / np.linalg.norm(towards)), 0.0) if orthographic else (*camera.eye, 1.0)
    return View(world_to_clip, np.linalg.inv(world_to_clip), eye)


def _margin(depths: Array) -> float:
    return _MARGIN * max(float(np.ptp(depths)), _LEAST_DEPTH)


def _near_plane(depths: Sequence[Array], far: float) -> float:
    """Return the depth of the near plane, given the depths of the vertices of each object.

    Objects in front of the camera are drawn completely. Objects around the camera are cut off at _NEAREST: with a plane
    closer than that, the depth buffer could not resolve distant depths.
    """
    lowest = [float(of_one.min()) - _margin(of_one) for of_one in depths if of_one.max() > 0.0]
    return max(min((low if low > 0.0 else _NEAREST * far for low in lowest), default=far / 2), _CLOSEST * far)


def rectangle(view: View, posed: Object, size: tuple[int, int]) -> Array:
    """Return left, bottom, right and top, in clip space, of a rectangle that contains an object as posed, and one more
    pixel on each side. Pixels outside cost nothing; on CPUs, discarding them would cost as much as shading them."""
    corners = np.array(np.meshgrid(*posed.mesh.bounds.astype(np.float64).T, indexing="ij")).reshape(3, -1).T
    clip = np.column_stack([corners, np.ones(8)]) @ posed.matrix.T @ view.world_to_clip.T
    if clip[:, 3].min() <= 0.0:  # a part of the object is beside or behind the camera
        return np.array([-1.0, -1.0, 1.0, 1.0])
    ndc, pixel = clip[:, :2] / clip[:, 3:], 2.0 / np.array(size)
    clipped: Array = np.clip(np.concatenate([ndc.min(axis=0) - pixel, ndc.max(axis=0) + pixel]), -1.0, 1.0)
    return clipped
