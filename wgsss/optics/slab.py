"""Fourier transforms of the reflectance and the transmittance of a slab, in closed form."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.optics import fresnel
from wgsss.optics.medium import CHANNELS, Medium
from wgsss.optics.profile import Profile

Array = NDArray[np.float64]
Spectrum = NDArray[Any]  # floats at real frequencies, complex numbers at complex ones


class SlabSpectra(NamedTuple):
    """Fourier transforms (..., 3) of the R and T of a slab that is lit from above and from below.

    Mikkelsen 2009 calls them R+, T+ and R-, T-. T+ and T- differ if the boundaries do, since the source lies one mean
    free path below the lit face.
    """

    R_above: Spectrum
    T_down: Spectrum
    R_below: Spectrum
    T_up: Spectrum


class SpectralProfile(Profile):
    """A profile of a slab or a stack of layers, whose Fourier transforms over the plane are known in closed form."""

    @abstractmethod
    def spectra(self, k: ArrayLike) -> SlabSpectra:
        """Return the transforms of R and T (..., 3), for light from above and from below.

        `k` (...): angular frequencies in 1/mm. They may be complex, with a positive real part.
        """

    @property
    def total(self) -> Array:
        return self.spectrum(0.0)

    @property
    def total_transmittance(self) -> Array:
        return self.transmitted_spectrum(0.0)

    def spectrum(self, k: ArrayLike) -> Spectrum:
        """Return the Fourier transform of R over the plane, (..., 3), at `k` (...), as of `spectra`."""
        return self.spectra(k).R_above

    def transmitted_spectrum(self, k: ArrayLike) -> Spectrum:
        """Return the Fourier transform of T over the plane, (..., 3), at `k` (...), as of `spectra`."""
        return self.spectra(k).T_down


def slab_spectra(
    medium: Medium, thickness: float, above: float, below: float, k: ArrayLike, source: Array | None = None
) -> SlabSpectra:
    """Return the transforms of a finite slab between media of indices `above` and `below`, at `k` (...) in 1/mm.

    `source` (3,): depth l of the source below the lit face, mm, by default the mean free path.

    The geometric series of the images has the sums, for light from above,

        R = alpha' cosh(q z0) sinh(q (s + zs - l)) / sinh(q H)        T = alpha' cosh(q zs) sinh(q (l + z0)) / sinh(q H)

    with q^2 = sigma_tr^2 + k^2, the thickness s, z0 and zs as in `extrapolation`, and
    H = s + z0 + zs. They are computed from falling exponentials, which cannot overflow.
    """
    q = decay(medium, k)
    z0, zs = extrapolation(medium, above, below)
    s, depth = thickness, medium.mean_free_path if source is None else source
    norm = 0.5 * medium.albedo / np.expm1(-2.0 * q * (s + z0 + zs))
    reflected, passed = norm * np.exp(-q * depth), norm * np.exp(-q * (s - depth))
    mirrored_above, mirrored_below = 1.0 + np.exp(-2.0 * q * z0), 1.0 + np.exp(-2.0 * q * zs)
    return SlabSpectra(
        reflected * mirrored_above * np.expm1(-2.0 * q * (s + zs - depth)),
        passed * mirrored_below * np.expm1(-2.0 * q * (depth + z0)),
        reflected * mirrored_below * np.expm1(-2.0 * q * (s + z0 - depth)),
        passed * mirrored_above * np.expm1(-2.0 * q * (depth + zs)),
    )


def decay(medium: Medium, k: ArrayLike) -> Spectrum:
    """Return q (..., 3) in 1/mm: light of angular frequency `k` (...) falls off with depth z as exp(-q z).

    Its real part is not negative.
    """
    q = np.sqrt(np.square(medium.sigma_tr) + np.square(np.asarray(k))[..., None])
    return np.where(q == 0.0, 1e-150, q)  # ratios of sinh then have their limit for q to 0


def extrapolation(medium: Medium, above: float, below: float) -> tuple[Array, Array]:
    """Return the distances z0 and zs = 2 A D (3,), mm, beyond the two faces of a slab at which its fluence is 0.

    `above` and `below` are the refractive indices of the neighbours.
    """
    z0, zs = (2.0 * fresnel.boundary(medium.eta / eta) * medium.diffusion for eta in (above, below))
    return z0, zs


def check_thickness(medium: Medium, thickness: float, name: str) -> None:
    """Raise InputError unless a slab is thicker than its mean free path in every channel."""
    for channel, length in zip(CHANNELS, medium.mean_free_path, strict=True):
        if not thickness > length:
            raise InputError(
                f"{name} must be above the mean free path of {channel}, {length:.4g} mm, not {thickness:g}"
            )


def check_alone(medium: Medium, thickness: float, eta_below: float) -> None:
    """Raise InputError if the reflectance of a slab under air would be negative far from the point of entry.

    There the fluence is half a sine between the extrapolated boundaries. It falls off towards the top only if its peak
    is below the top.
    """
    above, below = extrapolation(medium, 1.0, eta_below)
    for channel, length, least in zip(CHANNELS, medium.mean_free_path, above - below, strict=True):
        if thickness < least:
            raise InputError(
                f"thickness must be at least {least:.4g} mm in {channel}, of mean free path {length:.4g} mm, over an "
                f"index of {eta_below:g}, or R would be negative far out, not {thickness:g}"
            )
