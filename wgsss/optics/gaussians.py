"""Diffusion profiles as sums of Gaussians, the form that separable blurs can apply."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.optics.profile import Profile

Array = NDArray[np.float64]

_erf = np.vectorize(math.erf, otypes=[np.float64])


@dataclass(frozen=True, eq=False)
class SumOfGaussians(Profile):
    """R(r) = sum_k w_k G(v_k, r) with G(v, r) = exp(-r^2 / 2v) / (2 pi v), whose integral over the plane is 1.

    `variances`: (k,) in mm^2, ascending. `weights`: (k, 3), per RGB channel, dimensionless.
    Raises InputError for anything else. Source: 004 section 3.4, 003 eq. 2.
    """

    variances: Array
    weights: Array

    def __post_init__(self) -> None:
        variances = np.array(self.variances, dtype=np.float64)
        weights = np.array(self.weights, dtype=np.float64)
        if variances.ndim != 1 or variances.size == 0 or weights.shape != (variances.size, 3):
            raise InputError(
                "a sum of Gaussians needs k variances and k rows of 3 weights, "
                f"not shapes {variances.shape} and {weights.shape}"
            )
        if not (np.all(np.isfinite(variances)) and variances[0] > 0 and np.all(np.diff(variances) > 0)):
            raise InputError(f"variances must be positive and ascending (mm^2), not {variances.tolist()}")
        if not (np.all(np.isfinite(weights)) and np.all(weights >= 0)):
            raise InputError(f"weights must be finite and not negative, not {weights.tolist()}")
        variances.flags.writeable = weights.flags.writeable = False
        object.__setattr__(self, "variances", variances)
        object.__setattr__(self, "weights", weights)

    @property
    def total(self) -> Array:
        """Total diffuse reflectance R_d (3,): the integral of R over the plane."""
        return self.weights.sum(axis=0)

    def reflectance(self, r: ArrayLike) -> Array:
        """R(r) in 1/mm^2, shape (..., 3), at distances `r` (...) in mm."""
        return gaussian(self.variances, np.asarray(r, dtype=np.float64)[..., None]) @ self.weights

    def step_response(self, x: ArrayLike) -> Array:
        """Radiosity (..., 3) at `x` (...) mm from a straight edge, where the side x > 0 receives unit irradiance."""
        t = np.asarray(x, dtype=np.float64)[..., None] / np.sqrt(2.0 * self.variances)
        return 0.5 * (1.0 + _erf(t)) @ self.weights


def gaussian(variance: ArrayLike, r: ArrayLike) -> Array:
    """G(v, r) in 1/mm^2, the radial Gaussian of `variance` mm^2 normalised over the plane."""
    v = np.asarray(variance, dtype=np.float64)
    return np.exp(-np.square(np.asarray(r, dtype=np.float64)) / (2.0 * v)) / (2.0 * np.pi * v)


SKIN_GAUSSIANS = SumOfGaussians(
    variances=np.array([0.0064, 0.0484, 0.187, 0.567, 1.99, 7.41]),
    weights=np.array(
        [
            [0.233, 0.455, 0.649],
            [0.100, 0.336, 0.344],
            [0.118, 0.198, 0.000],
            [0.113, 0.007, 0.007],
            [0.358, 0.004, 0.000],
            [0.078, 0.000, 0.000],
        ]
    ),
)
"""Skin of d'Eon and Luebke, a fit to a three-layer multipole (004 table 4). White: each channel sums to 1."""
