"""An upright capsule."""

from __future__ import annotations

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._rows import fit_spacing, join_rows, spread, vertex_count


def capsule(length: float = 60.0, radius: float = 9.0, vertices: int | None = None) -> Mesh:
    """Build a cylinder with hemispherical ends along y from 0 to `length` mm, in rings of near-equilateral triangles.

    Vertices: 50 to 1000000, by default 4000. Raises InputError for another count.
    """
    target = vertex_count("capsule", vertices, 4000, 50, 1_000_000)
    profile_length = np.pi * radius + length - 2 * radius

    def rings(spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return radius, height and number of points of each ring, from the top pole down."""
        s = np.linspace(0, profile_length, max(round(profile_length / (spacing * 0.866)), 3) + 1)
        cap = np.pi / 2 * radius
        side = profile_length - cap
        polar = np.where(s < cap, s, np.where(s > side, s - side + cap, cap)) / radius
        height = np.where(s < cap, length - radius, np.where(s > side, radius, length - radius - (s - cap)))
        r = radius * np.sin(polar)
        counts = np.maximum(np.round(2 * np.pi * r / spacing), 5).astype(int)
        counts[[0, -1]] = 1
        r[[0, -1]] = 0
        return r, height + radius * np.cos(polar), counts

    r, y, counts = rings(fit_spacing(lambda h: int(rings(h)[2].sum()), target))
    row = np.repeat(np.arange(len(counts)), counts)
    params = spread(counts, closed=True)
    # Every second ring is rotated by half a gap, so that the triangles are near-equilateral.
    angle = 2 * np.pi * (params + 0.5 * (row % 2) / counts[row])
    positions = np.stack([r[row] * np.cos(angle), y[row], r[row] * np.sin(angle)], axis=1)
    faces = join_rows(counts, angle / (2 * np.pi), closed=True)
    return Mesh(positions=positions.astype(np.float32), faces=faces, name="capsule")
