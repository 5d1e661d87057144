"""A diffusion profile as a table for sums over samples of a surface, without the spike that samples would miss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.optics import Profile

Array = npt.NDArray[Any]

NEGLIGIBLE = 1e-5  # share of the light that leaves beyond the table, and is left out
_CLOSEST = 1 / 64  # of the radius within which samples give way: closer, the table is level
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True, eq=False)
class Kernel:
    """R_d = R_d chi + R_d (1 - chi), with chi falling from 1 at distance 0 to 0 at `radius`.

    The second part is what is sampled of the sheet that a receiver lies on; where R_d is narrower than samples are
    apart, they would miss it or take it for too much. The first part is taken as light that is the same all over
    `radius`, on a plane: its integral is known. What lies on opposite sheets is sampled as it is.
    """

    table: Array
    """float32 (n, 4): R_d (1/mm^2) and 1 - chi by the leading bits of the squared distance; 0 in the last row"""
    first: int
    """the bits of the first row"""
    near: Array
    """float64 (3,): the integral of R_d chi over the plane"""
    reach: float
    """mm: beyond, R_d counts as 0"""


def make_kernel(profile: Profile, radius: float, farthest: float) -> Kernel:
    """The kernel of a profile, for samples that give way within `radius` mm, on a body of `farthest` mm across."""
    shift = wgsl.load("reference/integral").constants["SHIFT"]
    reach = max(min(float(profile.range(NEGLIGIBLE).max()), farthest), radius)

    def bits(r: float) -> int:
        return int(np.float32(r * r).view(np.uint32)) >> shift

    first, last = bits(_CLOSEST * radius), bits(reach) + 1
    squares = (np.arange(first, last + 1, dtype=np.uint32) << shift).view(np.float32).astype(np.float64)
    table = np.column_stack([profile.reflectance(np.sqrt(squares)), 1.0 - _chi(squares / radius**2)])
    table[-1] = 0.0
    return Kernel(table.astype(np.float32), first, _near(profile, radius), float(np.sqrt(squares[-1])))


def _chi(square: Array) -> Array:
    """By the square of the distance over the radius: level at 0, with two derivatives at 1."""
    return np.maximum(1.0 - square, 0.0) ** 3


def _near(profile: Profile, radius: float) -> Array:
    """The integral of R_d chi: by parts, what is enclosed weighted by how chi falls, smooth where R_d is not."""
    x = 0.5 * (1.0 + _NODES)
    fall = 6.0 * x * (1.0 - x * x) ** 2
    inside = profile.enclosed(radius * x)
    near: Array = profile.total * ((0.5 * _WEIGHTS * fall)[:, None] * inside).sum(axis=0)
    return near
