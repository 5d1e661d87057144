"""Signed distances to simple solids, in mm, negative inside. Points are three arrays of the same shape: x, y and z."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Field = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
Point = tuple[float, float, float]


def ball(x: np.ndarray, y: np.ndarray, z: np.ndarray, centre: Point, radius: float) -> np.ndarray:
    """Return the distance to a sphere."""
    return np.sqrt((x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2) - radius


def ellipsoid(x: np.ndarray, y: np.ndarray, z: np.ndarray, centre: Point, radii: Point) -> np.ndarray:
    """Estimate the distance to an axis-aligned ellipsoid, exact to first order at its surface (after I. Quilez)."""
    u, v, w = (x - centre[0]) / radii[0], (y - centre[1]) / radii[1], (z - centre[2]) / radii[2]
    k0 = np.sqrt(u * u + v * v + w * w)
    k1 = np.sqrt((u / radii[0]) ** 2 + (v / radii[1]) ** 2 + (w / radii[2]) ** 2)
    return k0 * (k0 - 1) / np.maximum(k1, 1e-6)


def limb(x: np.ndarray, y: np.ndarray, z: np.ndarray, a: Point, b: Point, ra: float, rb: float) -> np.ndarray:
    """Return the distance to a rod from a to b with round ends, whose radius changes linearly from ra to rb."""
    run = np.subtract(b, a)
    along = ((x - a[0]) * run[0] + (y - a[1]) * run[1] + (z - a[2]) * run[2]) / (run @ run)
    along = np.clip(along, 0, 1)
    near = [a[k] + along * run[k] for k in range(3)]
    return np.sqrt((x - near[0]) ** 2 + (y - near[1]) ** 2 + (z - near[2]) ** 2) - (ra + along * (rb - ra))


def join(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Unite two solids, and smooth the crease over a width `blend` (polynomial smooth minimum)."""
    h = np.maximum(blend - np.abs(a - b), 0)
    return np.minimum(a, b) - h * h * (0.25 / blend)


def carve(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Subtract solid b from solid a, and round the edge over a width `blend`."""
    return -join(-a, b, blend)
