"""Cameras: right-handed view space looking down -z, and WebGPU clip space with depth from 0 (near) to 1 (far)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene import checks
from wgsss.scene.checks import Triple
from wgsss.scene.geometry import rotate_about

Matrix = npt.NDArray[np.float64]

_STEEPEST = 89.999  # degrees above the horizontal: looking straight up or down, the top of the image is undefined


@dataclass(frozen=True)
class _Camera:
    eye: Triple
    """mm"""
    target: Triple
    """the point in the middle of the image, mm"""
    up: Triple = (0.0, 1.0, 0.0)
    """the direction that points up in the image, of any length but zero"""

    def __post_init__(self) -> None:
        checks.position(self, "eye")
        checks.position(self, "target")
        checks.direction(self, "up")
        gaze = np.subtract(self.target, self.eye)
        if math.hypot(*gaze) < 1e-9:
            raise InputError("eye and target must not be the same point")
        checks.not_parallel(gaze, self.up, "up must not be parallel to the line from eye to target")

    def view(self) -> Matrix:
        """Return the matrix (4, 4) from world space, mm, to view space, mm. The camera looks down -z with y up."""
        back = _unit(np.subtract(self.eye, self.target))
        right = _unit(np.cross(self.up, back))
        matrix = np.eye(4)
        matrix[:3, :3] = right, np.cross(back, right), back
        matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(self.eye)
        return matrix

    def _turned(self, degrees: float) -> Self:
        """Rotate the eye about the axis `up` through the target, counter-clockwise seen from the tip of `up`."""
        arm = rotate_about(np.subtract(self.eye, self.target), _unit(np.asarray(self.up)), degrees)
        return replace(self, eye=tuple(self.target + arm))

    @classmethod
    def orbit(cls, target: Triple, distance: float, azimuth: float, elevation: float, **rest: Any) -> Self:
        """Create a camera on a sphere about the target.

        `distance` is in mm. `azimuth`, in degrees, is 0 on the +z side and 90 on the +x side; `elevation`, in degrees
        above the horizontal, lies between -90 and 90, both excluded. `rest` holds the other fields of the camera.
        Raises InputError naming the argument that is out of range.
        """
        orbit = SimpleNamespace(target=target, distance=distance, azimuth=azimuth, elevation=elevation)
        checks.position(orbit, "target")
        checks.number(orbit, "distance", checks.SMALLEST, checks.COORDINATE, "mm")
        checks.number(orbit, "azimuth", -checks.ANGLE, checks.ANGLE, "degrees")
        checks.number(orbit, "elevation", -_STEEPEST, _STEEPEST, "degrees")
        around, above = math.radians(azimuth), math.radians(elevation)
        offset = np.array([math.sin(around) * math.cos(above), math.sin(above), math.cos(around) * math.cos(above)])
        return cls(tuple(np.add(target, distance * offset)), target, **rest)


@dataclass(frozen=True)
class PerspectiveCamera(_Camera):
    """A pinhole camera."""

    fov: float = 30.0
    """vertical angle of view, degrees"""
    turn: float = 0.0
    """degrees per second by which the eye turns about the axis `up` through the target"""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.number(self, "fov", 0.05, 170, "degrees")
        checks.number(self, "turn", -checks.ANGLE, checks.ANGLE, "degrees per second")

    def projection(self, aspect: float, near: float, far: float) -> Matrix:
        """Return the matrix (4, 4) from view space to clip space.

        `aspect` is width / height, `near` and `far` are in mm.
        """
        _check_range(aspect, near, far, least=0.0)
        scale = 1 / math.tan(math.radians(self.fov) / 2)
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = scale / aspect, scale
        matrix[2, 2:] = far / (near - far), near * far / (near - far)
        matrix[3, 2] = -1
        return matrix

    def at(self, time_s: float) -> PerspectiveCamera:
        """Return the camera at a time in seconds, as one that does not turn."""
        return replace(self._turned(self.turn * time_s), turn=0.0) if self.turn else self


@dataclass(frozen=True)
class OrthographicCamera(_Camera):
    """A camera with parallel rays."""

    height: float = 100.0
    """height of the visible region, mm"""
    turn: float = 0.0
    """degrees per second by which the eye turns about the axis `up` through the target"""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.number(self, "height", checks.SMALLEST, checks.LENGTH, "mm")
        checks.number(self, "turn", -checks.ANGLE, checks.ANGLE, "degrees per second")

    def projection(self, aspect: float, near: float, far: float) -> Matrix:
        """Return the matrix (4, 4) from view space to clip space.

        `aspect` is width / height, `near` and `far` are in mm.
        """
        _check_range(aspect, near, far, least=-math.inf)
        matrix = np.eye(4)
        matrix[0, 0], matrix[1, 1] = 2 / (self.height * aspect), 2 / self.height
        matrix[2, 2:] = 1 / (near - far), near / (near - far)
        return matrix

    def at(self, time_s: float) -> OrthographicCamera:
        """Return the camera at a time in seconds, as one that does not turn."""
        return replace(self._turned(self.turn * time_s), turn=0.0) if self.turn else self


Camera = PerspectiveCamera | OrthographicCamera


def _check_range(aspect: float, near: float, far: float, *, least: float) -> None:
    if not (0 < aspect < math.inf and least < near < far < math.inf):
        raise InputError(f"no projection for aspect {aspect:g}, near {near:g} mm and far {far:g} mm")


def _unit(vector: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return vector / np.linalg.norm(vector)
