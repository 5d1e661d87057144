"""A diffusion profile as a table for sums over samples of a surface, with its peak at r = 0 handled apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.optics import Profile
from wgsss.optics.lookup import interval_starts, leading_bits

Array = npt.NDArray[Any]

NEGLIGIBLE = 1e-5  # share of the light that leaves beyond the end of the table, and is neglected
# In spacings of the samples. With smaller values, the sampled function has features that samples miss. With larger
# values, a curved surface, a border or a change of the light nearby is treated as a uniformly lit plane. The tests of
# convergence check them.
RADIUS, BLUR = 0.8, 0.5
_CLOSEST = 1 / 32  # of the spacing: at smaller distances the table is constant
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True, eq=False)
class Kernel:
    """R_d = R_d chi + R_d (1 - chi), where chi falls from 1 at distance 0 to 0 at RADIUS spacings of the samples.

    Samples could miss or overestimate the first part. It is integrated analytically, as if the surface within the
    radius were a uniformly lit plane. The second part is blurred slightly, so that samples resolve it, and summed over
    the samples whose normals are within 90 degrees of the receiver's. The other samples are summed with R_d itself.
    """

    table: Array
    """float32 (2 n, 4), 1/mm^2: n rows of the second part, then n rows of R_d, by the leading bits of the squared
    distance. The last row of each is 0."""
    first: int
    """The leading bits that belong to the first row."""
    near: Array
    """float64 (3,): the integral of the first part over the plane."""
    reach: float
    """mm: beyond this distance, R_d counts as 0."""


def make_kernel(profile: Profile, spacing: float, farthest: float) -> Kernel:
    """Return the kernel of a profile for samples `spacing` mm apart, on a body that is `farthest` mm across."""
    reach = max(min(float(profile.range(NEGLIGIBLE).max()), farthest), spacing)
    first, last = leading_bits(np.square([_CLOSEST * spacing, reach])).tolist()
    r = np.sqrt(interval_starts(first, last + 2))
    table = np.zeros((2, len(r), 4))
    table[:, :, :3] = _blurred(profile, r, spacing), profile.reflectance(r)
    table[:, -1] = 0.0
    return Kernel(table.reshape(-1, 4).astype(np.float32), first, _near(profile, spacing), float(r[-1]))


def _chi(r: Array, spacing: float) -> Array:
    """Return chi (n, 1) at distances (n,): flat at 0, and twice differentiable at the radius."""
    return np.maximum(1.0 - np.square(r / (RADIUS * spacing)), 0.0)[..., None] ** 3


def _near(profile: Profile, spacing: float) -> Array:
    """Return the integral of R_d chi over the plane.

    Integration by parts turns it into an integral of the enclosed light times the slope of chi, which is smooth even if
    R_d is not.
    """
    x = 0.5 * (1.0 + _NODES)
    fall = 6.0 * x * (1.0 - x * x) ** 2
    inside = profile.enclosed(RADIUS * spacing * x)
    near: Array = profile.total * ((0.5 * _WEIGHTS * fall)[:, None] * inside).sum(axis=0)
    return near


def _blurred(profile: Profile, r: Array, spacing: float) -> Array:
    """Return R_d (1 - chi) at distances r (n,), blurred over the plane by a Gaussian: (n, 3).

    The blur fades out within five spacings, beyond which R_d changes too slowly for it to matter. The blurred part is
    scaled so that the integral over the plane does not change.
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

    sharp_total, soft_total = (((f(x) * fade(x)) * x[:, None]).sum(axis=0) for f in (sharp, soft))
    scale = np.divide(sharp_total, soft_total, out=np.ones(3), where=soft_total > 0.0)
    return sharp(r) + fade(r) * (scale * soft(r) - sharp(r))
