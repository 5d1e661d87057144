"""Normalized diffusion (Christensen and Burley 2015): two exponentials, fitted to photons traced in a half space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.optics.medium import FARTHEST, coefficients
from wgsss.optics.profile import Profile, distances

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NormalizedDiffusion(Profile):
    """R(r) = A (exp(-r / d) + exp(-r / 3d)) / (8 pi d r): single and multiple scattering together.

    `albedo` (3,): the surface albedo A, 0 to 1, which is the total of the profile. `d` (3,): mm, above 0. R is infinite
    at r = 0, but the light within r goes to 0 with r. Raises InputError, naming the channel, for other values.

    The class methods are the three fits of the source: each computes d = length / s(A) from another length.
    """

    albedo: Array
    d: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "albedo", _albedo(self.albedo))
        object.__setattr__(self, "d", coefficients("d", self.d, 0.0, FARTHEST, "mm", above=True))

    @classmethod
    def searchlight(cls, albedo: ArrayLike, mean_free_path: ArrayLike) -> Self:
        """Return the profile for a narrow beam normal to the surface: s = 1.85 - A + 7 |A - 0.8|^3.

        `albedo` (3,): the surface albedo A, 0 to 1. `mean_free_path` (3,): 1 / sigma_t' of the medium, mm. Raises
        InputError for values out of range.
        """
        A, length = _albedo(albedo), coefficients("mean_free_path", mean_free_path, 0.0, FARTHEST, "mm", above=True)
        return cls(A, length / (1.85 - A + 7.0 * np.abs(A - 0.8) ** 3))

    @classmethod
    def diffuse(cls, albedo: ArrayLike, mean_free_path: ArrayLike) -> Self:
        """Return the profile for light that is diffuse as it enters the medium: s = 1.9 - A + 3.5 (A - 0.8)^2.

        `albedo` (3,): the surface albedo A, 0 to 1. `mean_free_path` (3,): 1 / sigma_t' of the medium, mm. Raises
        InputError for values out of range.
        """
        A, length = _albedo(albedo), coefficients("mean_free_path", mean_free_path, 0.0, FARTHEST, "mm", above=True)
        return cls(A, length / (1.9 - A + 3.5 * np.square(A - 0.8)))

    @classmethod
    def from_diffuse_mean_free_path(cls, albedo: ArrayLike, diffuse_mean_free_path: ArrayLike) -> Self:
        """Return the profile for a narrow beam from the diffuse mean free path: s = 3.5 + 100 (A - 0.33)^4.

        `albedo` (3,): the surface albedo A, 0 to 1. `diffuse_mean_free_path` (3,): 1 / sigma_tr of the medium, mm.
        Raises InputError for values out of range.
        """
        A = _albedo(albedo)
        length = coefficients("diffuse_mean_free_path", diffuse_mean_free_path, 0.0, FARTHEST, "mm", above=True)
        return cls(A, length / (3.5 + 100.0 * (A - 0.33) ** 4))

    @property
    def total(self) -> Array:
        return self.albedo

    def reflectance(self, r: ArrayLike) -> Array:
        r = distances(r)[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            R = self.albedo * (np.exp(-r / self.d) + np.exp(-r / (3.0 * self.d))) / (8.0 * np.pi * self.d * r)
        return np.where(self.albedo > 0.0, R, 0.0)

    def beyond(self, r: ArrayLike) -> Array:
        r = distances(r)[..., None]
        return np.where(self.albedo > 0.0, 0.25 * np.exp(-r / self.d) + 0.75 * np.exp(-r / (3.0 * self.d)), 0.0)

    def line_spread(self, x: ArrayLike) -> Array:
        """Return R integrated along a line at distance |x| (...) mm: (..., 3) in 1/mm, infinite at x = 0."""
        from scipy.special import k0

        x = distances(np.abs(np.asarray(x, dtype=np.float64)))[..., None]
        along = (k0(x / self.d) + k0(x / (3.0 * self.d))) / (4.0 * np.pi * self.d)
        return np.where(self.albedo > 0.0, np.maximum(self.albedo, 1e-300) * along, 0.0)


def _albedo(values: ArrayLike) -> Array:
    return coefficients("albedo", values, 0.0, 1.0)
