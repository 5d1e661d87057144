"""Conversion of colours to linear RGB of Rec. 709, the colour space of all radiance in this package."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x and y of red, green, blue and white (ITU-R BT.709)"""
EQUAL_ENERGY = (1 / 3, 1 / 3)
"""x and y of the white point with equal CIE X, Y and Z"""
# Matrix from CIE XYZ to cone responses for chromatic adaptation (Bradford; Lam 1985).
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def from_primaries(chromaticities: Sequence[float] | Array) -> Array | None:
    """Compute the matrix (3, 3) from linear RGB with other primaries to linear RGB of Rec. 709. White stays white.

    `chromaticities` (8,) are x and y of red, green, blue and white. Returns None if they are those of Rec. 709. Raises
    InputError if they do not span a colour space.
    """
    values = np.asarray(chromaticities, np.float64)
    if np.allclose(values, REC709, atol=2e-3):
        return None
    matrix = rgb_to_xyz(values)
    return from_xyz(values[6:]) @ matrix


def from_xyz(white: Sequence[float] | Array = REC709[6:]) -> Array:
    """Compute the matrix (3, 3) from CIE XYZ to linear RGB of Rec. 709 that maps the white point (x, y) to white."""
    return np.linalg.inv(rgb_to_xyz(np.asarray(REC709))) @ _adaptation(white)


def transformed(pixels: Array, matrix: Array) -> npt.NDArray[np.float32]:
    """Multiply pixels (..., 3) by a matrix (3, 3). The result does not depend on the number of threads."""
    m = matrix.astype(np.float32)
    total: npt.NDArray[np.float32] = pixels[..., 0:1] * m[:, 0]
    for i in (1, 2):
        total += pixels[..., i : i + 1] * m[:, i]
    return total


def luminance_weights(chromaticities: Sequence[float] | Array) -> Array:
    """Compute the weights (3,) of red, green and blue in luminance, given x and y of red, green, blue and white."""
    return rgb_to_xyz(np.asarray(chromaticities, np.float64))[1]


def rgb_to_xyz(chromaticities: Array) -> Array:
    """Compute the matrix (3, 3) from linear RGB to CIE XYZ, with Y = 1 for white (SMPTE RP 177)."""
    x, y = chromaticities.reshape(4, 2).T
    with np.errstate(all="ignore"):
        columns = np.stack([x, y, 1.0 - x - y])
        white = columns[:, 3] / y[3]
        try:
            matrix = columns[:, :3] * np.linalg.solve(columns[:, :3], white)
        except np.linalg.LinAlgError:
            matrix = np.full((3, 3), np.nan)
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-6 or white.min() < 0.0:
        raise InputError(f"the primaries {' '.join(f'{v:g}' for v in chromaticities)} do not span a colour space")
    return matrix


def _adaptation(white: Sequence[float] | Array) -> Array:
    """Compute the matrix (3, 3) in CIE XYZ that adapts the white point (x, y) to that of Rec. 709."""
    target, source = (_BRADFORD @ [w[0] / w[1], 1.0, (1.0 - w[0] - w[1]) / w[1]] for w in (REC709[6:], white))
    return np.linalg.solve(_BRADFORD, (target / source)[:, None] * _BRADFORD)
