"""Diffusion profiles as sums of Gaussians, which separable blurs can apply."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.optics.medium import MOST_TOTAL
from wgsss.optics.profile import Profile, distances, shares
from wgsss.text import shown, span
from wgsss.values import array_of

Array = NDArray[np.float64]

_NARROWEST, _WIDEST = 1e-18, 1e18  # mm^2: of variances

_erf = np.vectorize(math.erf, otypes=[np.float64])


@dataclass(frozen=True, eq=False)
class SumOfGaussians(Profile):
    """R(r) = sum_k w_k G(v_k, r) with G(v, r) = exp(-r^2 / 2v) / (2 pi v), whose integral over the plane is 1.

    `variances`, mm^2: either (k,), ascending, shared by the channels, as blurs need them; or (k, 3), a column for each
    channel, not descending. A channel with fewer Gaussians repeats its last variance with the weight 0.
    `weights` (k, 3): at least 0, without unit. Raises InputError for other values.
    Source: Mikkelsen 2009, section 3.4; Jimenez & Gutierrez 2008, eq. 2.
    """

    variances: Array
    weights: Array

    def __post_init__(self) -> None:
        try:
            variances, weights = array_of(self.variances), array_of(self.weights)
        except ValueError:
            raise InputError("variances and weights of a sum of Gaussians must be numbers, in rows of 3") from None
        shaped = weights.shape[1:] == (3,) and variances.shape in (weights.shape[:1], weights.shape)
        if not shaped or weights.size == 0:
            raise InputError(
                "a sum of Gaussians needs k variances, or k rows of 3, and k rows of 3 weights, "
                f"not shapes {variances.shape} and {weights.shape}"
            )
        steps = np.diff(variances, axis=0)
        ascending = np.all(steps > 0 if variances.ndim == 1 else steps >= 0)
        if not (np.all((variances >= _NARROWEST) & (variances <= _WIDEST)) and ascending):
            condition = f"positive and ascending, {span(_NARROWEST, _WIDEST, unit='mm^2')}"
            raise InputError(f"variances must be {condition}, not {shown(variances.tolist())}")
        if not (np.all(weights >= 0) and np.all(weights.sum(axis=0) <= MOST_TOTAL)):
            raise InputError(
                f"weights must not be negative, and sum to {MOST_TOTAL:g} at most, not {shown(weights.tolist())}"
            )
        variances.flags.writeable = weights.flags.writeable = False
        object.__setattr__(self, "variances", variances)
        object.__setattr__(self, "weights", weights)

    @property
    def total(self) -> Array:
        """Total diffuse reflectance R_d (3,): the integral of R over the plane."""
        return self.weights.sum(axis=0)

    def reflectance(self, r: ArrayLike) -> Array:
        return self._sum(gaussian(self._v, _each(distances(r))))

    def beyond(self, r: ArrayLike) -> Array:
        return shares(self._sum(np.exp(-np.square(_each(distances(r))) / (2.0 * self._v))), self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        return self._sum(np.exp(-np.square(_each(x)) / (2.0 * self._v)) / np.sqrt(2.0 * np.pi * self._v))

    def step_response(self, x: ArrayLike) -> Array:
        """Return the radiosity (..., 3) at `x` (...) mm from a straight edge, if the side x > 0 has unit irradiance."""
        return self._sum(0.5 * (1.0 + _erf(_each(x) / np.sqrt(2.0 * self._v))))

    @property
    def _v(self) -> Array:
        """The variances (k, 1) or (k, 3)."""
        return self.variances.reshape(len(self.variances), -1)

    def _sum(self, terms: Array) -> Array:
        """Return the weighted sum (..., 3) of `terms` (..., k, 1 or 3) of the Gaussians."""
        return (terms * self.weights).sum(axis=-2)


def _each(r: ArrayLike) -> Array:
    """Return `r` (...) with two more axes, for the Gaussians and the channels."""
    return np.asarray(r, dtype=np.float64)[..., None, None]


def gaussian(variance: ArrayLike, r: ArrayLike) -> Array:
    """Return G(v, r) in 1/mm^2 at distances `r` mm: the Gaussian of `variance` mm^2 with integral 1 over the plane."""
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
"""Skin by d'Eon and Luebke: a fit to a multipole of three layers (Mikkelsen 2009, table 4).

Each channel sums to 1: the colour of skin comes from a map.
"""
