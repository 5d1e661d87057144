"""Samples of profiles for fits, and their r-weighted energy (Jimenez & Gutierrez 2008, eq. 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wgsss.optics.profile import Profile

Array = NDArray[np.float64]

# Ten decades of distances around the scale of a profile. The integrands are smooth in log r and vanish at both ends:
# the trapezoid rule converges faster than any power of the step.
DISTANCES = np.geomspace(1e-5, 1e5, 400)
MEASURE = (np.square(DISTANCES) * np.log(DISTANCES[1] / DISTANCES[0]))[:, None]  # r dr

# If R is infinite at r = 0, so is the integral of eq. 2, and the best Gaussian would be an invisibly narrow one. Such a
# profile is taken as constant within the radius that encloses this share of its light.
_CORE = 0.01


def scale(profile: Profile) -> Array:
    """Return the distance (3,), mm, within which about half of the light leaves; 1 for a black channel."""
    r = np.geomspace(1e-12, 1e12, 400)
    inside = np.cumsum(np.square(r)[:, None] * profile.reflectance(r), axis=0)
    return np.where(inside[-1] > 0, r[(inside < 0.5 * inside[-1]).sum(axis=0)], 1.0)


def raw(profile: Profile, unit: Array) -> Array:
    """Return R at DISTANCES times `unit` (3,), mm, a unit for each channel: (DISTANCES.size, 3) in 1/unit^2."""
    return np.square(unit) * np.einsum("ncc->nc", profile.reflectance(DISTANCES[:, None] * unit))


def levelled(profile: Profile, unit: Array) -> Array:
    """Return R as `raw` does, but constant near r = 0 if it is infinite there."""
    R = raw(profile, unit)
    inside = np.cumsum(MEASURE * R, axis=0)
    level = np.where(inside < _CORE * inside[-1], 0.0, R).max(axis=0)
    return np.where(np.isinf(profile.reflectance(0.0)), np.minimum(R, level), R)


def root_energy(R: Array) -> Array:
    """Return the square root (c,) of the integral of r R^2 dr over samples R (DISTANCES.size, c)."""
    return np.sqrt((MEASURE * np.square(R)).sum(axis=0))
