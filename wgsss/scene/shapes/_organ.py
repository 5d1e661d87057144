"""A thick flattened capsule with texture coordinates around and along it."""

from __future__ import annotations

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._capsule import capsule

_LENGTH, _RADIUS, _FLAT = 60.0, 17.0, 0.75  # mm, mm, and depth over width


def organ(vertices: int | None = None) -> Mesh:
    """Build a capsule along y from 0 to 60 mm, 34 mm wide and less deep, that narrows towards the top.

    u goes once around it, from 0 to 1 and a little beyond at the seam, and v from the top to the foot in proportion to
    the distance along the surface. Vertices: as of `capsule`.
    """
    round_one = capsule(_LENGTH, _RADIUS, vertices)
    x, y, z = round_one.positions.astype(np.float64).T
    around = np.round(np.arctan2(-x, -z) / (2 * np.pi) + 0.5, 6)
    share = y / _LENGTH
    width = 1.0 - 0.35 * share * share
    positions = np.round(np.stack([x * width, y, _FLAT * z * width], axis=1), 4)
    return Mesh(
        positions=positions, faces=round_one.faces, corner_uvs=_uvs(around, _down(y), round_one.faces), name="organ"
    )


def _down(y: np.ndarray) -> np.ndarray:
    """Return v at the heights `y` of a capsule, 0 at the top and 1 at the foot."""
    quarter, side = 0.5 * np.pi * _RADIUS, _LENGTH - 2 * _RADIUS
    to_ball = np.clip(np.abs(y - 0.5 * _LENGTH) - 0.5 * side, 0.0, _RADIUS) / _RADIUS
    from_middle = np.minimum(np.abs(y - 0.5 * _LENGTH), 0.5 * side) + _RADIUS * np.arcsin(to_ball)
    return np.round(0.5 - 0.5 * np.sign(y - 0.5 * _LENGTH) * from_middle / (quarter + 0.5 * side), 6)


def _uvs(around: np.ndarray, down: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the texture coordinates (F, 3, 2) of corners: continuous in each face across the seam and at the poles."""
    u, v = around[faces], down[faces]
    pole = (v <= 0.0) | (v >= 1.0)
    beside = np.where(pole, np.nan, u)
    low = (np.nanmax(beside, axis=1) - np.nanmin(beside, axis=1) > 0.5)[:, None] & (u < 0.5)
    u = np.where(low, u + 1.0, u)
    middle = np.nanmean(np.where(pole, np.nan, u), axis=1, keepdims=True)
    return np.stack([np.where(pole, middle, u), v], axis=2)
