"""The charts of an atlas at one map size: what passes in texture space need to know of each texel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.seams import apply, find_seams
from wgsss.bake.stretch import stretch
from wgsss.bake.unwrap import RenderMesh
from wgsss.cache import Arrays, cached
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

INSIDE = 1 << 31
"""As in `wgsl/charts.wgsl`."""
_FLOAT16_MAX = 6e4


@dataclass(frozen=True, eq=False)
class Charts:
    """Maps of `size` x `size` texels, and the seams between the charts, as GPU textures and a buffer."""

    size: int
    gradient_u: Any
    """rgba16float: xyz the gradient of the atlas coordinate u over the surface, in TEXELS per mm, object space, so that
    a step d on the surface is dot(gradient, d) texels to the right (half floats keep it to 5e-4); w the clearance in
    texels: all texels nearer than it are of the same chart. It is a lower bound. All 0 outside charts"""
    gradient_v: Any
    """rgba16float: xyz the gradient of v, down"""
    ids: Any
    """r32uint: 0 unused; INSIDE | chart where a chart covers the texel's centre; seam + 1 in the gutter, the 3 texels
    around a chart. The seam takes the texel's centre to a place where at least one of four texels around is INSIDE"""
    seams: Any
    """array<Seam> (wgsl/charts.wgsl)"""


def charts(gpu: Gpu, mesh: Mesh, render_mesh: RenderMesh, size: int) -> Charts:
    """The charts of `render_mesh`, the render mesh of `mesh`, on maps of `size` x `size` texels; cached."""

    def make() -> Arrays:
        return _make(gpu, mesh, render_mesh, size)

    label = f"mapping {len(mesh.faces)} faces to {size} x {size} texels"
    arrays = cached("charts", [mesh, render_mesh, size, gpu.name], make, label=label)
    layout = wgsl.load("charts").layout("array<Seam>")
    rows, owners = arrays["seams"], arrays["owners"]
    return Charts(
        size=size,
        gradient_u=gpu.texture(arrays["gradient_u"], "rgba16float"),
        gradient_v=gpu.texture(arrays["gradient_v"], "rgba16float"),
        ids=gpu.texture(arrays["ids"], "r32uint"),
        seams=gpu.buffer(layout.pack({"to_u": rows[:, 0], "to_v": rows[:, 1], "chart": owners})),
    )


def _make(gpu: Gpu, mesh: Mesh, render_mesh: RenderMesh, size: int) -> Arrays:
    stretched = stretch(mesh, render_mesh)
    seams = find_seams(render_mesh, stretched.root)
    vertices = {
        "atlas": render_mesh.atlas,
        "root": np.minimum(stretched.root[:, [0, 0, 1], [0, 1, 1]], _FLOAT16_MAX / size),
        "along_u": stretched.axes[:, 0],
        "along_v": stretched.axes[:, 1],
    }
    params = {"size": size}
    graph = Graph(gpu)
    drawn = graph.draw_outputs(
        "bake/charts",
        size=(size, size),
        depth_buffer="new",
        count=render_mesh.faces.size,
        params=params,
        vertices=vertices,
        faces=gpu.buffer(render_mesh.faces),
        face_charts=gpu.buffer(render_mesh.charts),
    )
    ids = drawn.ids
    if len(seams.maps):
        edges = {"a": seams.ends[:, 0], "b": seams.ends[:, 1], "outward": seams.outward}
        count = 6 * len(seams.maps)
        ids = graph.draw_outputs(
            "bake/gutter", into=ids, depth_buffer=drawn.depth, count=count, params=params, edges=edges
        ).ids
    graph.run(ids, drawn.gradient_u, drawn.gradient_v)
    texels = graph.read(ids)[..., 0].copy()
    gradient_u = graph.read(drawn.gradient_u).copy()
    gradient_u[..., 3] = _clearance(texels)
    maps, owners = _leading_inside(texels, seams.maps, seams.charts)
    return {
        "seams": maps.astype(np.float32),
        "owners": owners.astype(np.uint32),
        "ids": texels,
        "gradient_u": gradient_u,
        "gradient_v": graph.read(drawn.gradient_v),
    }


def _clearance(ids: Array) -> Array:
    """float (H, W): a lower bound of the distance in texels to the nearest texel of no or another chart."""
    from scipy.ndimage import distance_transform_edt

    padded = np.pad(np.where(ids >= INSIDE, ids, 0), 1)
    free = padded != 0
    for rows, columns in ((0, 1), (1, 0), (1, 1), (1, -1)):  # what touches another chart counts as outside
        near = np.roll(padded, (rows, columns), (0, 1))
        touches = (padded != near) & (padded != 0) & (near != 0)
        free &= ~touches & ~np.roll(touches, (-rows, -columns), (0, 1))
    return np.asarray(distance_transform_edt(free))[1:-1, 1:-1]


def _leading_inside(ids: Array, maps: Array, owners: Array) -> tuple[Array, Array]:
    """The seams (N, 2, 3) and the charts (N,) that they lead out of, with more of them so that each gutter texel leads
    into a chart; changes `ids` in place.

    Where more than two charts meet, and at charts thinner than a texel, the place across the seam may be off the
    charts itself. If it is in another gutter, that one's seam is followed too; else the nearest texel inside a chart
    stands in, as in plain dilation (Mikkelsen 2009, section 3.4).
    """
    size = len(ids)
    row, column = np.nonzero(_is_gutter(ids))
    center = np.stack([column + 0.5, row + 0.5], axis=-1) / size
    seam = ids[row, column].astype(np.int64) - 1
    lost = np.flatnonzero(~_reaches_inside(ids, apply(maps[seam], center)))
    row, column, center, first = row[lost], column[lost], center[lost], maps[seam[lost]]

    x, y = np.clip(np.floor(apply(first, center) * size).astype(np.int64), 0, size - 1).T
    then = np.where(_is_gutter(ids[y, x]), ids[y, x].astype(np.int64) - 1, 0)
    extra = maps[then].copy()
    extra[:, :, :2] = maps[then][:, :, :2] @ first[:, :, :2]
    extra[:, :, 2] += np.einsum("nij,nj->ni", maps[then][:, :, :2], first[:, :, 2])
    off = ~_is_gutter(ids[y, x]) | ~_reaches_inside(ids, apply(extra, center))
    if off.any() and (ids >= INSIDE).any():
        from scipy.ndimage import distance_transform_edt

        nearest = distance_transform_edt(ids < INSIDE, return_distances=False, return_indices=True)
        extra[off] = 0
        extra[off, :, 2] = (nearest[::-1, row[off], column[off]].T + 0.5) / size
    ids[row, column] = len(maps) + 1 + np.arange(len(lost), dtype=np.uint32)
    return np.concatenate([maps, extra]), np.concatenate([owners, owners[seam[lost]]])


def _is_gutter(ids: Array) -> Array:
    return (ids > 0) & (ids < INSIDE)


def _reaches_inside(ids: Array, place: Array) -> Array:
    """Whether any of the four texels that a filter reads at each place (N, 2), uv, is inside a chart."""
    size = len(ids)
    corner = np.floor(place * size - 0.5).astype(np.int64)
    found = np.zeros(len(place), bool)
    for step in np.ndindex(2, 2):
        column, row = np.clip(corner + step, 0, size - 1).T
        found |= ids[row, column] >= INSIDE
    return found
