"""Closed triangle meshes of implicit surfaces: marching cubes near the surface, then relaxation on it.

Fields are evaluated in double precision. Processors round functions such as sine differently. In single precision, the
positions would then differ between machines, and so would the charts of the unwrapped mesh.
"""

from __future__ import annotations

import math

import numpy as np

from wgsss.scene.shapes._distance import Field, Point
from wgsss.scene.shapes._relax import relax

_BLOCK = 4  # cells along the side of a block; blocks far from the surface are skipped


def sample(field: Field, low: Point, high: Point, spacing: float, *, steepness: float) -> tuple[np.ndarray, np.ndarray]:
    """Sample the field on a lattice over a box, only near the surface: values float32 (X,Y,Z) and origin (3,), mm.

    `steepness` is a bound of the gradient of the field. A block of cells is far from the surface if the field at its
    centre exceeds the bound times half the diagonal of the block. Far points get a constant with the right sign.
    """
    blocks = [max(math.ceil((b - a) / (spacing * _BLOCK)), 1) for a, b in zip(low, high, strict=True)]
    origin = np.array([(a + b - n * _BLOCK * spacing) / 2 for a, b, n in zip(low, high, blocks, strict=True)])
    side = _BLOCK * spacing
    index = np.stack(np.meshgrid(*(np.arange(n) for n in blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    middle = origin + (index + 0.5) * side
    centre_value = field(middle[:, 0], middle[:, 1], middle[:, 2])
    # Blocks are enlarged by one cell on each side, so that lattice points on their borders are evaluated, too.
    near = np.abs(centre_value) <= steepness * math.sqrt(3) * (side / 2 + spacing)

    far = np.where(centre_value > 0, side, -side).astype(np.float32).reshape(blocks)
    values = np.pad(np.repeat(np.repeat(np.repeat(far, _BLOCK, 0), _BLOCK, 1), _BLOCK, 2), ((0, 1),) * 3, mode="edge")
    evaluated = np.zeros(values.shape, dtype=bool)
    corner = index[near] * _BLOCK
    cell = np.stack(np.meshgrid(*(np.arange(_BLOCK + 1),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for d in cell:
        evaluated[tuple((corner + d).T)] = True
    at = np.nonzero(evaluated)
    points = origin + np.stack(at, axis=1) * spacing
    parts = np.array_split(points, len(points) // 100_000 + 1)  # small parts stay in the processor caches
    values[at] = np.concatenate([field(*part.T.copy()) for part in parts])
    return values, origin


def extract(
    field: Field, low: Point, high: Point, spacing: float, *, steepness: float, steps: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate the zero level of a field in a box: positions (V,3), mm, and faces (F,3), which face outwards.

    The mesh is closed if the surface lies inside the box. In each of `steps` steps, vertices move along the surface
    towards better triangles, and then back onto it.
    """
    from skimage.measure import marching_cubes

    values, origin = sample(field, low, high, spacing, steepness=steepness)
    # A surface through a lattice point would give triangles without area, so values close to 0 are moved away from it.
    least = 0.05 * spacing
    values = np.where(np.abs(values) < least, np.where(values < 0, -least, least), values)
    positions, faces, _, _ = marching_cubes(values, 0.0, allow_degenerate=False)
    positions, faces = positions * spacing + origin, faces.astype(np.int32)
    for _ in range(steps):
        positions = onto(field, relax(positions, faces, steps=1), spacing)
    return positions, faces


def onto(field: Field, positions: np.ndarray, spacing: float) -> np.ndarray:
    """Move positions (V,3) onto the surface by one Newton step of at most half the spacing."""
    x, y, z = positions.T.copy()
    here = field(x, y, z)
    step = 0.1 * spacing
    ahead = field(x + step, y, z), field(x, y + step, z), field(x, y, z + step)
    gradient = (np.stack(ahead, axis=1) - here[:, None]) / step
    move = -here / np.maximum((gradient**2).sum(axis=1), 0.1)
    move = np.clip(move, -0.5 * spacing, 0.5 * spacing)
    return positions + gradient * move[:, None]


def spacing_for(vertices: int, area: float) -> float:
    """Return the lattice spacing, mm, for which marching cubes makes about `vertices` vertices on `area` mm^2.

    A plane with normal n crosses |n_x| + |n_y| + |n_z| lattice edges per squared spacing, on average 1.5.
    """
    return math.sqrt(1.5 * area / vertices)
