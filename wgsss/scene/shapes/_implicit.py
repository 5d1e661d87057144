"""Closed triangle meshes of implicit surfaces: marching cubes in a band about the surface, then relaxation on it.

Fields are evaluated in double precision: processors round sines and the like differently, and positions in single
precision would tell, at which unwrapping takes other turns.
"""

from __future__ import annotations

import math

import numpy as np

from wgsss.scene.shapes._distance import Field, Point
from wgsss.scene.shapes._relax import relax

_BLOCK = 4  # cells along the side of the blocks that are skipped where the surface is far away


def sample(field: Field, low: Point, high: Point, spacing: float, *, steepness: float) -> tuple[np.ndarray, np.ndarray]:
    """The field on a lattice over a box, evaluated only near the surface: values float32 (X,Y,Z) and origin (3,), mm.

    `steepness` bounds the field's gradient: a block of cells is far away where the field at its middle is larger than
    half its diagonal times that. Far points get a value of the right sign.
    """
    blocks = [max(math.ceil((b - a) / (spacing * _BLOCK)), 1) for a, b in zip(low, high, strict=True)]
    origin = np.array([(a + b - n * _BLOCK * spacing) / 2 for a, b, n in zip(low, high, blocks, strict=True)])
    side = _BLOCK * spacing
    index = np.stack(np.meshgrid(*(np.arange(n) for n in blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    middle = origin + (index + 0.5) * side
    there = field(middle[:, 0], middle[:, 1], middle[:, 2])
    # One cell more on every side, so that each lattice point on a block's border has its own near block to come from.
    near = np.abs(there) <= steepness * math.sqrt(3) * (side / 2 + spacing)

    far = np.where(there > 0, side, -side).astype(np.float32).reshape(blocks)
    values = np.pad(np.repeat(np.repeat(np.repeat(far, _BLOCK, 0), _BLOCK, 1), _BLOCK, 2), ((0, 1),) * 3, mode="edge")
    wanted = np.zeros(values.shape, dtype=bool)
    corner = index[near] * _BLOCK
    cell = np.stack(np.meshgrid(*(np.arange(_BLOCK + 1),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for d in cell:
        wanted[tuple((corner + d).T)] = True
    at = np.nonzero(wanted)
    points = origin + np.stack(at, axis=1) * spacing
    parts = np.array_split(points, len(points) // 100_000 + 1)  # to stay within the processor's caches
    values[at] = np.concatenate([field(*part.T.copy()) for part in parts])
    return values, origin


def extract(
    field: Field, low: Point, high: Point, spacing: float, *, steepness: float, steps: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (V,3), mm, and faces (F,3), outwards, of the surface where the field is zero; closed inside the box.

    Vertices are `steps` times moved along the surface towards better triangles and put back on it.
    """
    from skimage.measure import marching_cubes

    values, origin = sample(field, low, high, spacing, steepness=steepness)
    # A surface through a lattice point would give triangles without area: keep it a little away.
    least = 0.05 * spacing
    values = np.where(np.abs(values) < least, np.where(values < 0, -least, least), values)
    positions, faces, _, _ = marching_cubes(values, 0.0, allow_degenerate=False)
    positions, faces = positions * spacing + origin, faces.astype(np.int32)
    for _ in range(steps):
        positions = onto(field, relax(positions, faces, steps=1), spacing)
    return positions, faces


def onto(field: Field, positions: np.ndarray, spacing: float) -> np.ndarray:
    """Positions (V,3) moved onto the surface by one Newton step, of at most half the spacing."""
    x, y, z = positions.T.copy()
    here = field(x, y, z)
    step = 0.1 * spacing
    ahead = field(x + step, y, z), field(x, y + step, z), field(x, y, z + step)
    gradient = (np.stack(ahead, axis=1) - here[:, None]) / step
    move = -here / np.maximum((gradient**2).sum(axis=1), 0.1)
    move = np.clip(move, -0.5 * spacing, 0.5 * spacing)
    return positions + gradient * move[:, None]


def spacing_for(vertices: int, area: float) -> float:
    """The lattice spacing, mm, at which marching cubes puts about that many vertices on a surface of `area` mm^2.

    A plane crosses |n_x| + |n_y| + |n_z| lattice edges per squared spacing, 1.5 on average over all directions.
    """
    return math.sqrt(1.5 * area / vertices)
