"""Moments of the Fresnel reflectance inside a medium, as polynomials in its relative refractive index."""

from __future__ import annotations


def diffuse_fresnel(eta: float) -> float:
    """Return Fdr, the share of diffuse light inside a medium that its boundary reflects back inside, 0 to 1.

    `eta`: index inside over index outside, 1/3 to 3. Source: polynomial fits of Egan and Hilgeman, as in Jensen et al.
    2001. They are within 0.002 for indices from 0.6 to 2. For eta = 1 there is no boundary, and the result is 0, where
    the fit gives 0.0016.
    """
    if eta == 1.0:
        return 0.0
    if eta > 1.0:
        return -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    return -0.4399 + 0.7099 / eta - 0.3319 / eta**2 + 0.0636 / eta**3


def boundary(eta: float) -> float:
    """Return A = (1 + Fdr) / (1 - Fdr), the internal reflection in the boundary condition (Mikkelsen 2009, eq. 23).

    `eta` as in `diffuse_fresnel`.
    """
    fdr = diffuse_fresnel(eta)
    return (1.0 + fdr) / (1.0 - fdr)


def two_c1(eta: float) -> float:
    """Return 2 C_1, twice the first moment of the Fresnel reflectance inside a medium of index `eta` >= 1.

    It is the same quantity as `diffuse_fresnel`, by the fit of d'Eon (2012), within 0.001 for indices from 1.2 to 2.
    """
    return _polynomial(eta, 0, (-9.23372, 22.2272, -20.9292, 10.2291, -2.54396, 0.254913))


def three_c2(eta: float) -> float:
    """Return 3 C_2, three times the second moment of the Fresnel reflectance inside a medium of index `eta` >= 1.

    Source: the fit of d'Eon (2012), within 0.004 for indices from 1.2 to 2.
    """
    return _polynomial(eta, -3, (135.926, -656.175, 1376.53, -1641.1, 1213.67, -568.556, 164.798, -27.0181, 1.91826))


def _polynomial(x: float, lowest: int, coefficients: tuple[float, ...]) -> float:
    """Evaluate a polynomial whose first coefficient is that of x^lowest."""
    return sum(coefficient * x ** (lowest + i) for i, coefficient in enumerate(coefficients))
