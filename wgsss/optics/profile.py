"""The interface of every diffusion profile."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError

Array = NDArray[np.float64]

# Integrals over all distances run over log r between these, mm. The profiles of materials lie well inside.
_NEAREST, _FARTHEST = 1e-9, 1e9


class Profile(ABC):
    """R(r): the radiant exitance, in 1/mm^2 per RGB channel, at distance r from the point where unit flux has entered.

    A model defines `total` and `reflectance`. The other methods compute integrals of these by quadrature, with a
    relative error of about 1e-9, unless the model overrides them with a closed form. Distances are in mm. Methods raise
    InputError for distances that are negative or NaN.
    """

    @property
    @abstractmethod
    def total(self) -> Array:
        """Total diffuse reflectance R_tot (3,): the integral of R over the plane (Mikkelsen 2009, eq. 37)."""

    @abstractmethod
    def reflectance(self, r: ArrayLike) -> Array:
        """Return R(r) in 1/mm^2, (..., 3), at distances `r` (...) mm."""

    @property
    def total_transmittance(self) -> Array:
        """Total diffuse transmittance (3,): the integral of T over the plane; 0 for an infinitely thick medium."""
        return np.zeros(3)

    def transmittance(self, r: ArrayLike) -> Array:
        """Return T(r) in 1/mm^2, (..., 3): the exitance on the far side of a slab at `r` (...) mm.

        It is 0 for an infinitely thick medium.
        """
        return np.zeros((*distances(r).shape, 3))

    def beyond(self, r: ArrayLike) -> Array:
        """Return the share (..., 3) of the total that leaves farther than `r` (...) mm away, 1 to 0.

        It is epsilon of Mikkelsen 2009, eq. 40, and 0 for a black channel.
        """
        r = distances(r)
        t, weights = _nodes()
        span = np.log(_FARTHEST / np.maximum(r, _NEAREST))
        far = np.exp(np.log(np.maximum(r, _NEAREST)) + span * t[:, *(None,) * r.ndim])  # (nodes, ...)
        ring = 2.0 * np.pi * np.square(far)[..., None] * self.reflectance(far)
        outside = np.tensordot(weights, ring, axes=1) * span[..., None]
        return shares(outside, self.total)

    def enclosed(self, r: ArrayLike) -> Array:
        """Return the share (..., 3) of the total that leaves within `r` (...) mm, 0 to 1; 1 for a black channel."""
        return 1.0 - self.beyond(r)

    def range(self, eps: float = 0.01) -> Array:
        """Return d_max (3,), mm: the distance within which all but a share `eps` of the light leaves.

        Source: Mikkelsen 2009, eq. 40. It is 0 for a black channel. Raises InputError unless 0 < eps < 1.
        """
        from scipy.optimize import elementwise

        if not 0.0 < eps < 1.0:
            raise InputError(f"eps, the share of the light left out, must be between 0 and 1, not {eps}")
        d_max = np.zeros(3)
        for channel in np.flatnonzero(self.total > 0.0):

            def excess(log_r: ArrayLike, channel: Any = channel) -> Array:
                return np.log(np.maximum(self.beyond(np.exp(log_r))[..., channel], 1e-300) / eps)

            low, high = -1.0, 1.0  # doubled until the root is between them; it is unique, since the share falls with r
            while low > np.log(_NEAREST) and excess(low) < 0.0:
                low *= 2.0
            while high < np.log(_FARTHEST) and excess(high) > 0.0:
                high *= 2.0
            d_max[channel] = np.exp(elementwise.find_root(excess, (low, high)).x)
        return d_max

    def line_spread(self, x: ArrayLike) -> Array:
        """Return R integrated along a straight line at distance |x| (...) mm from the point of entry: (..., 3) in 1/mm.

        This is the kernel of a one-dimensional blur. Its integral over x is the total.
        """
        x = distances(np.abs(np.asarray(x, dtype=np.float64)))
        t, weights = _nodes()
        span = np.log(_FARTHEST / _NEAREST)
        y = _NEAREST * np.exp(span * t[:, *(None,) * x.ndim])
        return np.tensordot(2.0 * span * weights, self.reflectance(np.hypot(x, y)) * y[..., None], axes=1)

    def table(self, n: int = 256) -> tuple[Array, Array]:
        """Return `n` distances r (n,), mm, equally spaced in log r, and R (n, 3), for lookups and plots.

        They reach from a thousandth of the least `range(0.5)` of the channels to the largest `range(1e-3)`. Raises
        InputError for n < 2.
        """
        if n < 2:
            raise InputError(f"a table needs at least 2 entries, not {n}")
        lit = self.total > 0.0
        if not lit.any():
            return np.geomspace(1e-3, 1.0, n), np.zeros((n, 3))
        r = np.geomspace(1e-3 * self.range(0.5)[lit].min(), self.range(1e-3).max(), n)
        return r, self.reflectance(r)


def distances(r: ArrayLike) -> Array:
    """Return distances as float64. Raises InputError if one is negative or NaN."""
    r = np.asarray(r, dtype=np.float64)
    if not np.all(r >= 0.0):
        raise InputError(f"distances must be at least 0 (mm), not {r[~(r >= 0.0)].flat[0]}")
    return r


def shares(part: Array, total: Array) -> Array:
    """Return `part` (..., 3) over `total` (3,), clamped to 0 to 1; 0 in channels with a total of 0."""
    return np.clip(part / np.where(total > 0.0, total, 1.0), 0.0, 1.0)


@cache
def _nodes() -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes (n,) and weights (n,) on 0..1, in panels, for integrals over all of log r."""
    panels, order = 48, 10
    x, w = np.polynomial.legendre.leggauss(order)
    t = (np.arange(panels)[:, None] + 0.5 * (x + 1.0)) / panels
    return t.ravel(), np.tile(0.5 * w / panels, panels)
