"""Averages of Fresnel's reflectance inside a medium, as polynomials in its relative index."""

from __future__ import annotations


def diffuse_fresnel(eta: float) -> float:
    """Fdr: the share of diffuse light reflected back inside at the boundary of a medium of relative index `eta`.

    Polynomial fits of Egan and Hilgeman, as in Jensen et al. 2001; `eta` is inside over outside, 1/3 to 3. Within 0.002
    for 0.6 to 2, and 0 where there is no boundary, at 1, of which the fits miss by 0.0016.
    """
    if eta == 1.0:
        return 0.0
    if eta > 1.0:
        return -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    return -0.4399 + 0.7099 / eta - 0.3319 / eta**2 + 0.0636 / eta**3


def boundary(eta: float) -> float:
    """A = (1 + Fdr) / (1 - Fdr), the internal reflection in the boundary condition (004 eq. 23)."""
    fdr = diffuse_fresnel(eta)
    return (1.0 + fdr) / (1.0 - fdr)


def two_c1(eta: float) -> float:
    """2 C_1, twice the first moment of Fresnel's reflectance inside: d'Eon's fit, within 0.001 for 1.2 to 2.

    The same quantity as `diffuse_fresnel` by another polynomial. `eta` >= 1.
    """
    return _polynomial(eta, 0, (-9.23372, 22.2272, -20.9292, 10.2291, -2.54396, 0.254913))


def three_c2(eta: float) -> float:
    """3 C_2, three times the second moment of Fresnel's reflectance inside: d'Eon's fit, within 0.004 for 1.2 to 2.

    `eta` >= 1.
    """
    return _polynomial(eta, -3, (135.926, -656.175, 1376.53, -1641.1, 1213.67, -568.556, 164.798, -27.0181, 1.91826))


def _polynomial(x: float, lowest: int, terms: tuple[float, ...]) -> float:
    return sum(term * x ** (lowest + i) for i, term in enumerate(terms))
