"""The borders of the charts, and the maps that continue the surface beyond them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.unwrap import RenderMesh, atlas_vertices

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Seams:
    """The N border edges of the charts, each with the map that unfolds the surface across it."""

    ends: Array
    """float64 (N, 2, 2): the two ends of each edge, uv"""
    outward: Array
    """float64 (N,): +1 if the outside of the chart is to the left of the edge (in uv, v down), else -1"""
    maps: Array
    """float64 (N, 2, 3): the affine map from uv beyond the edge to the uv of the neighbouring triangle"""
    charts: Array
    """int32 (N,): the chart of each edge"""


def find_seams(render_mesh: RenderMesh, roots: Array) -> Seams:
    """Return the seams of a render mesh. `roots` (R, 2, 2) are `Stretch.root`.

    The map of a seam takes the edge to the same edge of the neighbouring triangle. It takes a step on the surface
    perpendicular to the edge to the step that continues it there, of the same length in mm. At an open edge of the mesh
    the map is a reflection about the edge, measured on the surface: a blur then keeps constants, and no light is lost.
    """
    atlas = render_mesh.atlas.astype(np.float64)
    start = render_mesh.faces.reshape(-1)  # half-edge 3 f + k goes from corner k of face f to the next one
    end, third = render_mesh.faces[:, [1, 2, 0]].reshape(-1), render_mesh.faces[:, [2, 0, 1]].reshape(-1)
    has_area = np.abs(np.linalg.det(atlas[render_mesh.faces[:, 1:]] - atlas[render_mesh.faces[:, :1]])) > 1e-14
    usable = np.repeat(has_area, 3) & (render_mesh.vertex[start] != render_mesh.vertex[end])
    point = atlas_vertices(render_mesh.vertex, render_mesh.atlas)
    inside = _others(point[start], point[end], usable)
    other = _others(render_mesh.vertex[start], render_mesh.vertex[end], usable)

    border = np.flatnonzero(usable & (inside < 0))
    i, j = start[border], end[border]
    edge = atlas[j] - atlas[i]
    step, side = _perpendicular(edge, atlas[third[border]] - atlas[i], (roots[i] + roots[j]) / 2)
    frame = np.stack([edge, -step], axis=-1)

    beyond = other[border]
    open_edge = beyond < 0
    beyond = np.where(open_edge, border, beyond)
    same_way = render_mesh.vertex[start[beyond]] == render_mesh.vertex[i]
    k, m = np.where(same_way, start[beyond], end[beyond]), np.where(same_way, end[beyond], start[beyond])
    edge_beyond = atlas[m] - atlas[k]
    step_beyond, _ = _perpendicular(edge_beyond, atlas[third[beyond]] - atlas[k], (roots[k] + roots[m]) / 2)
    A = np.stack([edge_beyond, step_beyond], axis=-1) @ np.linalg.inv(frame)
    t = atlas[k] - np.einsum("nij,nj->ni", A, atlas[i])
    return Seams(
        np.stack([atlas[i], atlas[j]], axis=1),
        -side,
        np.concatenate([A, t[..., None]], axis=-1),
        render_mesh.charts[border // 3],
    )


def apply_maps(maps: Array, uv: Array) -> Array:
    """Apply affine maps (N, 2, 3) to one texture coordinate each: (N, 2)."""
    return np.einsum("nij,nj->ni", maps[..., :2], uv) + maps[..., 2]


def _others(start: Array, end: Array, usable: Array) -> Array:
    """Return, for each half-edge, the first other one between the same two vertices, or -1."""
    low, high = np.minimum(start, end), np.maximum(start, end)
    edges = np.where(usable, low.astype(np.int64) * (int(high.max()) + 1) + high, -1)
    order = np.argsort(edges, kind="stable")
    ordered = edges[order]
    first = np.searchsorted(ordered, ordered)  # the first of the equal edges
    second = np.minimum(first + 1, len(order) - 1)
    pick = np.where(first == np.arange(len(order)), second, first)
    paired = (ordered[pick] == ordered) & (pick != np.arange(len(order))) & (ordered >= 0)
    others = np.full(len(order), -1)
    others[order[paired]] = order[pick[paired]]
    return others


def _perpendicular(edge: Array, inward: Array, root: Array) -> tuple[Array, Array]:
    """Return the uv step (N, 2) of 1 mm on the surface perpendicular to `edge`, towards `inward`, and its side (N,).

    The side is the sign of the cross product of `edge` and `inward`, in uv.
    """
    x = np.linalg.solve(root, edge[..., None])[..., 0]  # the edge in mm, in an orthonormal frame
    side = np.sign(edge[:, 0] * inward[:, 1] - edge[:, 1] * inward[:, 0])
    normal = side[:, None] * np.stack([-x[:, 1], x[:, 0]], axis=-1) / np.linalg.norm(x, axis=1, keepdims=True)
    return np.einsum("nij,nj->ni", root, normal), side
