"""Diffusion profiles as photons that were followed through layers tell them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.optics.profile import Profile, distances, shares

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Photons(Profile):
    """What became of photons that entered a stack of layers at one point, at a right angle.

    Everything but `specular` is per unit of flux that entered, as diffusion has it, and per RGB channel. Errors are
    standard errors, from the spread over batches of photons; infinite for a single photon.

    `edges`: radii (n + 1,) in mm of the rings about the point that light is counted in, from 0.
    `R`, `T`: mean exitance (n, 3) of each ring in 1/mm^2, on the side of entry and on the far side.
    `R_error`, `T_error`: their errors (n, 3).
    `R_outside`, `T_outside`: shares (3,) that left beyond the last ring.
    `total_error`, `total_transmittance_error`: errors (3,) of `total` and `total_transmittance`.
    `absorbed`: share (3,) that stayed inside.
    `specular`: share of the incident light that the top reflects without letting it in.
    `photons`: how many were followed in each channel.
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
        """Area (n, 1) of each ring in mm^2."""
        return np.pi * np.diff(np.square(self.edges))[:, None]

    @property
    def total(self) -> Array:
        return (self.R * self.areas).sum(axis=0) + self.R_outside

    @property
    def total_transmittance(self) -> Array:
        return (self.T * self.areas).sum(axis=0) + self.T_outside

    @property
    def balance(self) -> Array:
        """Reflected, transmitted and absorbed (3,) together: 1, but for the roulette that ends faint photons."""
        return self.total + self.total_transmittance + self.absorbed

    def reflectance(self, r: ArrayLike) -> Array:
        """R(r) in 1/mm^2, (..., 3), at `r` (...) mm, between the means of rings.

        What left beyond the last ring is taken to fall as 1/r^3, as it does where nothing absorbs.
        """
        return self._between(self.R, self.R_outside, r)

    def transmittance(self, r: ArrayLike) -> Array:
        """T(r) in 1/mm^2, (..., 3), as `reflectance`."""
        return self._between(self.T, self.T_outside, r)

    def _between(self, means: Array, outside: Array, r: ArrayLike) -> Array:
        r = distances(r)
        squares = np.square(self.edges)
        middle = 0.5 * (squares[1:] + squares[:-1])
        square = np.maximum(np.square(r), middle[0])
        # Of R r^2, what a step in log r holds, since R itself is steep.
        steps = [np.interp(np.log(square), np.log(middle), means[:, c] * middle) for c in range(3)]
        near = np.stack(steps, axis=-1) / square[..., None]
        last = self.edges[-1]
        far = outside * last / (2.0 * np.pi * np.maximum(r, last)[..., None] ** 3)
        return np.where(r[..., None] < last, near, far)

    def beyond(self, r: ArrayLike) -> Array:
        """Share (..., 3) of the total that leaves farther than `r` (...) mm away: exact at edges, even within rings."""
        r = distances(r)
        rings = np.vstack([self.R * self.areas, self.R_outside])
        beyond_edge = np.cumsum(rings[::-1], axis=0)[::-1]
        squares = np.square(self.edges)
        found = np.stack([np.interp(np.square(r), squares, beyond_edge[:, c]) for c in range(3)], axis=-1)
        found *= (self.edges[-1] / np.maximum(r, self.edges[-1]))[..., None]
        return shares(found, self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        """R integrated along a line at |x| (...) mm: (..., 3) in 1/mm, exact for the rings by their chords."""
        x = distances(np.abs(np.asarray(x, dtype=np.float64)))[..., None]
        half = np.sqrt(np.maximum(np.square(self.edges) - np.square(x), 0.0))
        last = self.edges[-1]
        far = np.square(last / np.maximum(x, last)) / (np.pi * (last + half[..., -1:]))  # the integral of 1/r^3
        return 2.0 * np.diff(half, axis=-1) @ self.R + far * self.R_outside
