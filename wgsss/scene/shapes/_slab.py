"""A flat box with hard edges and texture coordinates."""

from __future__ import annotations

import numpy as np

from wgsss.errors import InputError
from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._rows import fit_spacing, vertex_count

# For each side of the box: the two axes of its grid, the axis of its normal, and whether it is at the end (1) or the
# beginning (0) of this axis. The cross product of the first two axes is the outward normal.
_SIDES = ((0, 1, 2, 1), (1, 0, 2, 0), (1, 2, 0, 1), (2, 1, 0, 0), (2, 0, 1, 1), (0, 2, 1, 0))
_GUTTER = 0.02  # gap around each chart, as a share of the width of the map: 10 texels at 512


def slab(size: tuple[float, float, float] = (40.0, 40.0, 4.0), vertices: int | None = None) -> Mesh:
    """Build a box of `size` (x, y, z) mm about the origin with flat normals and one chart per side.

    Positions are shared across the edges. All six charts have the same scale, are upright as seen from outside, and are
    separated by gutters. Vertices: 100 to 1000000, by default 6000. Raises InputError for another count, or if a size
    is out of range.
    """
    if len(size) != 3 or not all(0 < s <= 1e9 for s in size):
        raise InputError(f"slab: size must be three lengths above 0 mm, at most 1e9, got {tuple(size)}")
    target = vertex_count("slab", vertices, 6000, 100, 1_000_000)

    def cells_at(spacing: float) -> np.ndarray:
        """Return the number of cells along each axis: (3,)."""
        return np.maximum(np.round(np.array(size) / spacing), 1).astype(int)

    def count(spacing: float) -> int:
        x, y, z = (int(n) for n in cells_at(spacing))
        return 2 * (x * y + y * z + z * x) + 2

    cells = cells_at(fit_spacing(count, target))
    origins, scale = _charts(size)

    points, corner_uvs, corner_normals, quads = [], [], [], []
    offset = 0
    for (a, b, n, end), origin in zip(_SIDES, origins, strict=True):
        i, j = (k.ravel() for k in np.meshgrid(np.arange(cells[a] + 1), np.arange(cells[b] + 1), indexing="ij"))
        lattice = np.zeros((len(i), 3), dtype=int)
        lattice[:, a], lattice[:, b], lattice[:, n] = i, j, cells[n] * end
        uvs = origin + scale * np.stack([i / cells[a] * size[a], (1 - j / cells[b]) * size[b]], axis=1)
        i, j = (k.ravel() for k in np.meshgrid(np.arange(cells[a]), np.arange(cells[b]), indexing="ij"))
        corner = i * (cells[b] + 1) + j
        right, up, across = corner + cells[b] + 1, corner + 1, corner + cells[b] + 2
        faces = np.stack([corner, right, across, corner, across, up], axis=1).reshape(-1, 3)
        normal = np.zeros(3)
        normal[n] = 2 * end - 1
        points.append(lattice)
        corner_uvs.append(uvs[faces])
        corner_normals.append(np.broadcast_to(normal, (*faces.shape, 3)))
        quads.append(faces + offset)
        offset += len(lattice)

    lattice, welded = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    return Mesh(
        positions=((lattice / cells - 0.5) * np.array(size)).astype(np.float32),
        faces=welded.ravel()[np.concatenate(quads)].astype(np.int32),
        corner_normals=np.concatenate(corner_normals).astype(np.float32),
        corner_uvs=np.concatenate(corner_uvs).astype(np.float32),
        name="slab",
    )


def _charts(size: tuple[float, float, float]) -> tuple[np.ndarray, float]:
    """Place the charts in two rows: upper left corners (6,2) in the unit square, and the scale, 1/mm."""
    extents = np.array([(size[a], size[b]) for a, b, _, _ in _SIDES])
    shelves = ((0, 1), (2, 3, 4, 5)) if size[2] <= max(size[:2]) else ((0, 1, 2), (3, 4, 5))
    widest = max(extents[list(s), 0].sum() / (1 - _GUTTER * (len(s) + 1)) for s in shelves)
    tall = sum(extents[list(s), 1].max() for s in shelves) / (1 - _GUTTER * (len(shelves) + 1))
    scale = 1.0 / max(widest, tall)
    origins = np.empty((6, 2))
    top = _GUTTER
    for shelf in shelves:
        left = _GUTTER
        for side in shelf:
            origins[side] = left, top
            left += extents[side, 0] * scale + _GUTTER
        top += extents[list(shelf), 1].max() * scale + _GUTTER
    return origins, scale
