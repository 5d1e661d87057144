"""Profiles from their Fourier transforms over the plane, by integrals along a ray into the complex plane.

For J0(k r) one takes the Hankel function H0(k r), whose real part it is, and turns the path of k by 45 degrees: there
H0 falls off exponentially instead of oscillating, as do the transforms of slabs, which have no pole between the real
and the imaginary axis. In log k the trapezoid rule then converges exponentially.

`spectrum(k)` gives the transform (..., 3) at complex k (...). `r` and `x` (...) are mm and at least 1e-6 of the
smallest length in the medium. Results are good to 1e-13 of spectrum(0), spread over a circle of radius r.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Transform = Callable[[Any], NDArray[Any]]

# Distances to take at a time: some 60 MB.
_BLOCK = 1024


def plane(spectrum: Transform, r: Array) -> Array:
    """The profile (..., 3) in 1/mm^2: 1/(2 pi) times the integral of spectrum(k) J0(k r) k over k from 0."""
    return _along_ray(_rays().plane, spectrum, r) / (2.0 * np.pi * np.square(r)[..., None])


def outside(spectrum: Transform, r: Array) -> Array:
    """The profile's integral (..., 3) outside of a circle: spectrum(0) - r int spectrum(k) J1(k r) dk."""
    # H1 has a pole at 0, and turning the path half-way around it takes half of the residue.
    return 0.5 * spectrum(0.0) - _along_ray(_rays().outside, spectrum, r)


def line(spectrum: Transform, x: Array) -> Array:
    """The profile's integral (..., 3) along a line, in 1/mm: 1/pi times that of spectrum(k) cos(k x) over k from 0."""
    return _along_ray(_rays().line, spectrum, x) / (np.pi * x[..., None])


class _Rays(NamedTuple):
    """Nodes (n,) of k r and weights (n,) of each integral."""

    u: Complex
    plane: Complex
    outside: Complex
    line: Complex


@cache
def _rays() -> _Rays:
    from scipy.special import hankel1

    step = 0.14  # the error is exp(-2 pi (pi/4) / step): the integrands are analytic 45 degrees to either side
    size = np.exp(np.arange(np.log(1e-13), np.log(60.0), step))
    turn = np.exp(0.25j * np.pi)
    u = size * turn
    du = step * u
    along = np.exp(1j * u) * du
    along[0] += du[0] / np.expm1(step)  # this one falls off like u only: what lies below the first node
    return _Rays(u, hankel1(0, u) * u * du, hankel1(1, u) * du, along)


def _along_ray(weights: Complex, spectrum: Transform, r: Array) -> Array:
    u = _rays().u
    flat = r.ravel()
    found = np.empty((flat.size, 3))
    for start in range(0, flat.size, _BLOCK):
        block = flat[start : start + _BLOCK]
        found[start : start + _BLOCK] = np.tensordot(weights, spectrum(u[:, None] / block), axes=1).real
    return found.reshape(*r.shape, 3)
