"""Profiles sampled where fits compare them, and the r-weighted energy of the samples (003 eq. 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wgsss.optics.profile import Profile

Array = NDArray[np.float64]

# Ten decades of distances about a profile's own scale. The integrands are smooth in log r and vanish at both ends,
# where the trapezoid rule converges faster than any power of the step.
DISTANCES = np.geomspace(1e-5, 1e5, 400)
MEASURE = (np.square(DISTANCES) * np.log(DISTANCES[1] / DISTANCES[0]))[:, None]  # r dr

# Where R is infinite at r = 0, so is the integral of eq. 2, and the best Gaussian would be a needle that nobody sees.
# Such a profile is taken as level within the radius that holds this share of its light.
_CORE = 0.01


def scale(profile: Profile) -> Array:
    """The distance (3,) in mm within which about half of the light leaves; 1 for a black channel."""
    r = np.geomspace(1e-12, 1e12, 400)
    inside = np.cumsum(np.square(r)[:, None] * profile.reflectance(r), axis=0)
    return np.where(inside[-1] > 0, r[(inside < 0.5 * inside[-1]).sum(axis=0)], 1.0)


def raw(profile: Profile, unit: Array) -> Array:
    """R (DISTANCES.size, 3) in 1/unit^2 at the distances in a `unit` (3,) per channel, in mm."""
    return np.square(unit) * np.einsum("ncc->nc", profile.reflectance(DISTANCES[:, None] * unit))


def levelled(profile: Profile, unit: Array) -> Array:
    """R as `raw` gives it, taken as level near r = 0 where it is infinite there."""
    R = raw(profile, unit)
    inside = np.cumsum(MEASURE * R, axis=0)
    level = np.where(inside < _CORE * inside[-1], 0.0, R).max(axis=0)
    return np.where(np.isinf(profile.reflectance(0.0)), np.minimum(R, level), R)


def root_energy(R: Array) -> Array:
    """The root (c,) of the integral of r R^2 dr over samples R (DISTANCES.size, c)."""
    return np.sqrt((MEASURE * np.square(R)).sum(axis=0))
