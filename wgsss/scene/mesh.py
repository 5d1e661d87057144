"""Triangle meshes: welded positions for topology, and texture coordinates and normals per corner beside them."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.material import Maps

if TYPE_CHECKING:
    from wgsss.scene.animation import Animation

Array = npt.NDArray[Any]

MIN_SIZE, MAX_SIZE = 1e-6, 1e9  # of a mesh's longest side, mm
# A file's normals are kept where more than this share of them lies further than this from the smooth ones: hard edges,
# or normals set by hand. Below that they are smooth ones computed with other weights, and cracked at texture seams.
OWN_NORMALS_SHARE, OWN_NORMALS_DEGREES = 1e-3, 20.0


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in millimetres, counter-clockwise seen from outside.

    `positions` are welded: no two are equal, so that edges and neighbours cross texture seams. What a seam or a hard
    edge splits, texture coordinates and normals, is kept per corner of a face. The arrays are held read-only.
    Raises InputError where shapes do not fit, a number is not finite or a face names a vertex that is not there.
    """

    positions: Array
    """float32 (V, 3), mm"""
    faces: Array
    """int32 (F, 3), indices into positions"""
    corner_normals: Array | None = None
    """float32 (F, 3, 3) unit normals per corner, or None where the surface is smooth"""
    corner_uvs: Array | None = None
    """float32 (F, 3, 2), u to the right and v down, or None"""
    name: str = "mesh"

    def __post_init__(self) -> None:
        self._hold("positions", np.float32, (None, 3))
        self._hold("faces", np.int32, (None, 3))
        corners = len(self.faces)
        self._hold("corner_normals", np.float32, (corners, 3, 3))
        self._hold("corner_uvs", np.float32, (corners, 3, 2))
        if not corners:
            raise InputError(f"{self.name}: the mesh has no faces")
        if self.faces.min() < 0 or self.faces.max() >= len(self.positions):
            raise InputError(f"{self.name}: a face names a vertex that is not there")
        size = float(np.ptp(self.positions, axis=0).max())
        if not MIN_SIZE <= size <= MAX_SIZE:
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
        """float64 (F, 3): normals as long as twice the face's area, mm^2."""
        a, b, c = (self.positions[self.faces[:, i]].astype(np.float64) for i in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def normals(self) -> Array:
        """float32 (V, 3): smooth unit normals, the mean of the faces around weighted by their angle at the vertex."""
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
        # The fan of a folded sheet may cancel out; any direction is as good there, but it must be a unit vector.
        up = np.broadcast_to((0.0, 1.0, 0.0), total.shape)
        return np.where(length > 1e-12, total / np.maximum(length, 1e-12), up).astype(np.float32)

    @cached_property
    def shading_normals(self) -> Array:
        """float32 (F, 3, 3): the unit normal at each corner, from the file where it has hard edges, else smooth."""
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
        """The same topology and texture coordinates at other positions (V, 3), mm, with smooth normals."""
        if np.shape(positions) != self.positions.shape:
            raise InputError(f"{self.name}: a deformation must keep {len(self.positions)} positions")
        return replace(self, positions=positions, corner_normals=None)


@dataclass(frozen=True, eq=False)
class LoadedMesh:
    """What a mesh file holds: the surface, the textures of its material, and how it moves."""

    mesh: Mesh
    maps: Maps = field(default_factory=Maps)
    motion: Animation | None = None


def load_mesh(
    path: str | Path, *, mm_per_unit: float | None = None, size_mm: float | None = None, animation: str | None = None
) -> LoadedMesh:
    """Read a triangle mesh from a .ply, .obj, .stl, .off, .glb or .gltf file.

    `mm_per_unit` is the length of the file's unit; without it, 1000 for glTF, whose unit is the metre, and 1 for the
    others. `size_mm` scales the longest side of the bounding box, at rest, to a length, whatever the unit.
    `animation` is the name of the glTF animation that becomes the motion, or its number where it has none: without it
    the first one, and none where it is "none".

    Several parts, placed by the file's scene graph, become one mesh. Textures (base colour, normal, specular) are kept
    where all parts share them; constant colours of the file's materials are not. Normals are kept where they are not
    smooth. Degenerate and duplicate faces and unused vertices are dropped, faces wound inwards turned over and holes
    counted, all of it told in one warning.

    Raises InputError, naming the file, where it is missing, not what its ending says, empty, without an area, or holds
    positions that are not finite, for a skin, morph targets or an animation that do not fit it, and for a scale that is
    not positive.
    """
    from wgsss.scene.animation import Animation, animate
    from wgsss.scene.meshfile import MM_PER_UNIT, read_triangles
    from wgsss.scene.repair import counted, repair

    path = Path(path)
    for name, value in (("mm_per_unit", mm_per_unit), ("size_mm", size_mm)):
        if value is not None and not (isinstance(value, Real) and 0 < value < math.inf):
            raise InputError(f"{path}: {name} must be a number above 0, not {value!r}")
    file, clip = animate(path, read_triangles(path), animation)
    bad = int((~np.isfinite(file.positions)).any(axis=1).sum())
    if bad:
        raise InputError(f"{path}: {bad} of {len(file.positions)} positions are not finite numbers")
    used = file.positions[np.unique(file.faces)]
    side = float((used.max(axis=0) - used.min(axis=0)).max())
    if side == 0:
        raise InputError(f"{path}: the mesh has zero size")
    scale = size_mm / side if size_mm is not None else mm_per_unit or MM_PER_UNIT.get(path.suffix.lower(), 1.0)
    if not MIN_SIZE <= side * scale <= MAX_SIZE:
        raise InputError(f"{path}: a size of {side * scale:g} mm is out of range ({MIN_SIZE:g} to {MAX_SIZE:g})")

    fixed = repair((file.positions * scale).astype(np.float32), file.faces)
    if not len(fixed.faces):
        raise InputError(f"{path}: the mesh has no area: all {len(file.faces)} faces are degenerate")
    notes = [*fixed.notes, *file.notes]
    if fixed.welded and not file.splits:
        notes.insert(0, f"{counted(fixed.welded, 'duplicate vertex')} welded")
    if notes:
        warnings.warn(f"{path.name}: {'; '.join(notes)}", stacklevel=2)

    corner_uvs = None if file.uvs is None else fixed.corners(file.uvs[file.faces])
    mesh = Mesh(fixed.positions, fixed.faces, corner_uvs=corner_uvs, name=path.stem)
    if file.normals is not None and not fixed.flipped.any():
        mesh = replace(mesh, corner_normals=_own_normals(mesh, fixed.corners(file.normals[file.faces])))
    motion = None if clip is None else Animation(clip, clip.first[fixed.sources(file.faces)], scale)
    return LoadedMesh(mesh, file.maps, motion)


def _own_normals(mesh: Mesh, normals: Array) -> Array | None:
    """A file's normals (F, 3, 3), made unit, with smooth ones where it has none; None where they are smooth anyway."""
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    smooth = mesh.normals[mesh.faces]
    unit = np.where(np.isfinite(length) & (length > 1e-6), normals / np.maximum(length, 1e-6), smooth)
    far = np.einsum("ijk,ijk->ij", unit, smooth) < math.cos(math.radians(OWN_NORMALS_DEGREES))
    return unit if far.mean() > OWN_NORMALS_SHARE else None
