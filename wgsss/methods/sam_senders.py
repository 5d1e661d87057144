"""What the vertices of a spatial adjacency map read: senders, nodes over them and, where a mesh deforms, form factors
that follow it (Maisch & Ropinski 2017, 3.4).

A map's points are its senders and, where those are not the vertices, the vertices behind them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam import Entries
from wgsss.bake.sam.entries import BYTES
from wgsss.bake.sam.fans import adjacency, fan_areas
from wgsss.bake.samples import Samples
from wgsss.gpu import LIMITS, Gpu
from wgsss.graph import Graph
from wgsss.optics import Profile
from wgsss.scene import Mesh
from wgsss.stage import Body

Array = npt.NDArray[Any]

_LEAST = 1e-36  # 1/mm^2: R_d may underflow, the logarithm of its table must not
_TABLE = 1024
_NEAREST, _FARTHEST = 1e-4, 4.0  # of the table, in diagonals of the mesh: 0.1 % apart or less where R_d counts


def vertices(mesh: Mesh) -> Samples:
    """The vertices of a mesh as samples of it; where normals split one, it counts as part of one of its sides."""
    used, first = np.unique(mesh.faces, return_index=True)
    corner = np.zeros(len(mesh.positions), np.int64)  # what no face has is sent to nobody, and may be anywhere
    corner[used] = first
    return Samples((corner // 3).astype(np.int32), np.eye(3)[corner % 3], np.zeros(len(corner)))


def sender_samples(mesh: Mesh, entries: Entries, *, moving: bool) -> Samples:
    """A map's senders as samples of its mesh; of a moving mesh, its points."""
    if entries.samples is None:
        return vertices(mesh)
    if not moving:
        return entries.samples
    both = (entries.samples, vertices(mesh))
    return Samples(*(np.concatenate([vars(s)[name] for s in both]) for name in ("face", "barycentric", "share")))


def blocks(entries: Entries) -> list[slice]:
    """The vertices of a map in parts whose entries fit in a binding."""
    V, samples = entries.sender.shape
    most = LIMITS["max-storage-buffer-binding-size"] // (BYTES * samples)
    return [slice(first, min(first + most, V)) for first in range(0, V, most)]


def upload(gpu: Gpu, entries: Entries) -> list[Any]:
    """Buffers of array<Entry> (wgsl/sam/entries.wgsl), one for each block."""
    layout = wgsl.load("sam/gather").layout("array<Entry>")
    return [
        gpu.buffer(layout.pack({"weight": entries.weight[b].reshape(-1, 3), "sender": entries.sender[b].ravel()}))
        for b in blocks(entries)
    ]


def over_nodes(graph: Graph, body: Body, entries: Entries, module: str, over: str, **bindings: Any) -> Any:
    """The buffer `over`, one of `bindings`, with its nodes, which follow the senders, filled bottom-up by `module`."""
    tree, gpu = entries.tree, body.stage.gpu
    if tree is None:
        return bindings[over]
    counts = np.diff(tree.levels)

    def upload() -> dict[str, Any]:
        starts = np.append(tree.first[: counts[0]], len(tree.order)).astype(np.uint32)
        return {"starts": gpu.buffer(starts), "order": gpu.buffer(tree.order.astype(np.uint32))}

    buffers = body.stage.shared(("tree", id(tree)), upload)
    at_once = wgsl.load(module).constants["LEVELS"]
    rows = np.zeros((1 + len(counts) + at_once, 4), np.uint32)  # none below the finest level, none above the root
    rows[1 : 1 + len(counts), 0] = entries.senders + tree.levels[:-1]
    rows[1 : 1 + len(counts), 1] = counts
    for level in range(0, len(counts), at_once):
        bindings[over] = graph.dispatch(
            module,
            size=int(counts[level]),
            label=f"level {level}",
            params={"levels": rows[level : level + at_once + 1], "finest": level == 0},
            **buffers,
            **bindings,
        )
    return bindings[over]


@dataclass(frozen=True, eq=False)
class Deforming:
    """What follows a mesh that deforms, on the device."""

    rest: Any
    """buffer of array<Place> (wgsl/sam/place.wgsl): senders, nodes and receivers at rest"""
    starts: Any
    """buffer of u32: where the triangles of each of the map's points begin in `corners`"""
    corners: Any
    """buffer of u32: points, three to a triangle"""
    adjacency: Any
    """buffer of u32: where each vertex's neighbours begin, behind which they are"""
    table: Any
    """buffer of vec4f: log2 of R_d"""
    low: float
    """log2 of the first squared distance of the table, mm^2"""
    steps: float
    """of the table, each time that squared distances double"""
    moved: list[Any]
    """buffers of i32, by block: the senders, from frame to frame"""


def deforming(body: Body, entries: Entries) -> Deforming:
    """Upload what a body's map needs to follow its motion."""
    gpu, mesh = body.stage.gpu, body.rest.mesh
    layout = wgsl.load("sam/fans").layout("array<Place>")
    starts, corners = _triangles(mesh, entries)
    next_to = adjacency(mesh)
    near = next_to.start.astype(np.int64) + len(next_to.start)
    low, steps, table = log_table(body.material.profile, float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))))
    return Deforming(
        gpu.buffer(layout.pack(places_at_rest(mesh, entries))),
        gpu.buffer(starts.astype(np.uint32)),
        gpu.buffer(corners.astype(np.uint32)),
        gpu.buffer(np.concatenate([near, next_to.vertex]).astype(np.uint32)),
        gpu.buffer(table.astype(np.float32)),
        low,
        steps,
        [gpu.buffer(entries.sender[block].astype(np.int32)) for block in blocks(entries)],
    )


def log_table(profile: Profile, diagonal: float) -> tuple[float, float, Array]:
    """log2 of R_d (n, 4; the last column is 0), evenly over log2 of squared distances: the first, the steps to one."""
    low, high = 2.0 * np.log2([_NEAREST * diagonal, _FARTHEST * diagonal])
    R = profile.reflectance(np.exp2(0.5 * np.linspace(low, high, _TABLE)))
    table = np.zeros((_TABLE, 4))
    table[:, :3] = np.log2(np.maximum(R, _LEAST))
    return float(low), (_TABLE - 1) / float(high - low), table


def places_at_rest(mesh: Mesh, entries: Entries) -> dict[str, Array]:
    """The fields of struct Place for a map's senders, its nodes, and its receivers where those are no senders."""
    positions, normals = mesh.positions.astype(np.float64), mesh.normals
    samples = entries.samples
    if samples is not None:
        corners = mesh.faces[samples.face]
        position = np.einsum("nk,nkd->nd", samples.barycentric, positions[corners])
        normal = np.einsum("nk,nkd->nd", samples.barycentric, normals[corners])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        size = np.linalg.norm(mesh.face_normals[samples.face], axis=1) / 6.0
        positions, normals = np.concatenate([position, positions]), np.concatenate([normal, normals])
        area = np.concatenate([size, np.zeros(len(mesh.positions))])
    else:
        area = fan_areas(mesh)
    found = {"position": positions, "area": area, "normal": normals, "variance": np.zeros(len(area))}
    tree, end = entries.tree, entries.senders
    if tree is None:
        return found
    weight = np.maximum(area[:end], 1e-20)
    sums = tree.sums(weight)
    middle = tree.sums(positions[:end] * weight[:, None]) / sums[:, None]
    square = tree.sums(np.square(positions[:end]).sum(axis=1) * weight) / sums
    variance = np.maximum(square - np.square(middle).sum(axis=1), 0.0)
    nodes = {"position": middle, "area": sums, "normal": np.zeros_like(middle), "variance": variance}
    return {name: np.concatenate([found[name][:end], nodes[name], found[name][end:]]) for name in found}


def _triangles(mesh: Mesh, entries: Entries) -> tuple[Array, Array]:
    """The triangles around a map's points: where they begin (n + 1,) among corners (k,), which are points."""
    if entries.samples is None:
        order = np.argsort(mesh.faces.ravel(), kind="stable")
        count = np.bincount(mesh.faces.ravel(), minlength=len(mesh.positions))
        faces = mesh.faces[order // 3]
    else:
        count = np.repeat([1, 0], [entries.senders, len(mesh.positions)])
        faces = mesh.faces[entries.samples.face] + entries.senders
    return 3 * np.append(0, np.cumsum(count)), faces.ravel()


def follow(graph: Graph, body: Body, entries: Entries, points: Any, at_rest: list[Any], *, anew: bool) -> Any:
    """Of a body as posed: its map's entries, by block, and fan areas, by sender.

    Args:
        points: a buffer of array<Vertex>, the map's points as posed.
        at_rest: buffers of the map's entries at rest, by block.
        anew: from the senders at rest, and not from those of the last frame.
    """
    stage = body.stage
    kept: Deforming = stage.shared(("deforming", body.index, id(entries)), lambda: deforming(body, entries))
    count = points.size // wgsl.load("sam/fans").layout("array<Vertex>").size
    nodes = 0 if entries.tree is None else len(entries.tree.first)
    posed = graph.dispatch("sam/fans", size=count + nodes, points=points, starts=kept.starts, corners=kept.corners)
    places = over_nodes(graph, body, entries, "sam/places", "places", places=posed.places)
    samples = entries.sender.shape[1]
    found = []
    for block, some, moved in zip(blocks(entries), at_rest, kept.moved, strict=True):
        params = {
            "low": kept.low,
            "steps": kept.steps,
            "samples": samples,
            "receivers": block.start + (0 if entries.samples is None else entries.senders),
            "anew": anew,
            "split": entries.tree is None,
            "moves": entries.tree is None and entries.samples is None,
        }
        bindings = {"places": places, "rest": kept.rest, "adjacency": kept.adjacency, "table": kept.table}
        size = (block.stop - block.start, samples)
        found.append(graph.dispatch("sam/update", size=size, params=params, at_rest=some, moved=moved, **bindings))
    return found, posed.area
