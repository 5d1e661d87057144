"""Diffusion profiles of a half space, from a point source in it and its mirror image above the surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.optics import fresnel, sources
from wgsss.optics.medium import CHANNELS, DENSEST, LONGEST, SHORTEST, THINNEST, Medium, coefficients
from wgsss.optics.profile import Profile, distances, shares
from wgsss.text import span

Array = NDArray[np.float64]
Term = Callable[..., Array]


class Dipole(Medium, Profile):
    """The classical dipole of a half space of a `Medium` under air.

    Source: Jensen et al. 2001, as corrected by Mikkelsen 2009, eq. 30. The profile is per unit of flux that has entered
    the medium. It leaves out the Fresnel losses on the way in and out, which the renderer applies.
    """

    @property
    def z_r(self) -> Array:
        """Depth of the real source (3,), mm: one mean free path."""
        return self.mean_free_path

    @property
    def z_v(self) -> Array:
        """Height of the virtual source (3,), mm: the real one mirrored in the plane 2 A D above the surface."""
        return self.z_r + 4.0 * fresnel.boundary(self.eta) * self.diffusion

    @property
    def total(self) -> Array:
        return self._radiated(sources.flux_beyond, sources.fluence_pair_beyond, 0.0)

    def reflectance(self, r: ArrayLike) -> Array:
        return self._radiated(sources.flux, sources.fluence_pair, r)

    def beyond(self, r: ArrayLike) -> Array:
        return shares(self._radiated(sources.flux_beyond, sources.fluence_pair_beyond, r), self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        return self._radiated(sources.flux_along, sources.fluence_pair_along, np.abs(np.asarray(x)))

    def _radiated(self, flux: Term, fluence: Term, r: ArrayLike) -> Array:
        """Return the light that leaves at `r` (...), (..., 3), from the terms of one source.

        `flux` and `fluence` are functions of `sources`, for a point, a line or the plane beyond r.
        """
        return self.albedo * self._both(flux, distances(r)[..., None])

    def _both(self, flux: Term, r: Array) -> Array:
        return flux(self.sigma_tr, self.z_r, r) + flux(self.sigma_tr, self.z_v, r)

    @classmethod
    def from_reflectance(cls, reflectance: ArrayLike, *, eta: float = 1.3, **length: ArrayLike) -> Self:
        """Return the medium with a given total reflectance and a given length.

        `reflectance` (3,): the `total` of the profile, above 0 and below 1. `eta`: refractive index relative to air; 1
        means a boundary without reflection. `length`: either `mean_free_path`, 1 / sigma_t', or
        `diffuse_mean_free_path`, 1 / sigma_tr, (3,) in mm. Raises InputError, naming the channel, if no medium has
        these values.
        """
        from scipy.optimize import brentq

        if length.keys() not in ({"mean_free_path"}, {"diffuse_mean_free_path"}):
            raise InputError("give one length: mean_free_path or diffuse_mean_free_path")
        totals = coefficients("reflectance", reflectance, 0.0, 1.0, above=True)
        ((name, value),) = length.items()
        scale = coefficients(name, value, SHORTEST, LONGEST, "mm")

        def unit(albedo: float) -> Dipole:
            """Return the dipole of a medium with a mean free path of 1 mm."""
            return cls(np.full(3, 1.0 - albedo), np.full(3, albedo), eta)

        least, most = 1e-9, 1.0 - 1e-12
        low, high = unit(least).total[0], unit(most).total[0]
        albedo = np.empty(3)
        for i, R in enumerate(totals):
            if not low < R < high:
                bounds = f"above {low:.2g} and below {high:.4g}"
                raise InputError(f"reflectance of {CHANNELS[i]} must be {bounds}, not {R:g}")
            albedo[i] = brentq(lambda a, R=R: unit(a).total[0] - R, least, most, xtol=1e-15, rtol=1e-14)
        if name == "diffuse_mean_free_path":
            scale = scale * np.array([unit(a).sigma_tr[0] for a in albedo])
        for i, sigma in enumerate(albedo / scale):
            if not THINNEST <= sigma <= DENSEST:
                reason = f"sigma_s' would be {sigma:.3g}, and must be {span(THINNEST, DENSEST, unit='1/mm')}"
                raise InputError(f"{name} of {CHANNELS[i]} does not fit its reflectance: {reason}")
        return cls((1.0 - albedo) / scale, albedo / scale, eta)


class BetterDipole(Dipole):
    """The better dipole of a half space under air (d'Eon 2012).

    It differs from `Dipole` by Grosjean's diffusion coefficient and by an exitance that depends on fluence and flux. It
    counts only light that was scattered at least twice, hence its factor alpha'^2.
    """

    @property
    def diffusion(self) -> Array:
        """Grosjean's diffusion coefficient (2 sigma_a + sigma_s') / (3 sigma_t'^2) (3,), mm."""
        return (2.0 * self.sigma_a + self.sigma_s_prime) / (3.0 * np.square(self.sigma_t_prime))

    @property
    def z_v(self) -> Array:
        A = (1.0 + fresnel.three_c2(self.eta)) / (1.0 - fresnel.two_c1(self.eta))
        return self.z_r + 4.0 * A * self.diffusion

    def _radiated(self, flux: Term, fluence: Term, r: ArrayLike) -> Array:
        r = distances(r)[..., None]
        c_phi, c_e = (1.0 - fresnel.two_c1(self.eta)) / 4.0, (1.0 - fresnel.three_c2(self.eta)) / 2.0
        phi = fluence(self.sigma_tr, self.z_r, self.z_v, r) / self.diffusion
        return np.square(self.albedo) * (c_phi * phi + c_e * self._both(flux, r))
