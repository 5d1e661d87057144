"""The light of point sources in an unbounded diffusive medium that passes a plane.

`z`: distance of the source from the plane, mm. Its sign is that of the flux. `sigma_tr`: effective transport
coefficient, 1/mm; 0 is the limit without absorption. Results are per unit of power, fluences phi times the diffusion
coefficient D. Arguments broadcast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def flux(sigma_tr: Array, z: Array, r: Array) -> Array:
    """Return the flux through the plane at distance `r` from the foot of the source, 1/mm^2 (Mikkelsen 2009, 2.6)."""
    d = np.hypot(r, z)
    return z * (sigma_tr * d + 1.0) * np.exp(-sigma_tr * d) / (4.0 * np.pi * d**3)


def flux_beyond(sigma_tr: Array, z: Array, r: Array) -> Array:
    """Return the integral of `flux` over the plane outside a circle of radius `r`, without unit."""
    d = np.hypot(r, z)
    return 0.5 * z * np.exp(-sigma_tr * d) / d


def flux_along(sigma_tr: Array, z: Array, x: Array) -> Array:
    """Return the integral of `flux` along the line at distance `x` from the foot of the source, 1/mm."""
    from scipy.special import k1

    rho = np.hypot(x, z)
    a = sigma_tr * rho
    tail = np.where(a > 1e-9, a * k1(np.maximum(a, 1e-9)), 1.0)
    return z * tail / (2.0 * np.pi * np.square(rho))


def fluence_pair(sigma_tr: Array, z: Array, z_far: Array, r: Array) -> Array:
    """Return D phi in the plane at `r`, of a source at `z` less that of one at `z_far`, 1/mm."""
    d, d_far, gap = _distances(z, z_far, r)
    return np.exp(-sigma_tr * d) * (gap / d - np.expm1(-sigma_tr * gap)) / (4.0 * np.pi * d_far)


def fluence_pair_beyond(sigma_tr: Array, z: Array, z_far: Array, r: Array) -> Array:
    """Return the integral of `fluence_pair` over the plane outside a circle of radius `r`, mm."""
    d, _, gap = _distances(z, z_far, r)
    sigma = np.maximum(sigma_tr, 1e-12)
    return -0.5 * np.exp(-sigma * d) * np.expm1(-sigma * gap) / sigma


def fluence_pair_along(sigma_tr: Array, z: Array, z_far: Array, x: Array) -> Array:
    """Return the integral of `fluence_pair` along the line at distance `x`, without unit."""
    from scipy.special import k0

    near, far = np.hypot(x, z), np.hypot(x, z_far)
    sigma = np.maximum(sigma_tr, 1e-9 / far)  # K0 is a logarithm there: the difference does not depend on sigma
    return (k0(sigma * near) - k0(sigma * far)) / (2.0 * np.pi)


def _distances(z: Array, z_far: Array, r: Array) -> tuple[Array, Array, Array]:
    """Return the distances of two sources, and their difference, computed without cancellation."""
    d, d_far = np.hypot(r, z), np.hypot(r, z_far)
    return d, d_far, (np.square(z_far) - np.square(z)) / (d_far + d)
