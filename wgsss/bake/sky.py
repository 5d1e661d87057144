"""The share of the environments' light that reaches each point of a scene, past the objects of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake import rays
from wgsss.bake.environment import split_environments
from wgsss.bake.suns import solid_angles
from wgsss.cache import cached
from wgsss.scene import EnvironmentLight, Scene
from wgsss.scene.geometry import cosine_directions, golden_azimuths

Array = npt.NDArray[Any]

DIRECTIONS = 256
"""The number of rays from each point. With an image, as many more go towards its bright parts."""
_LIFT = 1e-4  # of the extent of the scene: the height above the surface at which rays start
_EVEN = 1e-3  # of the mean radiance is added to an image: a visible share is defined even where its sky is black
_BLOCK = 4096  # points whose rays are cast together


def sky_visibility(scene: Scene, lights: Sequence[EnvironmentLight], positions: Array, normals: Array) -> Array:
    """Return the share of the environments' irradiance that arrives at points: float32 (N,), 0 to 1. Cached.

    `positions` (N, 3), mm, and `normals` (N, 3), of length 1, are in world space. Rays are cast through the scene at
    rest and weighted by the mean radiance of the environments over the channels. This leaves out that rho_dt depends on
    direction. Suns are left out, too, since they are lights (`wgsss.bake.suns`). The rays have a cosine density; for
    images, as many again have the density of the radiance. The balance heuristic combines both (Veach & Guibas 1995,
    "Optimally combining sampling techniques").
    """
    pixels = split_environments(lights).rest
    if not pixels.any():
        return np.ones(len(positions), np.float32)
    vertices, faces = _triangles(scene)
    even = bool((pixels == pixels[0, 0]).all())
    sky = pixels[0, 0].mean() if even else _Image(pixels)

    def make() -> dict[str, Array]:
        caster = rays.Caster(vertices, faces)
        lift = _LIFT * float(np.ptp(vertices, axis=0).max())
        blocks = range(0, len(positions), _BLOCK)
        parts = [
            _visible(caster, sky, positions[i : i + _BLOCK], normals[i : i + _BLOCK], lift, first=i) for i in blocks
        ]
        return {"visible": np.concatenate(parts)}

    key = [vertices, faces, pixels, positions, normals]
    return cached("sky", key, make, label="casting rays at the sky")["visible"]


def _triangles(scene: Scene) -> tuple[Array, Array]:
    """Return the positions (V, 3), mm, and faces (F, 3) of all objects together, in world space."""
    vertices, faces, first = [], [], 0
    for thing in scene.objects:
        vertices.append(thing.mesh.positions @ thing.matrix[:3, :3].T + thing.matrix[:3, 3])
        faces.append(thing.mesh.faces + first)
        first += len(thing.mesh.positions)
    return np.concatenate(vertices).astype(np.float64), np.concatenate(faces)


def _visible(caster: rays.Caster, sky: _Image | np.float32, x: Array, n: Array, lift: float, first: int) -> Array:
    """Compute the shares (N,) at points x (N, 3) with normals n (N, 3).

    The rays of each point are turned about its normal by an angle that depends on its number; the first has `first`.
    The errors of neighbours then differ, instead of forming bands.
    """
    n = n.astype(np.float64)
    turn = golden_azimuths(np.arange(first, first + len(x)))
    w = cosine_directions(n, golden_azimuths(np.arange(DIRECTIONS)) + turn[:, None])
    origins = x + lift * n
    if not isinstance(sky, _Image):
        weight = np.full(w.shape[:2], sky)
    else:
        w = np.concatenate([w, np.broadcast_to(sky.directions, (len(x), *sky.directions.shape))], axis=1)
        cosine = np.maximum((w * n[:, None]).sum(axis=-1), 0.0)
        radiance = sky.radiance(w)
        density = DIRECTIONS * (cosine / np.pi + radiance / sky.total)
        weight = radiance * cosine / np.maximum(density, 1e-30)
    cast = weight > 0.0
    free = np.zeros(cast.shape, bool)
    free[cast] = ~caster.blocked(np.repeat(origins, cast.sum(axis=1), axis=0), w[cast])
    return ((free * weight).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-30)).astype(np.float32)


class _Image:
    """The mean over the channels of a latitude-longitude image of the sky (H, W, 3).

    Attributes:
        total: the integral of the radiance over all directions.
        directions: (DIRECTIONS, 3), with a density in proportion to the radiance. They are the same for all points, so
            that shadows are smooth.
    """

    def __init__(self, pixels: Array) -> None:
        height, width = pixels.shape[:2]
        grey = pixels.mean(axis=2).astype(np.float64)
        weight = solid_angles(height, width)[:, None]
        self._grey = grey + _EVEN * float((grey * weight).sum()) / (4.0 * np.pi)
        power = self._grey * weight
        self.total = float(power.sum())
        rows, columns = np.cumsum(power.sum(axis=1)), np.cumsum(power, axis=1)
        i = np.arange(DIRECTIONS)
        down = (i + 0.5) / DIRECTIONS * rows[-1]
        row = np.searchsorted(rows, down)
        across = _radical_inverse(i) * columns[row, -1]
        column = np.array([np.searchsorted(columns[r], a, side="right") for r, a in zip(row, across, strict=True)])
        # Spread evenly within a texel, too, over the cosine of the latitude and over the longitude.
        part = (rows[row] - down) / power[row].sum(axis=1)
        low, high = np.cos(np.pi * (row + 1) / height), np.cos(np.pi * row / height)
        y = low + part * (high - low)
        phi = 2.0 * np.pi * ((column + 1 - (columns[row, column] - across) / power[row, column]) / width - 0.5)
        ring = np.sqrt(np.maximum(1.0 - y * y, 0.0))
        self.directions = np.stack([ring * np.sin(phi), y, -ring * np.cos(phi)], axis=1)  # see EnvironmentLight

    def radiance(self, w: Array) -> Array:
        """Return the radiance (...) in directions w (..., 3)."""
        height, width = self._grey.shape
        column = (0.5 + np.arctan2(w[..., 0], -w[..., 2]) / (2.0 * np.pi)) * width
        row = np.arccos(np.clip(w[..., 1], -1.0, 1.0)) / np.pi * height
        return self._grey[np.minimum(row.astype(int), height - 1), column.astype(int) % width]


def _radical_inverse(i: Array) -> Array:
    """Return the radical inverse of i (N,) in base 2, the second coordinate of the Hammersley set."""
    bits = (i[:, None] >> np.arange(32)) & 1
    return bits @ 0.5 ** np.arange(1, 33)
