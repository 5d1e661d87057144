"""What every diffusion profile can be asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError

Array = NDArray[np.float64]

# Integrals over all distances run in log r between these, mm. Profiles of materials live well inside.
_NEAREST, _FARTHEST = 1e-9, 1e9


class Profile(ABC):
    """R(r): the radiant exitance, in 1/mm^2 per RGB channel, at a distance r from where unit flux entered the medium.

    A model gives `total` and `reflectance`. The rest follows by quadrature, to a relative 1e-9 or so, where a model
    has no closed form of its own. Lengths are mm; negative or NaN distances raise InputError.
    """

    @property
    @abstractmethod
    def total(self) -> Array:
        """Total diffuse reflectance R_tot (3,): the integral of R over the plane (004 eq. 37)."""

    @abstractmethod
    def reflectance(self, r: ArrayLike) -> Array:
        """R(r) in 1/mm^2, (..., 3), at distances `r` (...) in mm."""

    @property
    def total_transmittance(self) -> Array:
        """The integral of T over the plane (3,); 0 for a medium without end."""
        return np.zeros(3)

    def transmittance(self, r: ArrayLike) -> Array:
        """T(r) in 1/mm^2, (..., 3): what leaves on the far side of a slab at `r` (...) mm; 0 where there is none."""
        return np.zeros((*distances(r).shape, 3))

    def beyond(self, r: ArrayLike) -> Array:
        """Share (..., 3) of the total that leaves farther than `r` (...) mm away, 1 to 0: epsilon of 004 eq. 40.

        0 for a channel that reflects nothing.
        """
        r = distances(r)
        t, weights = _nodes()
        span = np.log(_FARTHEST / np.maximum(r, _NEAREST))
        far = np.exp(np.log(np.maximum(r, _NEAREST)) + span * t[:, *(None,) * r.ndim])  # (nodes, ...)
        ring = 2.0 * np.pi * np.square(far)[..., None] * self.reflectance(far)
        outside = np.tensordot(weights, ring, axes=1) * span[..., None]
        return shares(outside, self.total)

    def enclosed(self, r: ArrayLike) -> Array:
        """Share (..., 3) of the total that leaves within `r` (...) mm, 0 to 1; 1 where a channel reflects nothing."""
        return 1.0 - self.beyond(r)

    def range(self, eps: float = 0.01) -> Array:
        """d_max (3,) in mm: the distance within which all but a share `eps` of the light leaves (004 eq. 40).

        0 for a channel that reflects nothing. Raises InputError unless 0 < eps < 1.
        """
        from scipy.optimize import elementwise

        if not 0.0 < eps < 1.0:
            raise InputError(f"the share left out must be between 0 and 1, not {eps}")
        found = np.zeros(3)
        for channel in np.flatnonzero(self.total > 0.0):

            def excess(log_r: ArrayLike, channel: Any = channel) -> Array:
                return np.log(np.maximum(self.beyond(np.exp(log_r))[..., channel], 1e-300) / eps)

            low, high = -1.0, 1.0  # doubled until they hold the root, which is unique: the share falls with r
            while low > np.log(_NEAREST) and excess(low) < 0.0:
                low *= 2.0
            while high < np.log(_FARTHEST) and excess(high) > 0.0:
                high *= 2.0
            found[channel] = np.exp(elementwise.find_root(excess, (low, high)).x)
        return found

    def line_spread(self, x: ArrayLike) -> Array:
        """R integrated along a straight line at distance |x| (...) mm from the light's entry: (..., 3) in 1/mm.

        The kernel of a one-dimensional pass: its integral over x is the total.
        """
        x = distances(np.abs(np.asarray(x, dtype=np.float64)))
        t, weights = _nodes()
        span = np.log(_FARTHEST / _NEAREST)
        y = _NEAREST * np.exp(span * t[:, *(None,) * x.ndim])
        return np.tensordot(2.0 * span * weights, self.reflectance(np.hypot(x, y)) * y[..., None], axes=1)

    def table(self, n: int = 256) -> tuple[Array, Array]:
        """R at `n` distances, equally spaced in log r: r (n,) in mm and R (n, 3), for lookups and plots.

        From a thousandth of the least `range(0.5)` to the largest `range(1e-3)`. Raises InputError for n < 2.
        """
        if n < 2:
            raise InputError(f"a table needs at least 2 entries, not {n}")
        lit = self.total > 0.0
        if not lit.any():
            return np.geomspace(1e-3, 1.0, n), np.zeros((n, 3))
        r = np.geomspace(1e-3 * self.range(0.5)[lit].min(), self.range(1e-3).max(), n)
        return r, self.reflectance(r)


def distances(r: ArrayLike) -> Array:
    """Distances as floats. Raises InputError where one is negative or NaN."""
    r = np.asarray(r, dtype=np.float64)
    if not np.all(r >= 0.0):
        raise InputError(f"distances must be at least 0 (mm), not {r[~(r >= 0.0)].flat[0]}")
    return r


def shares(part: Array, total: Array) -> Array:
    """`part` (..., 3) of `total` (3,), within 0 to 1; 0 where the total is."""
    return np.clip(part / np.where(total > 0.0, total, 1.0), 0.0, 1.0)


@cache
def _nodes() -> tuple[Array, Array]:
    """Gauss-Legendre nodes and weights on 0..1, in panels: enough for any profile in log r over all distances."""
    panels, order = 48, 10
    x, w = np.polynomial.legendre.leggauss(order)
    t = (np.arange(panels)[:, None] + 0.5 * (x + 1.0)) / panels
    return t.ravel(), np.tile(0.5 * w / panels, panels)
