"""Tables of diffusion profiles: at which distances a profile is tabulated, and how a distance finds its entry.

Shaders read them by the functions of `wgsl/profile_table.wgsl`. There are four kinds, each for its reader:

- by the leading bits of the squared distance (`leading_bits`), for sums over very many pairs of points: a lookup takes
  a shift and no root or logarithm. Entries are either at the lower ends of the intervals (`interval_starts`), to be
  interpolated, or in their middles (`interval_middles`), where one read has to do;
- `log_table`, log2 of R_d over log2 of the squared distance, for ratios of form factors: exponents can be added and
  subtracted where R_d itself would underflow;
- `root_spaced`, for a transmittance by thickness: it starts at thickness 0, and its entries are densest there;
- `geometric`, for `numpy.interp`: it spans decades with the same relative step.

Distances are in mm, squared distances in mm^2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss import wgsl
from wgsss.optics.profile import Profile

Array = NDArray[Any]

SHIFT = wgsl.load("profile_table").constants["SHIFT"]
"""Low bits of a float32 that the leading bits leave out: 15, so that each doubling has 2^(23 - 15) = 256 entries."""

_LEAST = 1e-36  # 1/mm^2: R_d may underflow to 0, which has no logarithm


def leading_bits(numbers: ArrayLike, shift: int = SHIFT) -> Array:
    """Return the leading bits of positive numbers (...), such as squared distances: int32 (...).

    They are the bits of the number as a float32 without the last `shift`. They grow with the number, and count
    intervals in proportion to its size. The leading bits of a negative number are negative.
    """
    return np.asarray(numbers, np.float32).view(np.int32) >> np.int32(shift)


def interval_starts(first: int, end: int, shift: int = SHIFT) -> Array:
    """Return the least numbers whose leading bits are `first` to `end` - 1: float64 (end - first,)."""
    bits = np.arange(first, end, dtype=np.int32) << np.int32(shift)
    return bits.view(np.float32).astype(np.float64)


def interval_middles(first: int, end: int, shift: int = SHIFT) -> Array:
    """Return the middles of the intervals of numbers whose leading bits are `first` to `end` - 1, as above."""
    edges = interval_starts(first, end + 1, shift)
    return 0.5 * (edges[:-1] + edges[1:])


class LogTable(NamedTuple):
    """log2 of R_d at equal steps of log2 of the squared distance."""

    low: float
    """log2 of the first squared distance, mm^2"""
    steps: float
    """Number of entries for each doubling of the squared distance."""
    values: Array
    """float64 (n, 4): log2 of R_d in 1/mm^2 by RGB channel; the last column, which pads a row to 16 bytes, is 0"""


def log_table(profile: Profile, nearest: float, farthest: float, count: int) -> LogTable:
    """Return log2 of R_d at `count` squared distances from `nearest`^2 to `farthest`^2, at equal steps of log2."""
    low, high = 2.0 * np.log2([nearest, farthest])
    R = profile.reflectance(np.exp2(0.5 * np.linspace(low, high, count)))
    values = np.zeros((count, 4))
    values[:, :3] = np.log2(np.maximum(R, _LEAST))
    return LogTable(float(low), (count - 1) / float(high - low), values)


def root_spaced(farthest: float, count: int) -> Array:
    """Return `count` distances (count,) from 0 to `farthest`, whose square roots are equally spaced."""
    spaced: Array = farthest * np.square(np.linspace(0.0, 1.0, count))
    return spaced


def geometric(nearest: float, farthest: float, count: int) -> Array:
    """Return `count` distances (count,) from `nearest` to `farthest`, whose logarithms are equally spaced."""
    return np.geomspace(nearest, farthest, count)
