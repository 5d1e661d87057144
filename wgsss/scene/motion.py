"""Motions: functions that deform the rest pose of a mesh over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wgsss.scene import checks


@dataclass(frozen=True)
class BendAndSwell:
    """A motion of a body along y that stands on y = 0: it sways from side to side while swellings run up along it.

    At time 0, and after every period, the body is in its rest pose.
    """

    length: float = 60.0
    """height of the body at rest, mm"""
    bend: float = 75.0
    """greatest angle between the top and the foot, degrees, towards +x and -x in turn"""
    swell: float = 0.3
    """largest relative change of the radius"""
    waves: float = 1.0
    """number of swellings along the body"""
    period_s: float = 4.0
    """seconds"""

    def __post_init__(self) -> None:
        checks.number(self, "length", checks.SMALLEST, checks.LENGTH, "mm")
        checks.number(self, "bend", 0, 180, "degrees")
        checks.number(self, "swell", 0, 0.9)
        checks.number(self, "waves", 0, 1000)
        checks.number(self, "period_s", 1e-3, checks.SECONDS, "seconds")

    def apply(self, positions: npt.ArrayLike, time_s: float) -> npt.NDArray[np.float32]:
        """Deform positions (V, 3) at rest to those at a time in seconds: float32 (V, 3), mm."""
        rest = np.asarray(positions, dtype=np.float64)
        phase = 2 * math.pi * ((time_s / self.period_s) % 1.0)
        x, y, z = rest.T
        along = 2 * math.pi * self.waves * y / self.length
        # A travelling wave less its own shape at time 0, so that the rest pose is the one given; at most 2 in size.
        grown = 1 + 0.5 * self.swell * (np.sin(phase - along) + np.sin(along))
        x, z = x * grown, z * grown

        # The axis becomes an arc of the same length, each cross-section staying flat and at a right angle to it.
        curvature = math.radians(self.bend) * math.sin(phase) / self.length
        angle = curvature * y
        half = np.sinc(angle / (2 * np.pi))  # sin(angle / 2) / (angle / 2), well behaved where nothing bends
        across, up = y * half * np.sin(angle / 2), y * half * np.cos(angle / 2)
        bent = np.stack([across + x * np.cos(angle), up - x * np.sin(angle), z], axis=1)
        return bent.astype(np.float32)
