"""The charts of an atlas on maps of one size: the data of each texel that passes in texture space read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.seams import apply_maps, find_seams
from wgsss.bake.stretch import stretch
from wgsss.bake.unwrap import RenderMesh
from wgsss.cache import Arrays, cached
from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

INSIDE = 1 << 31
"""A bit of `Charts.ids`, as in `wgsl/charts.wgsl`."""
_FLOAT16_MAX = 6e4


@dataclass(frozen=True, eq=False)
class Charts:
    """Maps of the charts as GPU textures, and the seams between charts as a buffer."""

    size: int
    """Width and height of the maps, texels."""
    gradient_u: Any
    """rgba16float. xyz: the gradient of the atlas coordinate u over the surface, in TEXELS per mm, in object space. A
    step d mm on the surface is dot(gradient, d) texels to the right, with a relative error of 5e-4 from the half
    floats. w: the clearance in texels: all texels that are nearer belong to the same chart. It is a lower bound. 0
    outside charts."""
    gradient_v: Any
    """rgba16float. xyz: the gradient of the atlas coordinate v, which grows downwards."""
    ids: Any
    """r32uint. 0: unused. INSIDE | chart: the chart covers the centre of the texel. seam + 1: the texel is in the
    gutter, within 3 texels of a chart. The seam maps its centre to a point where at least one of the four texels around
    is INSIDE."""
    seams: Any
    """array<Seam> (wgsl/charts.wgsl)."""


def charts(gpu: Gpu, mesh: Mesh, render_mesh: RenderMesh, size: int) -> Charts:
    """Return the charts of `render_mesh`, the render mesh of `mesh`, on maps of `size` x `size` texels. Cached."""

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
    maps, owners = _extend_seams(texels, seams.maps, seams.charts)
    return {
        "seams": maps.astype(np.float32),
        "owners": owners.astype(np.uint32),
        "ids": texels,
        "gradient_u": gradient_u,
        "gradient_v": graph.read(drawn.gradient_v),
    }


def _clearance(ids: Array) -> Array:
    """Return a lower bound of the distance from each texel to the nearest outside its chart: float (H, W), texels."""
    from scipy.ndimage import distance_transform_edt

    padded = np.pad(np.where(ids >= INSIDE, ids, 0), 1)
    free = padded != 0
    for rows, columns in ((0, 1), (1, 0), (1, 1), (1, -1)):  # texels that touch another chart count as outside
        near = np.roll(padded, (rows, columns), (0, 1))
        touches = (padded != near) & (padded != 0) & (near != 0)
        free &= ~touches & ~np.roll(touches, (-rows, -columns), (0, 1))
    return np.asarray(distance_transform_edt(free))[1:-1, 1:-1]


def _extend_seams(ids: Array, maps: Array, owners: Array) -> tuple[Array, Array]:
    """Add seams so that each gutter texel is mapped into a chart. Changes `ids` in place.

    Where more than two charts meet, and at charts thinner than a texel, a seam may map a texel to a point outside all
    charts. If that point is in another gutter, the seam there is applied, too. Else the texel is mapped to the nearest
    texel inside a chart, as in a plain dilation (Mikkelsen 2009, section 3.4).

    Returns the maps (M, 2, 3) of all seams, and the chart (M,) that each leaves. `maps` (N, 2, 3) and `owners` (N,) are
    those of the given seams.
    """
    size = len(ids)
    row, column = np.nonzero(_is_gutter(ids))
    center = np.stack([column + 0.5, row + 0.5], axis=-1) / size
    seam = ids[row, column].astype(np.int64) - 1
    outside = np.flatnonzero(~_reaches_inside(ids, apply_maps(maps[seam], center)))
    row, column, center, first = row[outside], column[outside], center[outside], maps[seam[outside]]

    x, y = np.clip(np.floor(apply_maps(first, center) * size).astype(np.int64), 0, size - 1).T
    second = np.where(_is_gutter(ids[y, x]), ids[y, x].astype(np.int64) - 1, 0)
    extra = maps[second].copy()
    extra[:, :, :2] = maps[second][:, :, :2] @ first[:, :, :2]
    extra[:, :, 2] += np.einsum("nij,nj->ni", maps[second][:, :, :2], first[:, :, 2])
    off = ~_is_gutter(ids[y, x]) | ~_reaches_inside(ids, apply_maps(extra, center))
    if off.any() and (ids >= INSIDE).any():
        from scipy.ndimage import distance_transform_edt

        nearest = distance_transform_edt(ids < INSIDE, return_distances=False, return_indices=True)
        extra[off] = 0
        extra[off, :, 2] = (nearest[::-1, row[off], column[off]].T + 0.5) / size
    ids[row, column] = len(maps) + 1 + np.arange(len(outside), dtype=np.uint32)
    return np.concatenate([maps, extra]), np.concatenate([owners, owners[seam[outside]]])


def _is_gutter(ids: Array) -> Array:
    """Return whether texels are in the gutter of a chart."""
    return (ids > 0) & (ids < INSIDE)


def _reaches_inside(ids: Array, place: Array) -> Array:
    """Return whether a bilinear filter at each place (N, 2), uv, reads a texel inside a chart: bool (N,)."""
    size = len(ids)
    corner = np.floor(place * size - 0.5).astype(np.int64)
    reaches = np.zeros(len(place), bool)
    for step in np.ndindex(2, 2):
        column, row = np.clip(corner + step, 0, size - 1).T
        reaches |= ids[row, column] >= INSIDE
    return reaches
