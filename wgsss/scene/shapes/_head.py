"""A head with a neck, also used for the statue."""

from __future__ import annotations

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._distance import ball, carve, ellipsoid, join, limb
from wgsss.scene.shapes._implicit import extract, spacing_for
from wgsss.scene.shapes._rows import vertex_count

_AREA = 120_000.0  # mm^2


def head(vertices: int | None = None) -> Mesh:
    """Build a head facing +z, y up, about 160 x 230 x 215 mm, centred at the origin; closed, one piece.

    Vertices: 1000 to 500000, by default 10000. Raises InputError for another count.
    """
    target = vertex_count("head", vertices, 10_000, 1000, 500_000)
    spacing = spacing_for(target, _AREA)

    def bust(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        return carve(head_distance(x, y, z), y + 115, 8.0)

    positions, faces = extract(bust, (-95, -120, -120), (95, 122, 125), spacing, steepness=1.5)
    return Mesh(positions=positions.astype(np.float32), faces=faces, name="head")


def head_distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Compute the signed distance, mm, to the head. Its neck continues below y = -115."""
    x = np.sqrt(x * x + 0.25) - 0.5  # symmetric halves, smooth across the middle
    d = ellipsoid(x, y, z, (0, 38, -14), (71, 77, 91))
    d = join(d, ellipsoid(x, y, z, (0, 0, 26), (53, 72, 58)), 30.0)
    d = join(d, ellipsoid(x, y, z, (0, -42, 32), (38, 34, 42)), 24.0)
    d = join(d, ball(x, y, z, (0, -60, 68), 10.0), 22.0)  # chin
    d = join(d, limb(x, y, z, (39, -35, 0), (24, -57, 46), 11, 9), 22.0)  # jaw
    d = join(d, ball(x, y, z, (36, -8, 52), 17.0), 22.0)  # cheekbone
    d = join(d, limb(x, y, z, (0, -30, -22), (0, -140, -36), 42, 50), 26.0)  # neck
    d = join(d, limb(x, y, z, (48, 10, -14), (9, -112, 12), 9, 8), 16.0)  # muscle from ear to collar

    # Eyes: a socket, the eyeball in it, and lids over the eyeball.
    d = carve(d, ellipsoid(x, y, z, (29, 15, 89), (17, 10, 15)), 14.0)
    d = join(d, limb(x, y, z, (8, 29, 78), (43, 29, 63), 7, 5), 14.0)  # brow
    d = join(d, ellipsoid(x, y, z, (29, 14, 64), (14, 10, 13)), 3.0)
    d = join(d, limb(x, y, z, (18, 17, 75), (40, 17, 69), 2.6, 2.2), 3.0)
    d = join(d, limb(x, y, z, (19, 8, 74), (39, 9, 68), 2.2, 2.0), 3.0)

    # Nose and mouth.
    d = join(d, limb(x, y, z, (0, 28, 80), (0, -8, 101), 5.0, 7.5), 10.0)
    d = join(d, ball(x, y, z, (9.0, -11, 90), 6.0), 6.0)
    d = carve(d, ball(x, y, z, (5.5, -17.0, 95), 2.4), 3.0)
    d = join(d, ellipsoid(x, y, z, (0, -35, 70), (27, 17, 16)), 14.0)
    d = join(d, limb(x, y, z, (0, -31.5, 85), (20, -35, 76), 4.2, 1.6), 4.0)
    d = join(d, limb(x, y, z, (0, -40.5, 84.5), (18, -37, 76), 5.0, 1.8), 4.0)
    d = carve(d, limb(x, y, z, (0, -35.6, 92), (23, -36, 78), 1.7, 1.2), 3.5)

    # Ears: a disc with a bowl in it.
    ear = ellipsoid(0.94 * x + 0.34 * z, y - 0.1 * z, 0.94 * z - 0.34 * x, (66, 6, -31), (7, 30, 18))
    ear = carve(ear, ellipsoid(0.94 * x + 0.34 * z, y - 0.1 * z, 0.94 * z - 0.34 * x, (75, 8, -29), (8, 22, 11)), 5.0)
    return join(d, ear, 7.0)
