"""Diffusion profiles as sums of separable kernels, the form that two passes over an image can apply.

No profile but a Gaussian is a product k(x) k(y). The product of its line spreads answers to a straight edge along x or
y as the profile itself does, and errs most at 45 degrees: for d'Eon and Luebke's skin, red, by 0.074 of full scale, and
by 0.062 at 22.5 degrees. One more product brings that below 0.016 at every angle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wgsss.optics.profile import Profile

Array = NDArray[np.float64]

BEYOND = 0.003  # share of the light that may leave farther away than the kernels reach
_CELLS = 96  # from 0 to the range, ever wider: the narrowest of skin's Gaussians spans several
_TABLE = 2000  # distances that shares are tabulated at: reading between them errs by less than 1e-5
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


@dataclass(frozen=True, eq=False)
class Term:
    """One product scale k(x) k(y), with k even.

    `x` (n,) in mm from 0 to the kernel's range, ascending; `within` (n, 3) what k has from -x to x; `scale` (3,).
    """

    x: Array
    within: Array
    scale: Array


def line_spread(profile: Profile) -> tuple[Term]:
    """The product of the line spreads, of the profile's total: exact for edges along x or y."""
    x = _cells(profile, _TABLE)
    within = _within_strip(profile, x)
    return (Term(x, within / within[-1], profile.total),)


def svd(profile: Profile) -> tuple[Term, Term]:
    """The product of the line spreads and one more: the leading singular vectors of what it leaves.

    The second adds no light and changes nothing for edges along x or y: the rows of what is left sum to zero.
    """
    x = _cells(profile, _CELLS)
    mass = np.diff(np.diff(_within_rectangle(profile, x), axis=0), axis=1)
    mass /= mass.sum(axis=(0, 1))
    line = mass.sum(axis=0)
    within, scale = np.zeros((_CELLS + 1, 3)), np.zeros(3)
    for channel in range(3):
        left = mass[..., channel] - np.outer(line[:, channel], line[:, channel])
        values, vectors = np.linalg.eigh(0.5 * (left + left.T))
        leading = np.abs(values).argmax()
        within[1:, channel] = np.cumsum(vectors[:, leading])
        scale[channel] = values[leading]
    first = np.concatenate([np.zeros((1, 3)), np.cumsum(line, axis=0)])
    return Term(x, first, profile.total), Term(x, within, scale * profile.total)


def radial(profile: Profile) -> tuple[Term]:
    """R(r) itself along both axes, normalised: widely copied from the demonstration of 2012, too narrow by far.

    An edge is sharpened by 0.2 of full scale on skin: a line through the middle of R misses what spreads beside it.
    """
    x = _cells(profile, _TABLE)
    slices = profile.reflectance(0.5 * (x[1:] + x[:-1])) * np.diff(x)[:, None]
    within = np.concatenate([np.zeros((1, 3)), np.cumsum(slices, axis=0)])
    return (Term(x, within / np.where(within[-1] > 0.0, within[-1], 1.0), profile.total),)


KERNELS: dict[str, Callable[[Profile], tuple[Term, ...]]] = {"line-spread": line_spread, "svd": svd, "radial": radial}


def _cells(profile: Profile, n: int) -> Array:
    """Distances (n + 1,) from 0 to the profile's range."""
    reach = profile.range(BEYOND).max()
    return (reach if reach > 0.0 else 1.0) * np.square(np.arange(n + 1) / n)


def _within_strip(profile: Profile, x: Array) -> Array:
    """Share (n, 3) of the light that leaves between the lines at -x and x (n,)."""
    angle = 0.25 * np.pi * (_NODES + 1.0)
    share = np.tensordot(0.5 * _WEIGHTS, _enclosed(profile, x)(x / np.cos(angle)[:, None]), axes=1)
    share[0] = 0.0  # of a channel that reflects nothing too
    return share


def _within_rectangle(profile: Profile, x: Array) -> Array:
    """Share (n, n, 3) of the light that leaves in the rectangle from 0 to x (n,) and 0 to x (n,)."""
    enclosed = _enclosed(profile, x)
    share = np.zeros((x.size, x.size, 3))
    side, other = np.broadcast_arrays(x[1:, None], x[1:])
    most = np.arctan2(other, side)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):  # over the directions that leave through the far side
        angle = 0.5 * most * (node + 1.0)
        share[1:, 1:] += (0.5 * weight * most)[..., None] * enclosed(side / np.cos(angle))
    return (share + share.swapaxes(0, 1)) / (2.0 * np.pi)


def _enclosed(profile: Profile, x: Array) -> Callable[[Array], Array]:
    """The share (..., 3) within a radius, from a table: it is asked for at many."""
    r = np.concatenate([[0.0], np.geomspace(1e-5 * x[-1], 10.0 * x[-1], _TABLE)])
    table = profile.enclosed(r)
    return lambda radius: np.stack([np.interp(radius, r, column) for column in table.T], axis=-1)
