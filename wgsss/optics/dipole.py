"""Diffusion profiles of a half space by a real and a mirrored point source."""

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
    """The classical dipole (Jensen et al. 2001, as corrected by 004 eq. 30), of a `Medium` under air.

    The profile is per unit of flux that entered the medium: Fresnel losses on the way in and out are the renderer's.
    """

    @property
    def z_r(self) -> Array:
        """Depth of the real source (3,) in mm: a mean free path."""
        return self.mean_free_path

    @property
    def z_v(self) -> Array:
        """Height of the virtual source (3,) in mm: the real one mirrored in the extrapolated boundary, 2 A D above."""
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
        """What leaves, from what the two sources send through the surface."""
        return self.albedo * self._both(flux, distances(r)[..., None])

    def _both(self, flux: Term, r: Array) -> Array:
        return flux(self.sigma_tr, self.z_r, r) + flux(self.sigma_tr, self.z_v, r)

    @classmethod
    def from_reflectance(cls, reflectance: ArrayLike, *, eta: float = 1.3, **length: ArrayLike) -> Self:
        """The medium whose `total` is `reflectance` (3,), above 0 and below 1, under this model's boundary.

        That boundary is a smooth one under air which reflects diffuse light inside as an index of `eta` does; `eta` = 1
        is the index-matched case. Give one length (3,) in mm: `mean_free_path`, 1 / sigma_t', or
        `diffuse_mean_free_path`, 1 / sigma_tr. Raises InputError, naming the channel, for what no medium has.
        """
        from scipy.optimize import brentq

        if length.keys() not in ({"mean_free_path"}, {"diffuse_mean_free_path"}):
            raise InputError("give mean_free_path or diffuse_mean_free_path, one of them")
        wanted = coefficients("reflectance", reflectance, 0.0, 1.0, above=True)
        ((name, value),) = length.items()
        scale = coefficients(name, value, SHORTEST, LONGEST, "mm")

        def unit(albedo: float) -> Dipole:  # a mean free path of 1 mm
            return cls(np.full(3, 1.0 - albedo), np.full(3, albedo), eta)

        least, most = 1e-9, 1.0 - 1e-12
        low, high = unit(least).total[0], unit(most).total[0]
        albedo = np.empty(3)
        for i, R in enumerate(wanted):
            if not low < R < high:
                bounds = f"above {low:.2g} and below {high:.4g}"
                raise InputError(f"reflectance of {CHANNELS[i]} must be {bounds}, not {R:g}")
            albedo[i] = brentq(lambda a, R=R: unit(a).total[0] - R, least, most, xtol=1e-15, rtol=1e-14)
        if name == "diffuse_mean_free_path":
            scale = scale * np.array([unit(a).sigma_tr[0] for a in albedo])
        for i, sigma in enumerate(albedo / scale):
            if not THINNEST <= sigma <= DENSEST:
                found = f"sigma_s' would be {sigma:.3g}, and must be {span(THINNEST, DENSEST, unit='1/mm')}"
                raise InputError(f"{name} of {CHANNELS[i]} does not go with its reflectance: {found}")
        return cls((1.0 - albedo) / scale, albedo / scale, eta)


class BetterDipole(Dipole):
    """The better dipole (d'Eon 2012): Grosjean's diffusion coefficient, and a boundary that lets out fluence and flux.

    It holds light that was scattered more than once, hence its alpha'^2.
    """

    @property
    def diffusion(self) -> Array:
        """Grosjean's diffusion coefficient (2 sigma_a + sigma_s') / (3 sigma_t'^2) (3,) in mm."""
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
