"""A small carved figure, seated on a lotus, with details down to half a millimetre."""

from __future__ import annotations

import math

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._distance import ball, carve, ellipsoid, join, limb
from wgsss.scene.shapes._head import head_distance
from wgsss.scene.shapes._implicit import extract, spacing_for
from wgsss.scene.shapes._rows import vertex_count

_AREA = 42_500.0  # mm^2
_HEAD_SCALE = 0.195
_HEAD_CENTRE = (0.0, 116.0, 3.0)


def statue(vertices: int | None = None) -> Mesh:
    """Build a figure seated on a lotus, facing +z, y up from 0: 150 mm tall, 100 mm wide; closed, one piece.

    The shape does not depend on the number of vertices, but fine folds and curls need about 100000. Vertices:
    5000 to 500000, by default 20000. Raises InputError for another count.
    """
    target = vertex_count("statue", vertices, 20_000, 5000, 500_000)
    spacing = spacing_for(target, _AREA)
    positions, faces = extract(_figure, (-56, -4, -52), (56, 156, 56), spacing, steepness=1.8)
    return Mesh(positions=positions.astype(np.float32), faces=faces, name="statue")


def _figure(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Compute the signed distance, mm, to the figure."""
    return join(join(_body(x, y, z), _lotus(x, y, z), 1.5), _carved_head(x, y, z), 2.0)


def _lotus(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Compute the signed distance to the lotus: a drum with two rings of petals, flat below."""
    r = np.sqrt(x * x + 1.25 * z * z)
    turn = np.arctan2(1.12 * z, x)
    d = np.maximum(r - 41, np.abs(y - 12) - 11)
    for level, size, reach, petals, phase in ((18.5, 6.8, 43.5, 15, 0.0), (6.5, 6.2, 45.5, 17, 0.5)):
        within = np.mod(turn * petals / (2 * math.pi) + phase, 1.0) - 0.5  # -0.5..0.5 across one petal
        bulge = np.sqrt(np.maximum(1 - (2 * within) ** 2, 0.0))
        rise = level + 1.5 * bulge if level > 10 else level - 1.5 * bulge
        ring = np.sqrt((r - (reach - 5.5 + 2.0 * bulge)) ** 2 + (0.75 * (y - rise)) ** 2) - size * (0.72 + 0.28 * bulge)
        d = join(d, 0.8 * ring, 1.0)
    d = carve(d, np.abs(y - 12.5) - 0.9 + 0.5 * np.maximum(39.5 - r, 0), 1.0)
    return -join(-d, y, 1.0)


def _body(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Compute the signed distance to torso, crossed legs and arms, in a robe that leaves one shoulder (-x) bare."""
    # Legs: the thighs point outwards and the shins inwards, one in front of the other.
    side = np.abs(x)
    robe = limb(side, y, z, (12, 32, -8), (35, 31, 17), 12.5, 9.5)
    robe = join(robe, limb(x, y, z, (36, 30, 17), (-10, 28.5, 29), 9.0, 6.0), 3.0)
    robe = join(robe, limb(x, y, z, (-36, 30, 17), (12, 33.5, 27), 9.0, 5.5), 3.0)
    robe = join(robe, ellipsoid(x, y, z, (0, 26, 26), (24, 5, 11)), 6.0)
    # Folds run along the shins and gather in the lap.
    fan = np.sqrt(x * x + (y - 52) ** 2 + 0.6 * (z - 4) ** 2)
    robe = robe + 0.55 * _folds(fan / 4.6, robe) * np.clip((z + 4) / 14, 0, 1)

    torso = ellipsoid(x, y, z, (0, 48, -6), (22, 24, 17))
    torso = join(torso, ellipsoid(x, y, z, (0, 74, -6), (25, 24, 15.5)), 14.0)
    torso = join(torso, limb(side, y, z, (0, 91, -7), (25, 88, -8), 8, 8.5), 10.0)
    torso = join(torso, limb(x, y, z, (0, 90, -5), (0, 106, -1), 9.5, 8.0), 7.0)
    torso = join(torso, limb(side, y, z, (9, 79, 4), (11, 79, 4), 6, 6), 9.0)

    arm = limb(side, y, z, (31, 85, -8), (37, 56, -6), 8.6, 7.2)
    arm = join(arm, limb(side, y, z, (37, 56, -6), (11, 42.5, 25), 7.2, 4.6), 5.0)
    arm = join(arm, ellipsoid(x, y, z, (-1, 41.5, 27.5), (12.5, 3.4, 6.0)), 3.0)
    arm = join(arm, limb(side, y, z, (8, 43, 31), (0.5, 46.5, 32), 1.9, 1.6), 1.2)
    whole = join(torso, arm, 5.0)

    # The robe covers all except the right arm, shoulder and chest. Its hem is a roll along an inclined plane.
    slant = 0.80 * (x + 9) - 0.60 * (y - 74) + 0.10 * z
    covered = np.clip(slant / 2.4 + 0.5, 0, 1)
    covered = covered * covered * (3 - 2 * covered)
    along = 0.62 * x + 0.80 * y + 0.15 * z + 1.5 * np.sin(0.13 * (x - y))
    cloth = whole - 0.9 * covered * np.clip((y - 36) / 8, 0, 1)
    fade = np.clip((y - 38) / 10, 0, 1) * np.clip((104 - y) / 12, 0, 1)
    cloth = cloth - 0.55 * covered * fade * _folds(along / 6.5, whole)
    roll = np.sqrt((slant - 0.6) ** 2 + whole**2) - 1.5
    roll = np.maximum(roll, 40 - y)
    cloth = join(cloth, roll, 1.2)
    cloth = carve(cloth, ball(x, y, z, (0, 57, 11.6), 1.3), 1.2)
    return join(robe, cloth, 4.0)


def _folds(phase: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Compute rounded folds with sharp valleys, -1..1, one per unit of phase. They fade a few mm from the surface."""
    wave = 2 * np.abs(np.sin(math.pi * phase)) - 1
    return wave * np.clip(1.5 - np.abs(distance) / 4, 0, 1)


def _carved_head(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Compute the signed distance to the head: curly hair with a bun, and long ear lobes."""
    u, v, w = ((p - c) / _HEAD_SCALE for p, c in zip((x, y, z), _HEAD_CENTRE, strict=True))
    face = carve(head_distance(u, v, w), v + 85, 20.0)
    hair = join(ellipsoid(u, v, w, (0, 42, -16), (75, 79, 92)), ball(u, v, w, (0, 131, -16), 41), 24.0)
    # Curls lie in rings around the crown. Each ring holds as many as fit.
    polar = np.arctan2(np.sqrt(u * u + (w + 16) ** 2), v - 30)
    ring = polar / 0.165
    curls = np.maximum(np.round(2 * math.pi * np.sin(np.minimum((np.floor(ring) + 0.5) * 0.165, 1.7)) / 0.165), 4)
    column = np.arctan2(w + 16, u) / (2 * math.pi) * curls
    bump = np.sin(math.pi * (ring - np.floor(ring))) * np.abs(np.sin(math.pi * column))
    hair = hair - 4.0 * np.sqrt(bump) + 1.0
    # The hairline: hair grows above a curved surface that rises over the forehead and falls behind the ears.
    line = 0.86 * (v - 66) - 0.52 * (w - 66) + 0.0016 * u * u
    hair = np.maximum(hair, -0.9 * line)
    face = join(face, hair, 3.0)
    lobe = limb(np.abs(u), v, w, (70, -8, -26), (67, -44, -24), 7, 8)
    return join(face, lobe, 6.0) * _HEAD_SCALE
