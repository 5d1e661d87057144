"""Diffusion profiles of a slab: a dipole and its mirror images in the two boundaries of the slab."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.optics import sources
from wgsss.optics.medium import LONGEST, Medium, check_index
from wgsss.optics.profile import distances, shares
from wgsss.optics.slab import SlabSpectra, SpectralProfile, check_alone, check_thickness, extrapolation, slab_spectra
from wgsss.text import shown
from wgsss.values import is_number

Array = NDArray[np.float64]

# Images i and -i almost cancel; without absorption these pairs fall off as 1/i^3. Pairs beyond this index n are summed
# by the Euler-Maclaurin formula: their integral from n + 1/2 on, and its derivatives there as differences of the pairs
# n - 1 to n + 2.
_MOST_IMAGES = 32
_END = np.array([0.0, -1.0, 1.0, 0.0]) / 24.0 - np.array([-1.0, 3.0, -3.0, 1.0]) * 17.0 / 5760.0 + [1.0, 1.0, 0.0, 0.0]
# Modes are used from the distance on where the second mode has fallen off by a factor e^-_DECAY more than the first.
# There _MODES modes reach the accuracy of rounding.
_DECAY, _MODES = 2.0, 20


@dataclass(frozen=True, eq=False)
class Multipole(Medium, SpectralProfile):
    """A slab under air, lit from above.

    `thickness`: mm, finite, and above the mean free path in every channel, since the real source lies at that depth.
    `eta_below`: refractive index of the medium below, relative to air, 1 to 3. If it is near that of the slab, the
    bottom reflects little, and the slab must be up to two mean free paths thick. Raises InputError, naming the channel
    and its mean free path, for thinner slabs: their R or T would be negative somewhere.

    Source: Mikkelsen 2009, eq. 31 and 32; Contini et al. 1997. The profile is the light that leaves at the top, and
    `transmittance` that at the bottom, per unit of flux that has entered. The relative error of both sums is 1e-11 at
    all distances. In slabs thinner than four mean free paths, or with a low albedo, traced photons give values that
    differ by 5 to 20 %.
    """

    _: KW_ONLY
    thickness: float
    eta_below: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_index("eta_below", self.eta_below)
        if not (is_number(self.thickness) and self.thickness <= LONGEST):
            most = f"{LONGEST:g} at most (mm)"
            raise InputError(f"thickness must be a finite number, {most}, not {shown(self.thickness)}")
        check_thickness(self, self.thickness, "thickness")
        check_alone(self, self.thickness, self.eta_below)

    def spectra(self, k: ArrayLike) -> SlabSpectra:
        return slab_spectra(self, self.thickness, 1.0, self.eta_below, k)

    def reflectance(self, r: ArrayLike) -> Array:
        return self._reflected(_POINT, r)

    def transmittance(self, r: ArrayLike) -> Array:
        """Return T(r) in 1/mm^2, (..., 3): light that leaves at the bottom, `r` (...) mm from below the entry."""
        z0, _ = extrapolation(self, 1.0, self.eta_below)
        real, virtual = self.thickness - self.mean_free_path, self.thickness + self.mean_free_path + 2.0 * z0
        return self._radiated(_POINT, r, real, virtual, -1.0)

    def beyond(self, r: ArrayLike) -> Array:
        return shares(self._reflected(_BEYOND, r), self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        return self._reflected(_ALONG, np.abs(np.asarray(x, dtype=np.float64)))

    def _reflected(self, term: _Term, r: ArrayLike) -> Array:
        """Return the sum of `term` over all sources, for the light that leaves at the top."""
        z0, _ = extrapolation(self, 1.0, self.eta_below)
        return self._radiated(term, r, self.mean_free_path, self.mean_free_path + 2.0 * z0, 1.0)

    def _radiated(self, term: _Term, r: ArrayLike, real: Array, virtual: Array, sign: float) -> Array:
        """Return the light (..., 3) of two sources and all their images through a face at `r` (...) mm.

        The face is `real` and `virtual` (3,) mm away from the two sources; `sign` is that of the virtual source. Near
        the entry the images are summed. Far from it they cancel each other: there the same sum is computed over the
        modes between the extrapolated boundaries (by Poisson's formula), which fall off as exp(-r pi m / H).
        """
        r = distances(r)
        z0, zs = extrapolation(self, 1.0, self.eta_below)
        H = self.thickness + z0 + zs
        first = np.hypot(self.sigma_tr, np.pi / H)
        reach = _DECAY * (first + self.sigma_tr) * np.square(H / np.pi)  # _DECAY / (first - sigma_tr)
        sent = np.empty((*r.shape, 3))
        for c in range(3):
            far = r > reach[c]
            for at, summed in ((far, _modes), (~far, _images)):
                terms = [summed(term, self.sigma_tr[c], z, H[c], r[at], reach[c]) for z in (real[c], virtual[c])]
                sent[at, c] = self.albedo[c] * (terms[0] + sign * terms[1])
        return np.maximum(sent, 0.0)  # rounding


class _Term(NamedTuple):
    """What is summed: the light at a point, that beyond a radius, or that along a line."""

    source: Callable[..., Array]
    """of one source"""
    tail: Callable[..., Array]
    """the integral over the images beyond a depth"""
    mode: Callable[[Array, Array], Array]
    """of one mode, which falls off as K_0(s r)"""


def _mode(s: Array, r: Array) -> Array:
    """Return a mode at distance `r`."""
    from scipy.special import k0

    return k0(s * r)


def _mode_beyond(s: Array, r: Array) -> Array:
    """Return the integral of a mode over the plane outside a circle of radius `r`."""
    from scipy.special import k1

    return 2.0 * np.pi * r * k1(s * r) / s


def _mode_along(s: Array, x: Array) -> Array:
    """Return the integral of a mode along a line at distance `x`."""
    return np.pi * np.exp(-s * x) / s


_POINT = _Term(sources.flux, sources.fluence_pair, _mode)
_BEYOND = _Term(sources.flux_beyond, sources.fluence_pair_beyond, _mode_beyond)
_ALONG = _Term(sources.flux_along, sources.fluence_pair_along, _mode_along)


def _images(term: _Term, sigma_tr: float, z: float, H: float, r: Array, reach: float) -> Array:
    """Return the sum over all i of the flux of a source at `z` + 2 H i, 0 < `z` < 2 H, at `r` (n,) up to `reach`."""
    period = 2.0 * H
    n = _MOST_IMAGES
    if sigma_tr > 0.0:  # fewer suffice: absorption leaves less than exp(-36) of the light of farther images
        n = min(n, 3 + math.ceil(math.sqrt((36.0 / sigma_tr) ** 2 + 72.0 * reach / sigma_tr) / period))
    offsets = period * np.arange(1.0, n + 3.0)[:, None]
    weights = np.ones(n + 2)
    weights[-4:] = _END
    pairs = term.source(sigma_tr, offsets + z, r) - term.source(sigma_tr, offsets - z, r)
    end = (n + 0.5) * period
    return term.source(sigma_tr, z, r) + weights @ pairs - term.tail(sigma_tr, end - z, end + z, r) / period


def _modes(term: _Term, sigma_tr: float, z: float, H: float, r: Array, reach: float) -> Array:
    """Return the same sum as `_images`, over the modes sin(m pi z / H), at `r` (n,) beyond `reach`."""
    m = np.arange(1.0, _MODES + 1.0)
    weights = m * np.sin(np.pi * m * z / H) / (2.0 * H * H)
    return weights @ term.mode(np.hypot(sigma_tr, np.pi * m / H)[:, None], r)
