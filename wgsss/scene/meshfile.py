"""Reading mesh files through trimesh into plain arrays, keeping every texture seam and hard edge the file has."""

from __future__ import annotations

import io
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.images import require_file
from wgsss.scene.material import Maps
from wgsss.scene.polygons import off_as_triangles, ply_as_ascii
from wgsss.scene.textures import shared_maps

Array = npt.NDArray[Any]

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")
# Formats that say what their unit is; all others are taken to be in millimetres.
MM_PER_UNIT = {".glb": 1000.0, ".gltf": 1000.0}


@dataclass(frozen=True)
class Triangles:
    """All triangles of a file, in its own units."""

    positions: Array
    """float64 (V, 3), as the file splits them"""
    faces: Array
    """int64 (F, 3)"""
    normals: Array | None
    """float64 (V, 3); zero for parts of the file that have none"""
    uvs: Array | None
    """float64 (V, 2), v down"""
    maps: Maps
    splits: bool
    """whether vertices may be repeated for a reason: seams, hard edges, several parts, a format without indices"""
    notes: tuple[str, ...]
    """what was left out"""
    parts: tuple[tuple[Array, Array], ...]
    """positions (V, 3) before they were placed, and placement (4, 4), of the parts that follow one another above"""


def read_triangles(path: Path) -> Triangles:
    """All triangles of a mesh file, its parts placed by its scene graph and merged, larger faces split into triangles.

    Raises InputError for a file that is missing, of an ending not in SUFFIXES, damaged, or without faces.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: not a mesh format that can be read ({' '.join(SUFFIXES)})")
    require_file(path)
    parts = _parts(path)
    if sum(len(mesh.faces) for mesh, _ in parts) < _declared_faces(path):
        raise InputError(f"{path}: damaged: it holds fewer faces than it says")
    if not parts:
        raise InputError(f"{path}: the mesh is empty: it has no faces")

    positions, faces, normals, uvs, at = [], [], [], [], 0
    for mesh, matrix in parts:
        linear, shift = matrix[:3, :3], matrix[:3, 3]
        vertices, corners = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        if corners.min() < 0 or corners.max() >= len(vertices):
            raise InputError(f"{path}: damaged: a face names a vertex that is not there")
        mirrored = np.linalg.det(linear) < 0
        positions.append(_transform(vertices, linear) + shift)
        faces.append((corners[:, ::-1] if mirrored else corners) + at)
        own = _normals(mesh)
        if own is None or np.linalg.det(linear) == 0:
            normals.append(np.zeros_like(vertices))
        else:
            normals.append(_transform(own, np.linalg.inv(linear).T))
        uvs.append(_uvs(mesh))
        at += len(vertices)

    notes = []
    maps = Maps()
    with_uvs = [uv for uv in uvs if uv is not None]
    if len(with_uvs) == len(parts):
        maps, left_out = shared_maps([getattr(mesh.visual, "material", None) for mesh, _ in parts], path.parent)
        notes += left_out
    elif with_uvs:
        notes.append(f"texture coordinates left out: {len(parts) - len(with_uvs)} of {len(parts)} parts have none")
    has_normals = any(n.any() for n in normals)
    has_uvs = len(with_uvs) == len(parts)
    return Triangles(
        np.concatenate(positions),
        np.concatenate(faces),
        np.concatenate(normals) if has_normals else None,
        np.concatenate(with_uvs) if has_uvs else None,
        maps,
        splits=has_normals or bool(with_uvs) or len(parts) > 1 or path.suffix.lower() == ".stl",
        notes=tuple(notes),
        parts=tuple((np.asarray(mesh.vertices, np.float64), matrix) for mesh, matrix in parts),
    )


def _transform(vectors: Array, linear: Array) -> Array:
    """Each row times the matrix. In plain sums: BLAS may round equal rows differently, which would open seams."""
    x, y, z = vectors.T
    with np.errstate(all="ignore"):  # positions that are not finite are the caller's to find
        return np.stack([x * row[0] + y * row[1] + z * row[2] for row in linear], axis=1)


def _parts(path: Path) -> list[tuple[Any, Array]]:
    """The triangle meshes of a file and their (4, 4) placements."""
    import trimesh

    suffix = path.suffix.lower()
    try:
        with _quiet():
            loaded = _load(path)
            placed = [loaded.graph[node] for node in loaded.graph.nodes_geometry]
            meshes = [(loaded.geometry[name], np.asarray(matrix, np.float64)) for matrix, name in placed]
            return [(m, matrix) for m, matrix in meshes if isinstance(m, trimesh.Trimesh) and len(m.faces)]
    except Exception as error:  # its readers let every kind of exception through
        reason = " ".join(str(error).split()) if isinstance(error, ValueError | NotImplementedError) else ""
        raise InputError(f"{path}: damaged, or not a {suffix} file{f' ({reason[:100]})' if reason else ''}") from None


def _load(path: Path) -> Any:
    """A trimesh scene, as the file has it."""
    import trimesh

    options, suffix = _options(path), path.suffix.lower()
    try:
        return trimesh.load_scene(str(path), process=False, **options)
    except (ValueError, TypeError):
        rewrite = {".ply": ply_as_ascii, ".off": off_as_triangles}.get(suffix)
        if rewrite is None:
            raise
        file, folder = io.BytesIO(rewrite(path.read_bytes())), trimesh.resolvers.FilePathResolver(str(path))
        return trimesh.load_scene(file, file_type=suffix[1:], resolver=folder, process=False, **options)


def _declared_faces(path: Path) -> int:
    """How many faces a file says it has, where trimesh does not look whether they came."""
    with path.open("rb") as file:
        head = file.read(4096)
    found = {
        ".ply": re.search(rb"^element face (\d+)", head, re.MULTILINE),
        ".off": re.search(rb"^\d+\s+(\d+)", re.sub(rb"#[^\n]*|C?OFF", b"", head).lstrip()),
    }.get(path.suffix.lower())
    return int(found[1]) if found else 0


def _options(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        head = file.read(4096)
    if path.suffix.lower() in (".obj", ".off") and b"\0" in head:
        raise ValueError("it is not text")
    if path.suffix.lower() == ".ply":
        # Texture coordinates per corner must split the vertices; given per vertex, splitting would only reorder them.
        return {"fix_texture": _has_corner_uvs(head)}
    return {}


def _has_corner_uvs(ply_head: bytes) -> bool:
    return re.search(rb"property list \w+ \w+ texcoord", ply_head) is not None


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence trimesh's log and numpy's warnings, except for the one by which text readers tell of damage."""
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message="string or file could not be read")
            yield
    finally:
        log.setLevel(level)


def _normals(mesh: Any) -> Array | None:
    """The file's own normals (V, 3): asking trimesh for `vertex_normals` would compute some where there are none."""
    own = mesh._cache["vertex_normals"]
    return None if own is None or len(own) != len(mesh.vertices) else np.asarray(own, np.float64)


def _uvs(mesh: Any) -> Array | None:
    """Texture coordinates (V, 2), v down: trimesh turns every format's v to point up."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None or np.shape(uv) != (len(mesh.vertices), 2) or not np.isfinite(uv).all():
        return None
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)
