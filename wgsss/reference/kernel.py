"""A diffusion profile as a table for sums over samples of a surface, without the spike that samples would miss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.optics import Profile
from wgsss.optics.lookup import interval_starts, leading_bits

Array = npt.NDArray[Any]

NEGLIGIBLE = 1e-5  # share of the light that leaves beyond the table, and is left out
# Both in spacings of the samples. With less, what is sampled has features that samples miss; with more, a surface that
# bends or ends nearby, and light that changes there, count as flat and level. See the tests of convergence.
RADIUS, BLUR = 0.8, 0.5
_CLOSEST = 1 / 32  # of the spacing: closer, the table is level
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True, eq=False)
class Kernel:
    """R_d = R_d chi + R_d (1 - chi), with chi falling from 1 at distance 0 to 0 at RADIUS spacings of the samples.

    The second part, blurred a little so that samples tell all of it, is summed over the sheet that a receiver lies on.
    The first part, which samples may miss or take for too much, is taken as light that is the same all over that radius
    on a plane: its integral is known. What lies on opposite sheets is sampled as it is.
    """

    table: Array
    """float32 (2 n, 4): the second part and R_d, each n rows by the leading bits of the squared distance, 1/mm^2; 0 in
    the last of the n"""
    first: int
    """the bits of the first row"""
    near: Array
    """float64 (3,): the integral of the first part over the plane"""
    reach: float
    """mm: beyond, R_d counts as 0"""


def make_kernel(profile: Profile, spacing: float, farthest: float) -> Kernel:
    """The kernel of a profile for samples `spacing` mm apart on a body of `farthest` mm across."""
    reach = max(min(float(profile.range(NEGLIGIBLE).max()), farthest), spacing)
    first, last = leading_bits(np.square([_CLOSEST * spacing, reach])).tolist()
    r = np.sqrt(interval_starts(first, last + 2))
    table = np.zeros((2, len(r), 4))
    table[:, :, :3] = _blurred(profile, r, spacing), profile.reflectance(r)
    table[:, -1] = 0.0
    return Kernel(table.reshape(-1, 4).astype(np.float32), first, _near(profile, spacing), float(r[-1]))


def _chi(r: Array, spacing: float) -> Array:
    """By rows (n, 1) of distances: level at 0, with two derivatives at the radius."""
    return np.maximum(1.0 - np.square(r / (RADIUS * spacing)), 0.0)[..., None] ** 3


def _near(profile: Profile, spacing: float) -> Array:
    """The integral of R_d chi: by parts, what is enclosed weighted by how chi falls, smooth where R_d is not."""
    x = 0.5 * (1.0 + _NODES)
    fall = 6.0 * x * (1.0 - x * x) ** 2
    inside = profile.enclosed(RADIUS * spacing * x)
    near: Array = profile.total * ((0.5 * _WEIGHTS * fall)[:, None] * inside).sum(axis=0)
    return near


def _blurred(profile: Profile, r: Array, spacing: float) -> Array:
    """R_d (1 - chi) at distances r (n,), blurred over the plane by a Gaussian: (n, 3).

    Some spacings away, where R_d is too level for a blur to matter, it is left as it is; the light that the blur has
    carried there is given back nearer by, so that the integral over the plane is kept.
    """
    from scipy.special import ive

    def sharp(r: Array) -> Array:
        return profile.reflectance(r) * (1.0 - _chi(r, spacing))

    def fade(r: Array) -> Array:
        return np.clip(5.0 - r / spacing, 0.0, 1.0)[:, None] ** 2

    sigma = BLUR * spacing
    x = np.linspace(0.0, 10.0 * spacing, 2001)[1:]
    at = np.linspace(0.0, 5.0 * spacing, 201)
    spread = np.exp(-np.square(at[:, None] - x) / (2.0 * sigma**2)) * ive(0, at[:, None] * x / sigma**2)
    blurred = (spread * (x * x[0] / sigma**2)) @ sharp(x)

    def soft(r: Array) -> Array:
        return np.stack([np.interp(r, at, blurred[:, c]) for c in range(3)], axis=-1)

    kept, left = (((f(x) * fade(x)) * x[:, None]).sum(axis=0) for f in (sharp, soft))
    scale = np.divide(kept, left, out=np.ones(3), where=left > 0.0)
    return sharp(r) + fade(r) * (scale * soft(r) - sharp(r))
