"""Points spread evenly over a mesh, each with the area nearest to it, and the octree over them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.octree import Octree, morton, octree
from wgsss.bake.samples import Samples, count, subdivided
from wgsss.cache import Arrays, cached
from wgsss.errors import InputError, Note
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

MOST = 200_000
"""Points on one mesh: they take some 30 MB on the device, and half a minute to spread."""
_PARTS = 2.0  # per spacing along a triangle's edge: some nine parts of triangles to a point
_MOST_PARTS = 4_000_000  # slivers are cut into many
_ROUNDS = 3  # of relaxation: areas then spread by a fifth about their mean, and more rounds hardly even them out


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Samples of a mesh in the order of their octree."""

    samples: Samples
    tree: Octree
    spacing: float
    """mm: the root of the mean area of a sample"""


def point_cloud(mesh: Mesh, spacing: float) -> PointCloud:
    """Samples of `mesh`, one to each `spacing` x `spacing` mm^2, cached.

    There are at most MOST of them: where that is too few, a warning says what spacing they have instead. Raises
    InputError for a mesh without an area.
    """
    if not mesh.area > 0.0:
        raise InputError(f"{mesh.name}: the mesh has no area to spread samples over")
    wanted = mesh.area / spacing**2
    if wanted > MOST:
        coarser = float(np.sqrt(mesh.area / MOST))
        warnings.warn(
            f"{mesh.name}: {wanted:.3g} samples {spacing:.2g} mm apart are too many: "
            f"{MOST} are used, {coarser:.2g} mm apart",
            Note,
            stacklevel=2,
        )
        spacing = coarser

    def make() -> Arrays:
        samples, tree = _make(mesh, spacing)
        return {f.name: getattr(part, f.name) for part in (samples, tree) for f in fields(part)}

    label = f"spreading {mesh.area / spacing**2:.0f} samples over {mesh.name}"
    arrays = cached("point_cloud", [mesh, spacing], make, label=label)
    samples = Samples(**{f.name: arrays[f.name] for f in fields(Samples)})
    tree = Octree(**{f.name: arrays[f.name] for f in fields(Octree)})
    return PointCloud(samples, tree, float(np.sqrt(mesh.area / len(samples.face))))


def _make(mesh: Mesh, spacing: float) -> tuple[Samples, Octree]:
    parts = _parts(mesh, spacing)
    area = np.linalg.norm(mesh.face_normals, axis=1)[parts.face] / 2 * parts.share
    keep = area > 0
    parts, area = Samples(parts.face[keep], parts.barycentric[keep], parts.share[keep]), area[keep]
    corners = mesh.positions[mesh.faces].astype(np.float64)
    x = np.einsum("nk,nkd->nd", parts.barycentric, corners[parts.face])
    site, size, middle = _spread(x, _normals(mesh)[parts.face], area, spacing)
    face = parts.face[site]
    barycentric = _above(corners[face], middle, parts.barycentric[site])
    tree, order = octree(np.einsum("nk,nkd->nd", barycentric, corners[face]))
    # A sample's area, as a share of its own face, moves with the face.
    share = size / (np.linalg.norm(mesh.face_normals, axis=1)[face] / 2)
    return Samples(face[order], barycentric[order], share[order]), tree


def _above(corners: Array, x: Array, otherwise: Array) -> Array:
    """Barycentric coordinates (N, 3) of what x (N, 3) is above on triangles (N, 3, 3), or of a place near it inside;
    `otherwise` on triangles too thin to tell."""
    first, second = (corners[:, i] - corners[:, 0] for i in (1, 2))
    a, b, c = (np.einsum("nd,nd->n", *pair) for pair in ((first, first), (first, second), (second, second)))
    u, v = (np.einsum("nd,nd->n", edge, x - corners[:, 0]) for edge in (first, second))
    size = a * c - b * b
    sound = size > 1e-9 * a * c
    inside = np.stack([c * u - b * v, a * v - b * u], axis=1) / np.where(sound, size, 1.0)[:, None]
    found = np.maximum(np.column_stack([1.0 - inside.sum(axis=1), inside]), 0.0)
    return np.where(sound[:, None], found / found.sum(axis=1, keepdims=True), otherwise)


def _parts(mesh: Mesh, spacing: float) -> Samples:
    """Small parts of the mesh's triangles, which are then dealt out to the samples."""
    width = spacing / _PARTS
    while count(mesh, width) > max(_MOST_PARTS, 2 * len(mesh.faces)):
        width *= 1.2
    return subdivided(mesh, width)


def _normals(mesh: Mesh) -> Array:
    normal = mesh.face_normals
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def _spread(x: Array, normal: Array, area: Array, spacing: float) -> tuple[Array, Array, Array]:
    """Cells of parts at `x` (P, 3): which part is in the middle of each, the cells' areas and their centroids.

    Lloyd's relaxation: from a start with equal areas between sites along a space-filling curve, each site moves to the
    part nearest to the centroid of the parts that are nearest to it. The evenness is that of Turk's repulsion, and a
    sum over centroids is right to second order. What faces another way is far: the two sides of a thin sheet have
    cells of their own.
    """
    from scipy.spatial import KDTree

    where = np.concatenate([x, 2.0 * spacing * normal], axis=1)
    sites = min(max(round(float(area.sum()) / spacing**2), 1), len(x))
    along = np.argsort(morton(x), kind="stable")
    reached = np.cumsum(area[along])
    site = along[np.unique(np.searchsorted(reached, (np.arange(sites) + 0.5) / sites * reached[-1]))]
    for last in [False] * _ROUNDS + [True]:
        cell = KDTree(where[site]).query(where, workers=-1)[1]
        size = np.bincount(cell, area, len(site))
        moments = [np.bincount(cell, area * column, len(site)) for column in where.T]
        middle = np.stack(moments, axis=1) / np.maximum(size, 1e-300)[:, None]
        if last:
            break
        off = np.square(where - middle[cell]).sum(axis=1)
        least = np.full(len(site), np.inf)
        np.minimum.at(least, cell, off)
        nearest = np.flatnonzero(off == least[cell])
        site[cell[nearest]] = nearest
    kept = size > 0.0  # of two at one place, one has all
    return site[kept], size[kept], middle[kept, :3]
