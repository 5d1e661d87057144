"""Evenly spread samples of a mesh, each with the area that is nearest to it, and an octree over them."""

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
"""The most samples of a mesh: they take 30 MB on the device, and half a minute to compute."""
_PARTS = 2.0  # parts per spacing along the edge of a triangle: about nine parts for each sample
_MOST_PARTS = 4_000_000  # long thin triangles are cut into many parts
_ROUNDS = 3  # of relaxation: the areas then differ by a fifth from their mean, and more rounds hardly improve that


@dataclass(frozen=True, eq=False)
class PointCloud:
    """The samples of a mesh, in the order of their octree."""

    samples: Samples
    tree: Octree
    spacing: float
    """mm: the square root of the mean area of a sample"""


def point_cloud(mesh: Mesh, spacing: float) -> PointCloud:
    """Return samples of a mesh, one for each `spacing` x `spacing` mm^2. Cached.

    If these were more than MOST, a warning states the larger spacing that is used. Raises InputError for a mesh without
    an area.
    """
    if not mesh.area > 0.0:
        raise InputError(f"{mesh.name}: the mesh has no area to spread samples over")
    count_at_spacing = mesh.area / spacing**2
    if count_at_spacing > MOST:
        coarser = float(np.sqrt(mesh.area / MOST))
        warnings.warn(
            f"{mesh.name}: {count_at_spacing:.3g} samples {spacing:.2g} mm apart are too many: "
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
    """Compute the samples of a mesh and their octree."""
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
    """Return the barycentric coordinates (N, 3) of the points x (N, 3), projected onto triangles (N, 3, 3).

    Points outside their triangle are moved to its border. `otherwise` (N, 3) is used for degenerate triangles.
    """
    first, second = (corners[:, i] - corners[:, 0] for i in (1, 2))
    a, b, c = (np.einsum("nd,nd->n", *pair) for pair in ((first, first), (first, second), (second, second)))
    u, v = (np.einsum("nd,nd->n", edge, x - corners[:, 0]) for edge in (first, second))
    size = a * c - b * b
    has_area = size > 1e-9 * a * c
    inside = np.stack([c * u - b * v, a * v - b * u], axis=1) / np.where(has_area, size, 1.0)[:, None]
    barycentric = np.maximum(np.column_stack([1.0 - inside.sum(axis=1), inside]), 0.0)
    return np.where(has_area[:, None], barycentric / barycentric.sum(axis=1, keepdims=True), otherwise)


def _parts(mesh: Mesh, spacing: float) -> Samples:
    """Return small parts of the triangles of a mesh, from which the cells of the samples are formed."""
    width = spacing / _PARTS
    while count(mesh, width) > max(_MOST_PARTS, 2 * len(mesh.faces)):
        width *= 1.2
    return subdivided(mesh, width)


def _normals(mesh: Mesh) -> Array:
    """Return the unit normals of the faces (F, 3); 0 for faces without area."""
    normal = mesh.face_normals
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def _spread(x: Array, normal: Array, area: Array, spacing: float) -> tuple[Array, Array, Array]:
    """Divide parts at `x` (P, 3) into cells. Returns the middle part, the area and the centroid (3,) of each cell.

    This is Lloyd's relaxation. It starts with sites along a space-filling curve that have equal areas between them.
    Each site then moves to the part that is nearest to the centroid of its cell: the parts that are nearest to the
    site. The cells are as even as those by Turk's repulsion, and sums over their centroids are accurate to second
    order. Distances include the difference of the normals, so the two sides of a thin sheet have separate cells.
    """
    from scipy.spatial import KDTree

    points = np.concatenate([x, 2.0 * spacing * normal], axis=1)
    sites = min(max(round(float(area.sum()) / spacing**2), 1), len(x))
    along = np.argsort(morton(x), kind="stable")
    reached = np.cumsum(area[along])
    site = along[np.unique(np.searchsorted(reached, (np.arange(sites) + 0.5) / sites * reached[-1]))]
    for last in [False] * _ROUNDS + [True]:
        cell = KDTree(points[site]).query(points, workers=-1)[1]
        size = np.bincount(cell, area, len(site))
        moments = [np.bincount(cell, area * column, len(site)) for column in points.T]
        middle = np.stack(moments, axis=1) / np.maximum(size, 1e-300)[:, None]
        if last:
            break
        off = np.square(points - middle[cell]).sum(axis=1)
        least = np.full(len(site), np.inf)
        np.minimum.at(least, cell, off)
        nearest = np.flatnonzero(off == least[cell])
        site[cell[nearest]] = nearest
    used = size > 0.0  # of two sites at the same point, one gets all parts
    return site[used], size[used], middle[used, :3]
