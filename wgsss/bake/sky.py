"""How much of the environment's light reaches each point of a scene past the scene itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake import rays
from wgsss.bake.cache import cached
from wgsss.bake.environment import summed
from wgsss.scene import EnvironmentLight, Scene

Array = npt.NDArray[Any]

DIRECTIONS = 256
"""rays from each point"""
_LIFT = 1e-4  # of the scene's extent: how far above the surface rays start
_BLOCK = 4096  # points whose rays are cast at a time


def sky_visibility(scene: Scene, lights: Sequence[EnvironmentLight], positions: Array, normals: Array) -> Array:
    """The share (N,) of the environments' irradiance that arrives at points in the world, 0 to 1, float32, cached.

    `positions` (N, 3) in mm and `normals` (N, 3) of length 1. By rays through the scene at rest, spread by the cosine
    and weighted by the environments' mean over the channels: what of rho_dt depends on direction is left out.
    """
    vertices, faces = _triangles(scene)
    pixels = summed(lights)

    def make() -> dict[str, Array]:
        caster = rays.Caster(vertices, faces)
        lift = _LIFT * float(np.ptp(vertices, axis=0).max())
        blocks = range(0, len(positions), _BLOCK)
        parts = [
            _visible(caster, pixels, positions[i : i + _BLOCK], normals[i : i + _BLOCK], lift, first=i) for i in blocks
        ]
        return {"visible": np.concatenate(parts)}

    key = [vertices, faces, pixels, positions, normals]
    return cached("sky", key, make, code=[rays.Caster], label="casting rays at the sky")["visible"]


def _triangles(scene: Scene) -> tuple[Array, Array]:
    """Everything in the scene as one mesh, in the world."""
    vertices, faces, first = [], [], 0
    for thing in scene.objects:
        vertices.append(thing.mesh.positions @ thing.matrix[:3, :3].T + thing.matrix[:3, 3])
        faces.append(thing.mesh.faces + first)
        first += len(thing.mesh.positions)
    return np.concatenate(vertices).astype(np.float64), np.concatenate(faces)


def _visible(caster: rays.Caster, pixels: Array, x: Array, n: Array, lift: float, first: int) -> Array:
    """The share (N,) at points of which the first has the number `first`, which turns its directions."""
    w = _about(n.astype(np.float64), _golden(np.arange(first, first + len(x))))
    origins = np.repeat(x + lift * n, DIRECTIONS, axis=0)
    free = ~caster.blocked(origins, w.reshape(-1, 3)).reshape(len(x), DIRECTIONS)
    radiance = _seen(pixels, w)
    return ((free * radiance).sum(axis=1) / np.maximum(radiance.sum(axis=1), 1e-30)).astype(np.float32)


def _golden(numbers: Array) -> Array:
    """Azimuths that fill the circle evenly, so that the error of neighbours differs instead of drawing bands."""
    return 2.0 * np.pi * np.modf(numbers * 0.6180339887498949)[0]


def _about(n: Array, turn: Array) -> Array:
    """Directions (N, DIRECTIONS, 3) about normals (N, 3), as dense as the cosine, turned by the angles `turn` (N,)."""
    i = np.arange(DIRECTIONS)
    sine = np.sqrt((i + 0.5) / DIRECTIONS)
    azimuth = _golden(i) + turn[:, None]
    side = np.where(np.abs(n[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(side, n)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(n, u)
    across = (sine * np.cos(azimuth))[..., None] * u[:, None] + (sine * np.sin(azimuth))[..., None] * v[:, None]
    return across + np.sqrt(1.0 - sine**2)[:, None] * n[:, None]


def _seen(pixels: Array, w: Array) -> Array:
    """The mean over the channels of the environment's radiance (...) in directions w (..., 3)."""
    height, width = pixels.shape[:2]
    column = (0.5 + np.arctan2(w[..., 0], -w[..., 2]) / (2.0 * np.pi)) * width
    row = np.arccos(np.clip(w[..., 1], -1.0, 1.0)) / np.pi * height
    return pixels.mean(axis=2)[np.minimum(row.astype(int), height - 1), column.astype(int) % width]
