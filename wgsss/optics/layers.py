"""Diffusion profiles of stacks of layers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.optics import hankel
from wgsss.optics.medium import Layer, check_index, stack
from wgsss.optics.profile import distances, shares
from wgsss.optics.slab import (
    SlabSpectra,
    SpectralProfile,
    check_alone,
    check_thickness,
    decay,
    extrapolation,
    slab_spectra,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Layers(SpectralProfile):
    """A stack of layers under air, lit from above.

    `layers`: from the top down. Each layer of finite thickness must be thicker than its mean free path in every
    channel. `eta_below`: refractive index of the medium below a finite last layer, relative to air, 1 to 3. Raises
    InputError for other values, naming the layer, the channel and its mean free path.

    Source: Donner and Jensen 2005; Mikkelsen 2009, section 2.7.2. The R and T of each layer are those of a `Multipole`
    between the indices of its neighbours, or of a `Dipole` if it is infinitely thick. The Fourier transforms of two
    layers are combined in a geometric series over the light that goes back and forth between them. The model assumes
    that light enters each layer from a source one mean free path deep, so splitting a layer in two changes the result.

    The profile is the light that leaves at the top, and `transmittance` that at the bottom, per unit of flux that has
    entered. Their error is 1e-14 of the total over 2 pi r^2. Negative values are set to 0. They come from rounding, or
    from the model itself: far from the entry, in layers hardly thicker than a mean free path, they would reach 0.2 % of
    R and 2 % of T.
    """

    layers: Sequence[Layer]
    eta_below: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "layers", stack(self.layers))
        check_index("eta_below", self.eta_below)
        for number, layer in enumerate(self.layers, start=1):
            check_thickness(layer, layer.thickness, f"thickness of layer {number}")
        if len(self.layers) == 1:
            check_alone(self.layers[0], self.layers[0].thickness, self.eta_below)

    def reflectance(self, r: ArrayLike) -> Array:
        return np.maximum(hankel.plane(self.spectrum, self._resolved(r)), 0.0)

    def transmittance(self, r: ArrayLike) -> Array:
        """Return T(r) in 1/mm^2, (..., 3): light that leaves at the bottom, `r` (...) mm from below the entry."""
        return np.maximum(hankel.plane(self.transmitted_spectrum, self._resolved(r)), 0.0)

    def beyond(self, r: ArrayLike) -> Array:
        return shares(hankel.outside(self.spectrum, self._resolved(r)), self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        x = np.abs(np.asarray(x, dtype=np.float64))
        return np.maximum(hankel.line(self.spectrum, self._resolved(x)), 0.0)

    def _resolved(self, r: ArrayLike) -> Array:
        """Return distances (...), mm, of at least 1e-5 mean free paths: nearer, profiles are constant."""
        return np.maximum(distances(r), 1e-5 * min(layer.mean_free_path.min() for layer in self.layers))

    def spectra(self, k: ArrayLike) -> SlabSpectra:
        indices = [1.0, *(layer.eta for layer in self.layers), self.eta_below]
        joined, *others = (
            _layer_spectra(layer, above, below, k)
            for layer, above, below in zip(self.layers, indices, indices[2:], strict=False)
        )
        for other in others:
            joined = _join(joined, other)
        return joined


def _layer_spectra(layer: Layer, above: float, below: float, k: ArrayLike) -> SlabSpectra:
    """Return the transforms of one layer between media of indices `above` and `below` at `k` (...)."""
    if not math.isinf(layer.thickness):
        return slab_spectra(layer, layer.thickness, above, below, k)
    q = decay(layer, k)
    z0, _ = extrapolation(layer, above, 1.0)
    nothing = np.zeros_like(q)
    R = 0.5 * layer.albedo * np.exp(-q * layer.mean_free_path) * (1.0 + np.exp(-2.0 * q * z0))
    return SlabSpectra(R, nothing, nothing, nothing)


def _join(upper: SlabSpectra, lower: SlabSpectra) -> SlabSpectra:
    """Return the transforms of two slabs, one on top of the other (Mikkelsen 2009, section 2.7.3)."""
    between = 1.0 / (1.0 - upper.R_below * lower.R_above)
    return SlabSpectra(
        upper.R_above + upper.T_down * lower.R_above * upper.T_up * between,
        upper.T_down * lower.T_down * between,
        lower.R_below + lower.T_up * upper.R_below * lower.T_down * between,
        lower.T_up * upper.T_up * between,
    )
