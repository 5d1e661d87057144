"""A thick plate that is bent about one axis, with texture coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._slab import slab


def patch(
    size: tuple[float, float, float] = (40.0, 40.0, 12.0), radius: float = 30.0, vertices: int | None = None
) -> Mesh:
    """Bend a `slab` of `size` mm about an axis along y, `radius` mm behind its front.

    The front keeps its lengths, so its texture coordinates have the scale of those of the slab. Vertices: as of `slab`.
    """
    flat = slab(size, vertices=vertices)
    assert flat.corner_normals is not None
    x, y, z = flat.positions.astype(np.float64).T
    angle, arm = x / radius, radius - (0.5 * size[2] - z)
    positions = np.stack([arm * np.sin(angle), y, arm * np.cos(angle) - radius], axis=1)
    nx, ny, nz = np.moveaxis(flat.corner_normals.astype(np.float64), 2, 0)
    sin, cos = np.sin(angle)[flat.faces], np.cos(angle)[flat.faces]
    normals = np.stack([nx * cos + nz * sin, ny, nz * cos - nx * sin], axis=2)
    # Rounded, so that the shape is the same on every processor.
    return replace(flat, positions=np.round(positions, 4), corner_normals=np.round(normals, 6), name="patch")
