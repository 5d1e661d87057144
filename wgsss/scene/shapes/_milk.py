"""A splash of milk: puddle, crown, jet and separate drops."""

from __future__ import annotations

import math

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._distance import ball, carve, ellipsoid, join, limb
from wgsss.scene.shapes._implicit import extract, spacing_for
from wgsss.scene.shapes._rows import vertex_count

_PRONGS = 13
_AREA = 6_500.0  # mm^2


def milk(vertices: int | None = None) -> Mesh:
    """Build the splash of a drop in a puddle, y up, about 60 x 35 x 60 mm: one crown and about twenty drops.

    Vertices: 5000 to 500000, by default 14000. Raises InputError for another count.
    """
    target = vertex_count("milk", vertices, 14_000, 5000, 500_000)
    spacing = spacing_for(target, _AREA)
    positions, faces = extract(_splash, (-36, -4, -36), (36, 36, 36), spacing, steepness=1.5)
    return Mesh(positions=positions.astype(np.float32), faces=faces, name="milk")


def _splash(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Compute the signed distance, mm, to the splash. Random sizes and places have a fixed seed."""
    random = np.random.default_rng(5)
    r = np.sqrt(x * x + z * z)
    solid = join(ellipsoid(x, y, z, (0, -0.6, 0), (26, 2.2, 26)), ellipsoid(x, y, z, (9, -0.6, 5), (19, 1.9, 15)), 2.0)
    # The wall of the crown leans outwards and becomes thinner towards its edge.
    up = np.clip(y, 0, 9)
    wall = np.abs(r - (13.5 + 0.045 * up**2)) * 0.9 - (1.5 - 0.05 * up)
    wall = np.maximum(wall, np.maximum(-1.5 - y, y - 8.0))
    solid = join(solid, wall, 3.0)
    # The jet in the middle, where the drop rebounds.
    solid = join(solid, limb(x, y, z, (0, -0.5, 0), (0.6, 13, 0.3), 4.2, 1.3), 4.0)
    solid = join(solid, ball(x, y, z, (0.7, 14.6, 0.4), 2.6), 1.5)

    free = np.minimum(ball(x, y, z, (0.9, 22.5, 0.4), 3.1), ball(x, y, z, (0.2, 29.0, 0.9), 1.7))
    for k in range(_PRONGS):
        turn = 2 * math.pi * (k + random.uniform(-0.22, 0.22)) / _PRONGS
        cos, sin = math.cos(turn), math.sin(turn)
        high, lean, size = random.uniform(10.5, 15), random.uniform(2.0, 4.5), random.uniform(1.5, 2.1)
        foot, tip = 15.5, 16.0 + lean
        solid = join(solid, limb(x, y, z, (foot * cos, 6.5, foot * sin), (tip * cos, high, tip * sin), 1.7, 1.0), 1.6)
        solid = join(solid, ball(x, y, z, (tip * cos, high + 0.4, tip * sin), size), 0.8)
        if k % 3 != 2:
            far, size = tip + random.uniform(3.0, 7.5), random.uniform(1.0, 1.8)
            drop = ball(x, y, z, (far * cos, high + random.uniform(3.5, 8.0), far * sin), size)
            free = np.minimum(free, drop)
    for _ in range(9):
        turn, far, size = random.uniform(0, 2 * math.pi), random.uniform(30.5, 33), random.uniform(1.2, 2.6)
        blob = ellipsoid(x, y, z, (far * math.cos(turn), -1.0, far * math.sin(turn)), (size, 0.55 * size, size))
        free = join(free, blob, 1.0)
    return carve(np.minimum(solid, free), y + 2.2, 1.2)  # flat below
