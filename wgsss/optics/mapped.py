"""A layer whose thickness and scattering vary over a surface: its blurs as sums of the same Gaussians everywhere.

Diffusion theory needs layers thicker than a mean free path. A map of thickness goes down to 0, so here thinner ones
have another source: the light that scatters inside the layer starts from the mean depth of its first scattering event,
and the rest passes unscattered. Between one and two mean free paths the two blend; beyond two it is the slab of
Mikkelsen 2009, section 2.7.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.optics.medium import Layer, Medium
from wgsss.optics.slab import SlabSpectra, slab_spectra

Array = NDArray[np.float64]

GAUSSIANS = 6
_SHARP = 0.02
"""sigma of the narrowest Gaussian, in the least mean free path: it stands for light that passes unscattered"""
_NARROW = 0.4
"""sigma of the second, in the least mean free path"""
_WIDEST = 12.0
"""largest sigma of the last, in the largest mean free path"""
_INFINITE = 1e9
"""mm: in place of an infinite thickness"""
_LEAST = 1e-3
"""the least share of the scattering: a medium of diffusion theory scatters"""
_SHARES, _COLORS = 33, 17


def layer_spectra(layer: Medium, thickness: float, above: float, below: float, k: ArrayLike) -> SlabSpectra:
    """Return the transforms of a layer of any thickness >= 0 between media of indices `above` and `below`."""
    s = min(thickness, _INFINITE)
    mfp = layer.mean_free_path
    passed = np.exp(-s / mfp)
    inside = -np.expm1(-s / mfp)
    depth = np.where(s > 1e-4 * mfp, mfp - s * passed / np.maximum(inside, 1e-300), 0.5 * s)
    thin = slab_spectra(layer, s, above, below, k, depth)
    thin = SlabSpectra(
        inside * thin.R_above, inside * thin.T_down + passed, inside * thin.R_below, inside * thin.T_up + passed
    )
    thick = np.clip(s / mfp - 1.0, 0.0, 1.0)
    if not thick.any():
        return thin
    least = np.maximum(s, mfp)  # channels that are thinner do not count, but must not overflow
    slab = slab_spectra(layer, least, above, below, k)  # type: ignore[arg-type]
    return SlabSpectra(*((1.0 - thick) * a + thick * b for a, b in zip(thin, slab, strict=True)))


def shared_variances(layers: Sequence[Layer]) -> Array:
    """Return the variances (GAUSSIANS,), mm^2, with which the light in all layers of a stack is blurred."""
    shortest = min(float(layer.mean_free_path.min()) for layer in layers)
    reach = max(
        float(np.minimum(1.5 * layer.diffuse_mean_free_path, _WIDEST * layer.mean_free_path).max()) for layer in layers
    )
    sigmas = np.geomspace(_NARROW * shortest, max(reach, 2.0 * shortest), GAUSSIANS - 1)
    return np.square(np.append(_SHARP * shortest, sigmas))


def layer_table(layer: Layer, above: float, below: float, variances: Array, *, shares: bool, colors: bool) -> Array:
    """Fit the weights of the Gaussians of a layer between media of indices `above` and `below`.

    Returns (3 GAUSSIANS + 1, colors, shares, 3): by row the weights of R for light from above, of T downwards and of T
    upwards, and last the total of R for light from below. Entry i of n along an axis is at the share (i / (n - 1))^2 of
    the scattering or the thickness, since thin layers change fastest, or at 1 if n is 1.

    `shares`, `colors`: whether its thickness and its scattering vary; otherwise the table has one entry along the axis.
    The fit is over the spectra of the blurs, by least squares over log k with weights >= 0, and keeps their totals.
    """
    sigmas = np.sqrt(variances)
    k = np.append(0.0, np.geomspace(0.05 / sigmas[-1], 2.0 / sigmas[1], 40))
    basis = np.exp(-0.5 * np.square(k)[:, None] * variances)
    thickness = layer.thickness * shares_at(_SHARES if shares else 1)
    scattering = shares_at(_COLORS if colors else 1)
    rows = np.empty((3 * GAUSSIANS + 1, len(scattering), len(thickness), 3))
    for i, color in enumerate(scattering):
        medium = Medium(layer.sigma_a, layer.sigma_s_prime * max(color, _LEAST), layer.eta)
        for j, s in enumerate(thickness):
            spectra = layer_spectra(medium, s, above, below, k)
            for part, transform in enumerate((spectra.R_above, spectra.T_down, spectra.T_up)):
                rows[part * GAUSSIANS : (part + 1) * GAUSSIANS, i, j] = _weights(basis, transform)
            rows[-1, i, j] = spectra.R_below[0]
    return rows


def shares_at(n: int) -> Array:
    """Return the shares (n,) of the entries of a table."""
    return np.ones(1) if n == 1 else np.square(np.arange(n) / (n - 1))


def _weights(basis: Array, transform: Array) -> Array:
    """Return the weights (m, 3) >= 0 of a basis (n, m) nearest to a transform (n, 3), whose first row is the total."""
    from scipy.optimize import nnls

    emphasis = np.where(np.arange(len(basis)) == 0, 30.0, 1.0)[:, None]
    weights = np.stack([nnls(emphasis * basis, y)[0] for y in (emphasis * np.maximum(transform, 0.0)).T], axis=-1)
    total = weights.sum(axis=0)
    return np.asarray(weights * np.where(total > 0.0, transform[0] / np.where(total > 0.0, total, 1.0), 1.0))
