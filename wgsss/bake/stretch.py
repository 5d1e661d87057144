"""The stretch between surface and atlas: the metric of the parametrisation (Mikkelsen 2009, eq. 43 and 44)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.unwrap import RenderMesh, atlas_vertices
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Stretch:
    """The stretch at each render vertex: a step of d mm on the surface is a step of root @ axes @ d in the atlas, uv.

    `root` is the symmetric square root of the inverse metric (J^T J)^-1, where J = [sigma_s sigma_t] are the
    derivatives of the position by the texture coordinates (eq. 43, 44). An area dA in the atlas covers dA / det(root)
    mm^2. `axes` are the directions on the surface of the columns of `root`: the orthonormal pair nearest to the
    gradients of u and v.
    """

    root: Array
    """float64 (R, 2, 2), uv per mm"""
    axes: Array
    """float64 (R, 2, 3): means over the adjacent faces, which are not quite orthonormal on a bent surface"""


def stretch(mesh: Mesh, render_mesh: RenderMesh) -> Stretch:
    """Return the stretch at the render vertices: means over the adjacent faces, weighted by area.

    Roots are averaged instead of inverse metrics, since area times root stays bounded for degenerate faces. Roots and
    axes are averaged separately, since the mean of the gradients on a bent surface would be too short.
    """
    gradients, areas = face_gradients(mesh, render_mesh)
    roots = _root(gradients @ gradients.transpose(0, 2, 1))
    regular = np.linalg.det(roots) > 0
    areas = np.where(regular, areas, 0)
    axes = np.linalg.solve(np.where(regular[:, None, None], roots, np.eye(2)), gradients)
    point = atlas_vertices(render_mesh.vertex, render_mesh.atlas)
    corner = point[render_mesh.faces].reshape(-1)
    count = int(point.max()) + 1
    weight = np.bincount(corner, np.repeat(areas, 3), count)

    def mean(values: Array) -> Array:
        columns = (areas[:, None] * values.reshape(len(values), -1)).repeat(3, axis=0).T
        total = np.stack([np.bincount(corner, column, count) for column in columns], axis=-1)
        return (total / np.where(weight > 0, weight, 1)[:, None]).reshape(count, *values.shape[1:])

    root = mean(roots)
    # If all adjacent faces are degenerate, nothing is drawn: any finite value will do.
    root[weight == 0] = np.average(roots, axis=0, weights=areas) if areas.any() else np.eye(2)
    return Stretch(root[point], mean(axes)[point])


def face_gradients(mesh: Mesh, render_mesh: RenderMesh) -> tuple[Array, Array]:
    """Return the gradients of u and v over each face, float64 (F, 2, 3), uv per mm, and its area (F,), mm^2.

    The gradients are the rows of the pseudo-inverse of [sigma_s sigma_t]. They are 0 for faces without an area.
    """
    corners = mesh.positions.astype(np.float64)[mesh.faces]
    texture = render_mesh.atlas.astype(np.float64)[render_mesh.faces]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    area = np.linalg.norm(normal, axis=1)  # twice that of the triangle
    longest = np.maximum(np.einsum("ij,ij->i", first, first), np.einsum("ij,ij->i", second, second))
    has_area = area > 1e-10 * longest
    # The gradients of the barycentric coordinates of corners 1 and 2.
    barycentric = np.stack([np.cross(second, normal), np.cross(normal, first)], axis=1)
    barycentric /= np.where(has_area, area, 1)[:, None, None] ** 2
    edges = np.stack([texture[:, 1] - texture[:, 0], texture[:, 2] - texture[:, 0]], axis=-1)
    return np.where(has_area[:, None, None], edges @ barycentric, 0), np.where(has_area, area / 2, 0)


def _root(matrices: Array) -> Array:
    """Return the symmetric square roots (..., 2, 2) of positive semi-definite matrices A (..., 2, 2).

    They are (A + sqrt(det A) I) / sqrt(tr A + 2 sqrt(det A)).
    """
    root_det = np.sqrt(np.maximum(np.linalg.det(matrices), 0))
    scale = np.sqrt(np.trace(matrices, axis1=-2, axis2=-1) + 2 * root_det)[..., None, None]
    return (matrices + root_det[..., None, None] * np.eye(2)) / np.where(scale > 0, scale, 1)
