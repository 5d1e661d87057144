"""The channels of a glTF animation: key frames, and interpolation between them (glTF 2.0, appendix C)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.rig import Pose

Array = npt.NDArray[Any]

PATHS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3", "weights": "SCALAR"}
# Rows of values per key: a cubic spline has the tangent that leads to it, the value and the tangent that leads away.
INTERPOLATIONS = {"LINEAR": 1, "STEP": 1, "CUBICSPLINE": 3}
# Beyond this cosine of the angle between two rotations the sine by which slerp divides is lost to rounding.
PARALLEL = 1 - 1e-9


@dataclass(frozen=True, eq=False)
class Channel:
    """One animated property of one node."""

    node: int
    path: str
    """a key of PATHS"""
    interpolation: str
    """a key of INTERPOLATIONS"""
    times: Array
    """float64 (K,), s, at least 0, in ascending order"""
    values: Array
    """float64 (K, 1, C), or of a cubic spline (K, 3, C)"""

    def at(self, time_s: float) -> Array:
        """Interpolate the value at a time: float64 (C,). Outside of the keys, return that of the first or last key."""
        value = self.values[:, len(self.values[0]) // 2]
        last = int(np.searchsorted(self.times, time_s, side="right")) - 1
        if last < 0 or last == len(self.times) - 1 or self.interpolation == "STEP":
            return value[max(last, 0)]
        step = self.times[last + 1] - self.times[last]
        t = (time_s - self.times[last]) / step
        start, end = value[last], value[last + 1]
        if self.interpolation == "CUBICSPLINE":
            leaving, arriving = step * self.values[last, 2], step * self.values[last + 1, 0]
            return (
                (2 * t**3 - 3 * t**2 + 1) * start
                + (t**3 - 2 * t**2 + t) * leaving
                + (3 * t**2 - 2 * t**3) * end
                + (t**3 - t**2) * arriving
            )
        return _slerp(start, end, t) if self.path == "rotation" else (1 - t) * start + t * end

    def put(self, pose: Pose, time_s: float) -> None:
        """Write the value at a time into a pose."""
        value = self.at(time_s)
        if self.path == "rotation" and not np.linalg.norm(value) > 1e-12:
            return  # a spline through zero, where the rotation is undefined
        getattr(pose, self.path)[self.node][:] = value


def _slerp(start: Array, end: Array, t: float) -> Array:
    """Interpolate between two quaternions on the shorter arc."""
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    cosine = float(start @ end)
    if cosine < 0:
        end, cosine = -end, -cosine
    if cosine > PARALLEL:
        between: Array = (1 - t) * start + t * end
        return between
    angle = math.acos(cosine)
    turned: Array = (math.sin((1 - t) * angle) * start + math.sin(t * angle) * end) / math.sin(angle)
    return turned
