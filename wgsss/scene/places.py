"""Position and scale of the parts of a mesh file, and the parts that are too far apart to form one body."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.contents import Part
from wgsss.scene.mesh import MAX_SIZE, MIN_SIZE

Array = npt.NDArray[Any]

FAR = 16.0
"""Distance from the origin, in sizes of a body, beyond which its positions are stored relative to its own centre: else
float32 would lose four bits or more."""
APART = 1024.0
"""Distance of a part from the centre of a body, in sizes of the part, beyond which the two may become separate bodies:
else float32 would lose ten bits or more of its positions."""
_MOST_PARTS = 1000  # beyond which parts are not compared in pairs


def boxes(parts: Sequence[Part], positions: Sequence[Array]) -> Array:
    """Compute the bounding boxes of the faces of N parts, with positions (V, 3) each: float64 (N, 2, 3)."""
    used = [at[np.unique(part.faces)] for part, at in zip(parts, positions, strict=True)]
    return np.array([(at.min(axis=0), at.max(axis=0)) for at in used])


def scale(path: Path, around: Array, mm_per_unit: float, size_mm: float | None) -> float:
    """Choose the millimetres per unit of parts with bounding boxes (N, 2, 3).

    That is `mm_per_unit`, or if `size_mm` is given, the scale at which the longest side has that length.
    Raises InputError, naming the file, if the parts have no size or one out of range.
    """
    with np.errstate(over="ignore"):
        side = float((around[:, 1].max(axis=0) - around[:, 0].min(axis=0)).max())
        if side == 0:
            raise InputError(f"{path}: the mesh has zero size")
        ratio = float(mm_per_unit if size_mm is None else size_mm / side)
    if not MIN_SIZE <= side * ratio <= MAX_SIZE:
        raise InputError(f"{path}: a size of {side * ratio:g} mm is out of range ({MIN_SIZE:g} to {MAX_SIZE:g})")
    return ratio


def clusters(around: Array) -> Array:
    """Group parts with bounding boxes (N, 2, 3) that can form one body. Returns a group number for each: int (N,)."""
    low, high = around[:, 0], around[:, 1]
    size = (high - low).max(axis=1)
    middle = (low.min(axis=0) + high.max(axis=0)) / 2
    distance = np.abs((low + high) / 2 - middle).max(axis=1)
    if len(around) > _MOST_PARTS or (distance <= APART * size).all():
        return np.zeros(len(around), np.int64)
    from scipy.sparse.csgraph import connected_components

    gap = np.maximum(low[:, None] - high, low - high[:, None]).max(axis=2)
    labels: Array = connected_components(gap <= FAR * np.maximum(size[:, None], size), directed=False)[1]
    return labels


def centred(positions: Array, faces: Array) -> tuple[Array, Array]:
    """Return an origin (3,), mm, and the positions as float32 relative to it.

    The origin is that of the file, or the centre of the positions if they are far from it.
    """
    used = positions[np.unique(faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    middle = (low + high) / 2
    far = np.abs(middle).max() > FAR * max(float((high - low).max()), MIN_SIZE)
    centre = middle if far else np.zeros(3)
    with np.errstate(over="ignore"):
        return centre, (positions - centre).astype(np.float32)
