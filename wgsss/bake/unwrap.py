"""Unique texture coordinates for a mesh, and the render mesh that carries them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from importlib.metadata import version
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.atlas import library, new_atlas
from wgsss.cache import Arrays, cached
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.scene.geometry import face_components
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

COVERAGE_SIZE = 1024
"""Width of the map on which texture coordinates of files are tested for overlaps, texels."""
MAX_SHARE = 1e-3
"""The largest share of covered texels that may overlap, and of the surface that may be without texels, by rounding."""
MARGIN = 1e-4
"""Texture coordinates that leave the unit square by more than this are fitted into it."""


@dataclass(frozen=True, eq=False)
class RenderMesh:
    """A render mesh: the vertices of a mesh, split where texture coordinates, normals or colours differ."""

    vertex: Array
    """int32 (R,): index into the positions of the mesh"""
    normals: Array
    """float32 (R, 3): unit shading normals"""
    atlas: Array
    """float32 (R, 2): unique texture coordinates in 0..1, v down: no two points of the surface have the same"""
    uvs: Array
    """float32 (R, 2): the texture coordinates of the file, for its maps, v down, or zeros"""
    faces: Array
    """int32 (F, 3): indices of render vertices; the faces are in the order of the mesh"""
    colors: Array
    """float32 (R, 3): the vertex colours of the file, linear, or ones"""
    charts: Array
    """int32 (F,): the chart of each face, 0..C-1"""


def unwrap(gpu: Gpu, mesh: Mesh) -> RenderMesh:
    """Return the render mesh of a mesh, with an atlas. Cached.

    The atlas are the texture coordinates of the mesh if they are unique, else new ones (`atlas.new_atlas`). Raises
    InputError if the mesh has no face with an area.
    """
    key = [mesh, library(), version(library()), gpu.name]

    def make() -> Arrays:
        render_mesh = _unwrap(gpu, mesh)
        return {f.name: getattr(render_mesh, f.name) for f in fields(RenderMesh)}

    label = f"unwrapping {len(mesh.faces)} faces"
    return RenderMesh(**cached("unwrap", key, make, label=label))


def split(mesh: Mesh) -> RenderMesh:
    """Return the render mesh of a mesh without an atlas: `atlas` and `charts` are 0."""
    return _render_mesh(mesh, None)


def _unwrap(gpu: Gpu, mesh: Mesh) -> RenderMesh:
    """Compute the result of `unwrap`."""
    atlas = None if mesh.corner_uvs is None else _fitted(mesh.corner_uvs)
    if atlas is None or not is_unique(gpu, mesh, atlas):
        atlas = new_atlas(mesh)
    render_mesh = _render_mesh(mesh, atlas)
    charts = face_components(atlas_vertices(render_mesh.vertex, render_mesh.atlas)[render_mesh.faces])
    return replace(render_mesh, charts=charts)


def _render_mesh(mesh: Mesh, atlas: Array | None) -> RenderMesh:
    """Split the vertices of a mesh where their corners differ in the atlas (F, 3, 2) or the mesh's own attributes."""
    attributes = (atlas, mesh.corner_uvs, mesh.corner_normals, mesh.corner_colors)
    corners = [a.reshape(-1, a.shape[-1]) for a in attributes if a is not None]
    first, index = _distinct([mesh.faces.reshape(-1, 1), *corners])
    vertex = mesh.faces.reshape(-1)[first]
    none, white = np.zeros((len(first), 2), np.float32), np.ones((len(first), 3), np.float32)
    return RenderMesh(
        vertex=vertex,
        normals=mesh.shading_normals.reshape(-1, 3)[first],
        atlas=none if atlas is None else atlas.reshape(-1, 2)[first],
        uvs=none if mesh.corner_uvs is None else mesh.corner_uvs.reshape(-1, 2)[first],
        colors=white if mesh.corner_colors is None else mesh.corner_colors.reshape(-1, 3)[first],
        faces=index.reshape(-1, 3).astype(np.int32),
        charts=np.zeros(len(mesh.faces), np.int32),
    )


def atlas_vertices(vertex: Array, atlas: Array) -> Array:
    """Number the points of the atlas: int64 (R,), equal for render vertices that differ in normal or colour only."""
    return _distinct([vertex.reshape(-1, 1), atlas])[1]


def is_unique(gpu: Gpu, mesh: Mesh, corner_uvs: Array) -> bool:
    """Return whether texture coordinates (F, 3, 2) in the unit square can serve as an atlas.

    Their triangles must not overlap, and (nearly) all of the surface must have an area in the map.
    """
    edges = corner_uvs[:, 1:] - corner_uvs[:, :1].astype(np.float64)
    flat = np.abs(np.linalg.det(edges)) < 1e-12
    areas = np.linalg.norm(mesh.face_normals, axis=1)
    if areas[flat].sum() > MAX_SHARE * areas.sum():
        return False
    graph = Graph(gpu)
    uvs = gpu.buffer(corner_uvs)
    drawn = [
        graph.draw("bake/atlas_faces", size=(COVERAGE_SIZE, COVERAGE_SIZE), count=3 * len(mesh.faces), corner_uvs=uvs,
                   params=dict(face_count=len(mesh.faces), reverse=order))
        for order in (0, 1)
    ]  # fmt: skip
    graph.run(*drawn)
    last, first = (graph.read(handle) for handle in drawn)
    covered, overlapping = np.count_nonzero(last), np.count_nonzero(last != first)
    return bool(covered and overlapping <= MAX_SHARE * covered)


def _fitted(uvs: Array) -> Array:
    """Move and scale texture coordinates into the unit square if they leave it by more than MARGIN."""
    low, high = uvs.min(axis=(0, 1)), uvs.max(axis=(0, 1))
    if low.min() < -MARGIN or high.max() > 1 + MARGIN:
        uvs = (uvs - low) / np.maximum(high - low, np.finfo(np.float32).tiny)
    return np.clip(uvs, 0, 1)


def _distinct(columns: list[Array]) -> tuple[Array, Array]:
    """Sort the distinct rows of joined columns. Returns the first row (N,) of each, and the rank of each row."""
    bits = [c.astype(np.int32) if c.dtype.kind == "i" else (c + np.float32(0)).view(np.int32) for c in columns]
    rows = np.ascontiguousarray(np.concatenate(bits, axis=1))
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    new = np.ones(len(rows), bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    index = np.empty(len(rows), np.int64)
    index[order] = np.cumsum(new) - 1
    return order[new], index
