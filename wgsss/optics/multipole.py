"""Diffusion profiles of a slab: a dipole mirrored again and again in the slab's two boundaries."""

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
from wgsss.optics.profile import Profile, distances, shares
from wgsss.optics.slab import Spectrum, check_alone, check_thickness, extrapolation, slab_spectra
from wgsss.text import shown
from wgsss.values import is_number

Array = NDArray[np.float64]

# Images i and -i almost cancel; without absorption such pairs fall off as 1/i^3. Those beyond this one are summed by
# Euler and Maclaurin: the integral from n + 1/2, and for its derivatives there differences of the pairs n - 1 to n + 2.
_MOST_IMAGES = 32
_END = np.array([0.0, -1.0, 1.0, 0.0]) / 24.0 - np.array([-1.0, 3.0, -3.0, 1.0]) * 17.0 / 5760.0 + [1.0, 1.0, 0.0, 0.0]
# From where modes take over: there the second falls off by e^-2 more than the first, and 20 reach rounding.
_DECAY, _MODES = 2.0, 20


@dataclass(frozen=True, eq=False)
class Multipole(Medium, Profile):
    """A slab under air, lit from above: what leaves at its top and at its bottom (004 eq. 31, 32; Contini et al. 1997).

    `thickness`: mm, finite and above the mean free path in every channel, as the real source lies that deep.
    `eta_below`: index of what lies below, relative to air, 1 to 3. Where it is near the slab's, whose bottom then
    reflects little, the slab must be up to two mean free paths thick. Raises InputError, naming the channel and its
    mean free path, for slabs that are thinner: their R or T would be negative somewhere.

    The profile is what leaves at the top, `transmittance` what leaves at the bottom, per unit of flux that entered.
    Both sums are good to a relative 1e-11 at all distances. Photons in a slab of fewer than four mean free paths, or of
    a low albedo, leave in numbers 5 to 20 % different.
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

    @property
    def total(self) -> Array:
        return self.spectrum(0.0)

    @property
    def total_transmittance(self) -> Array:
        """T_tot (3,): the integral of T over the plane."""
        return self.transmitted_spectrum(0.0)

    def spectrum(self, k: ArrayLike) -> Spectrum:
        """Fourier transform of R over the plane, (..., 3), at angular frequencies `k` (...) in 1/mm.

        `k` may be complex, with a positive real part.
        """
        return slab_spectra(self, self.thickness, 1.0, self.eta_below, k).R_above

    def transmitted_spectrum(self, k: ArrayLike) -> Spectrum:
        """Fourier transform of T over the plane: see `spectrum`."""
        return slab_spectra(self, self.thickness, 1.0, self.eta_below, k).T_down

    def reflectance(self, r: ArrayLike) -> Array:
        return self._reflected(_POINT, r)

    def transmittance(self, r: ArrayLike) -> Array:
        """T(r) in 1/mm^2, (..., 3): what leaves at the bottom `r` (...) mm from straight below the entry."""
        z0, _ = extrapolation(self, 1.0, self.eta_below)
        real, virtual = self.thickness - self.mean_free_path, self.thickness + self.mean_free_path + 2.0 * z0
        return self._radiated(_POINT, r, real, virtual, -1.0)

    def beyond(self, r: ArrayLike) -> Array:
        return shares(self._reflected(_BEYOND, r), self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        return self._reflected(_ALONG, np.abs(np.asarray(x, dtype=np.float64)))

    def _reflected(self, term: _Term, r: ArrayLike) -> Array:
        z0, _ = extrapolation(self, 1.0, self.eta_below)
        return self._radiated(term, r, self.mean_free_path, self.mean_free_path + 2.0 * z0, 1.0)

    def _radiated(self, term: _Term, r: ArrayLike, real: Array, virtual: Array, sign: float) -> Array:
        """What the images of two sources send through a face that lies `real` and `virtual` (3,) mm from them.

        Near, a sum over the images, which cancel each other ever more farther out; there the same sum as modes
        between the extrapolated boundaries (its Poisson sum), which fall off like exp(-r pi m / H) instead.
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
    """What is summed: of a source, of its tail of images (by `z`), and of a mode that falls off like K_0(s r)."""

    source: Callable[..., Array]
    tail: Callable[..., Array]
    mode: Callable[[Array, Array], Array]


def _mode(s: Array, r: Array) -> Array:
    from scipy.special import k0

    return k0(s * r)


def _mode_beyond(s: Array, r: Array) -> Array:
    from scipy.special import k1

    return 2.0 * np.pi * r * k1(s * r) / s


def _mode_along(s: Array, x: Array) -> Array:
    return np.pi * np.exp(-s * x) / s


_POINT = _Term(sources.flux, sources.fluence_pair, _mode)
_BEYOND = _Term(sources.flux_beyond, sources.fluence_pair_beyond, _mode_beyond)
_ALONG = _Term(sources.flux_along, sources.fluence_pair_along, _mode_along)


def _images(term: _Term, sigma_tr: float, z: float, H: float, r: Array, reach: float) -> Array:
    """The sum over all i of the flux of a source at `z` + 2 H i, 0 < `z` < 2 H, at `r` (n,) up to `reach`."""
    period = 2.0 * H
    n = _MOST_IMAGES
    if sigma_tr > 0.0:  # fewer where exp(-36) of the light is left at `reach`
        n = min(n, 3 + math.ceil(math.sqrt((36.0 / sigma_tr) ** 2 + 72.0 * reach / sigma_tr) / period))
    offsets = period * np.arange(1.0, n + 3.0)[:, None]
    weights = np.ones(n + 2)
    weights[-4:] = _END
    pairs = term.source(sigma_tr, offsets + z, r) - term.source(sigma_tr, offsets - z, r)
    end = (n + 0.5) * period
    return term.source(sigma_tr, z, r) + weights @ pairs - term.tail(sigma_tr, end - z, end + z, r) / period


def _modes(term: _Term, sigma_tr: float, z: float, H: float, r: Array, reach: float) -> Array:
    """The sum of `_images` over the modes sin(m pi z / H), at `r` (n,) beyond `reach`."""
    m = np.arange(1.0, _MODES + 1.0)
    weights = m * np.sin(np.pi * m * z / H) / (2.0 * H * H)
    return weights @ term.mode(np.hypot(sigma_tr, np.pi * m / H)[:, None], r)
