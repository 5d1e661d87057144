"""Diffusion profiles measured by photons that were traced through layers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.optics.profile import Profile, distances, shares

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Photons(Profile):
    """The result of tracing photons that enter a stack of layers at one point, at a right angle.

    All values except `specular` are per RGB channel and per unit of flux that has entered, as in diffusion models.
    Errors are standard errors, computed from batches of photons, and infinite for a single photon.

    `edges`: radii (n + 1,) in mm, from 0, of the rings around the point of entry in which light is counted.
    `R`, `T`: mean exitance (n, 3) of each ring in 1/mm^2, on the side of entry and on the far side.
    `R_error`, `T_error`: their errors (n, 3).
    `R_outside`, `T_outside`: shares (3,) of the light that leave beyond the last ring.
    `total_error`, `total_transmittance_error`: errors (3,) of `total` and `total_transmittance`.
    `absorbed`: share (3,) of the light that is absorbed.
    `specular`: share of the incident light that the top surface reflects, so that it does not enter.
    `photons`: number of photons traced in each channel.
    """

    edges: Array
    R: Array
    R_error: Array
    T: Array
    T_error: Array
    R_outside: Array
    T_outside: Array
    total_error: Array
    total_transmittance_error: Array
    absorbed: Array
    specular: float
    photons: int

    @cached_property
    def areas(self) -> Array:
        """Area of each ring (n, 1), mm^2."""
        return np.pi * np.diff(np.square(self.edges))[:, None]

    @property
    def total(self) -> Array:
        return (self.R * self.areas).sum(axis=0) + self.R_outside

    @property
    def total_transmittance(self) -> Array:
        return (self.T * self.areas).sum(axis=0) + self.T_outside

    @property
    def balance(self) -> Array:
        """Sum of the reflected, transmitted and absorbed light (3,): 1 except for noise of the Russian roulette."""
        return self.total + self.total_transmittance + self.absorbed

    def reflectance(self, r: ArrayLike) -> Array:
        """Return R(r) in 1/mm^2, (..., 3), at `r` (...) mm, interpolated between the means of the rings.

        Beyond the last ring R falls off as 1/r^3, as it does in media without absorption.
        """
        return self._between(self.R, self.R_outside, r)

    def transmittance(self, r: ArrayLike) -> Array:
        """Return T(r) in 1/mm^2, (..., 3), as `reflectance` does R(r)."""
        return self._between(self.T, self.T_outside, r)

    def _between(self, means: Array, outside: Array, r: ArrayLike) -> Array:
        """Interpolate the `means` (n, 3) of the rings at `r` (...), with the share `outside` (3,) beyond the last."""
        r = distances(r)
        squares = np.square(self.edges)
        middle = 0.5 * (squares[1:] + squares[:-1])
        square = np.maximum(np.square(r), middle[0])
        # Interpolate R r^2, the light for each step of log r, since R itself is steep.
        steps = [np.interp(np.log(square), np.log(middle), means[:, c] * middle) for c in range(3)]
        near = np.stack(steps, axis=-1) / square[..., None]
        last = self.edges[-1]
        far = outside * last / (2.0 * np.pi * np.maximum(r, last)[..., None] ** 3)
        return np.where(r[..., None] < last, near, far)

    def beyond(self, r: ArrayLike) -> Array:
        """Return the share (..., 3) of the total that leaves farther than `r` (...) mm away.

        It is exact at the edges of the rings. Within a ring, the exitance is taken as constant.
        """
        r = distances(r)
        rings = np.vstack([self.R * self.areas, self.R_outside])
        beyond_edge = np.cumsum(rings[::-1], axis=0)[::-1]
        squares = np.square(self.edges)
        outside = np.stack([np.interp(np.square(r), squares, beyond_edge[:, c]) for c in range(3)], axis=-1)
        outside *= (self.edges[-1] / np.maximum(r, self.edges[-1]))[..., None]
        return shares(outside, self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        """Return R integrated along a line at distance |x| (...) mm: (..., 3) in 1/mm, from the chords of the rings."""
        x = distances(np.abs(np.asarray(x, dtype=np.float64)))[..., None]
        half = np.sqrt(np.maximum(np.square(self.edges) - np.square(x), 0.0))
        last = self.edges[-1]
        far = np.square(last / np.maximum(x, last)) / (np.pi * (last + half[..., -1:]))  # the integral of 1/r^3
        return 2.0 * np.diff(half, axis=-1) @ self.R + far * self.R_outside
