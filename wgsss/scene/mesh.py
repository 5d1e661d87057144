"""Triangle meshes with welded positions, and with texture coordinates, normals and colours per corner."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]

MIN_SIZE, MAX_SIZE = 1e-6, 1e9  # of a mesh's longest side, mm


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in millimetres, counter-clockwise seen from outside.

    `positions` are welded: no two are equal, so that the topology is connected across texture seams and hard edges.
    Texture coordinates, normals and colours, which may differ there, are stored per corner of a face. The arrays are
    read-only. Raises InputError if a shape does not fit, a number is not finite or a face index is out of range.
    """

    positions: Array
    """float32 (V, 3), mm"""
    faces: Array
    """int32 (F, 3), indices into positions"""
    corner_normals: Array | None = None
    """float32 (F, 3, 3) unit normals per corner, or None where the surface is smooth"""
    corner_uvs: Array | None = None
    """float32 (F, 3, 2), u to the right and v down, or None"""
    name: str = field(default="mesh", metadata={"fingerprint": False})
    corner_colors: Array | None = None
    """float32 (F, 3, 3), linear, multiply the base colour, or None"""
    shrunk: bool = False
    """whether a motion has made the mesh smaller than MIN_SIZE, and so invisible"""

    def __post_init__(self) -> None:
        self._hold("positions", np.float32, (None, 3))
        self._hold("faces", np.int32, (None, 3))
        corners = len(self.faces)
        self._hold("corner_normals", np.float32, (corners, 3, 3))
        self._hold("corner_uvs", np.float32, (corners, 3, 2))
        self._hold("corner_colors", np.float32, (corners, 3, 3))
        if not corners:
            raise InputError(f"{self.name}: the mesh has no faces")
        if self.faces.min() < 0 or self.faces.max() >= len(self.positions):
            raise InputError(f"{self.name}: a face refers to a vertex that does not exist")
        size = float(np.ptp(self.positions, axis=0).max())
        if not (self.shrunk or MIN_SIZE <= size) or size > MAX_SIZE:
            raise InputError(f"{self.name}: a size of {size:g} mm is out of range ({MIN_SIZE:g} to {MAX_SIZE:g})")

    def _hold(self, field: str, dtype: type, shape: tuple[int | None, ...]) -> None:
        value = getattr(self, field)
        if value is None:
            return
        with np.errstate(over="ignore"):
            array: Array = np.ascontiguousarray(value, dtype=dtype).view()
        if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
            wanted = " x ".join("N" if n is None else str(n) for n in shape)
            raise InputError(f"{self.name}: {field} must be {wanted}, not {' x '.join(map(str, array.shape))}")
        if dtype is np.float32 and not np.isfinite(array).all():
            raise InputError(f"{self.name}: {field} holds a number that is not finite")
        array.flags.writeable = False
        object.__setattr__(self, field, array)

    @cached_property
    def face_normals(self) -> Array:
        """float64 (F, 3): face normals whose length is twice the area of the face, mm^2."""
        a, b, c = (self.positions[self.faces[:, i]].astype(np.float64) for i in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def normals(self) -> Array:
        """float32 (V, 3): smooth unit normals. Each is the mean of the adjacent faces, weighted by their angle."""
        corners = self.positions.astype(np.float64)[self.faces]
        size = np.linalg.norm(self.face_normals, axis=1, keepdims=True)
        unit = np.divide(self.face_normals, size, out=np.zeros_like(self.face_normals), where=size > 0)
        total = np.zeros((len(self.positions), 3))
        for i in range(3):
            to_next, to_last = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
            angle = np.arctan2(size[:, 0], np.einsum("ij,ij->i", to_next, to_last))
            for axis in range(3):
                total[:, axis] += np.bincount(self.faces[:, i], angle * unit[:, axis], len(total))
        length = np.linalg.norm(total, axis=1, keepdims=True)
        # At a fold the sum may be zero. Any unit vector will do there.
        up = np.broadcast_to((0.0, 1.0, 0.0), total.shape)
        return np.where(length > 1e-12, total / np.maximum(length, 1e-12), up).astype(np.float32)

    @cached_property
    def shading_normals(self) -> Array:
        """float32 (F, 3, 3): the unit normals at the corners: `corner_normals` if there are any, else the smooth
        ones."""
        return self.normals[self.faces] if self.corner_normals is None else self.corner_normals

    @cached_property
    def area(self) -> float:
        """Surface area, mm^2."""
        return float(np.linalg.norm(self.face_normals, axis=1).sum() / 2)

    @cached_property
    def bounds(self) -> Array:
        """float32 (2, 3): the least and greatest coordinates, mm."""
        return np.stack([self.positions.min(axis=0), self.positions.max(axis=0)])

    def deformed(self, positions: Array) -> Mesh:
        """Return the mesh with other positions (V, 3), mm, and smooth normals.

        Animations often hide a part by scaling it to zero. The result is then a mesh that is `shrunk`.
        """
        if np.shape(positions) != self.positions.shape:
            raise InputError(f"{self.name}: a deformation must keep {len(self.positions)} positions")
        shrunk = bool(np.ptp(positions, axis=0).max() < MIN_SIZE)
        return replace(self, positions=positions, corner_normals=None, shrunk=shrunk)
