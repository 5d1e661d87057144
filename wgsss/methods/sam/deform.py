"""Spatial adjacency maps of meshes that deform (Maisch & Ropinski 2017, 3.4): the form factors of senders follow areas
and distances, and senders give way to better neighbours. For maps of nodes see `sam_sum`.

What drifts is which parts of the far side count more, since senders only climb to better neighbours. It does not add up
over time: as the rest pose comes back, so do the senders and weights that were baked for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.fans import fan_areas, one_ring
from wgsss.graph import Graph
from wgsss.methods.sam.upload import Plan, over_nodes
from wgsss.optics.lookup import log_table
from wgsss.scene import Mesh
from wgsss.stage import Body

Array = npt.NDArray[Any]

_TABLE = 1024
_NEIGHBOURS = 6  # of a sample
_NEAREST, _FARTHEST = 1e-4, 4.0  # of the table, in diagonals of the mesh: 0.1 % apart or less where R_d counts


@dataclass(frozen=True, eq=False)
class Deforming:
    """What follows a mesh that deforms, on the device."""

    rest: Any
    """buffer of array<Place> (wgsl/sam/place.wgsl): senders, nodes and receivers at rest"""
    starts: Any
    """buffer of u32: where the triangles of each of the map's points begin in `corners`"""
    corners: Any
    """buffer of u32: points, three to a triangle"""
    table: Any
    """buffer of vec4f: log2 of R_d"""
    low: float
    """log2 of the first squared distance of the table, mm^2"""
    steps: float
    """of the table, each time that squared distances double"""


def deforming(body: Body, plan: Plan) -> Deforming:
    """What a body's map needs to follow its motion, uploaded once."""

    def make() -> Deforming:
        gpu, mesh = body.stage.gpu, body.rest.mesh
        layout = wgsl.load("sam/fans").layout("array<Place>")
        starts, corners = _triangles(mesh, plan.entries)
        diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        low, steps, table = log_table(body.material.profile, _NEAREST * diagonal, _FARTHEST * diagonal, _TABLE)
        return Deforming(
            gpu.buffer(layout.pack(places_at_rest(mesh, plan.entries))),
            gpu.buffer(starts.astype(np.uint32)),
            gpu.buffer(corners.astype(np.uint32)),
            gpu.buffer(table.astype(np.float32)),
            low,
            steps,
        )

    found: Deforming = body.stage.shared(("deforming", id(plan)), make)
    return found


def _neighbours(mesh: Mesh, entries: SenderMap) -> Array:
    """uint32: where each sender's neighbours begin, and the end, then those: of a sample the nearest on its side."""
    if entries.sender_samples is None:
        next_to = one_ring(mesh)
        start, found = next_to.start, next_to.vertex
    else:
        from scipy.spatial import KDTree

        rest = places_at_rest(mesh, entries)
        x, n = (rest[name][: entries.sender_count] for name in ("position", "normal"))
        k = min(_NEIGHBOURS + 1, len(x))
        near = KDTree(x).query(x, k=[*range(1, k + 1)])[1]
        beside = (near != np.arange(len(x))[:, None]) & (np.einsum("sd,skd->sk", n, n[near]) > 0.0)
        start, found = np.append(0, np.cumsum(beside.sum(axis=1))), near[beside]
    return np.concatenate([start + len(start), found]).astype(np.uint32)


def places_at_rest(mesh: Mesh, entries: SenderMap) -> dict[str, Array]:
    """The fields of struct Place for a map's senders, its nodes, and its receivers where those are no senders."""
    positions, normals = mesh.positions.astype(np.float64), mesh.normals
    samples = entries.sender_samples
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
    tree, end = entries.tree, entries.sender_count
    if tree is None:
        return found
    weight = np.maximum(area[:end], 1e-20)
    sums = tree.sums(weight)
    middle = tree.sums(positions[:end] * weight[:, None]) / sums[:, None]
    square = tree.sums(np.square(positions[:end]).sum(axis=1) * weight) / sums
    variance = np.maximum(square - np.square(middle).sum(axis=1), 0.0)
    normal = tree.sums(normals[:end] * weight[:, None]) / sums[:, None]
    nodes = {"position": middle, "area": sums, "normal": normal, "variance": variance}
    return {name: np.concatenate([found[name][:end], nodes[name], found[name][end:]]) for name in found}


def _triangles(mesh: Mesh, entries: SenderMap) -> tuple[Array, Array]:
    """The triangles around a map's points: where they begin (n + 1,) among corners (k,), which are points."""
    if entries.sender_samples is None:
        order = np.argsort(mesh.faces.ravel(), kind="stable")
        count = np.bincount(mesh.faces.ravel(), minlength=len(mesh.positions))
        faces = mesh.faces[order // 3]
    else:
        count = np.repeat([1, 0], [entries.sender_count, len(mesh.positions)])
        faces = mesh.faces[entries.sender_samples.face] + entries.sender_count
    return 3 * np.append(0, np.cumsum(count)), faces.ravel()


def posed(graph: Graph, body: Body, plan: Plan, points: Any) -> SimpleNamespace:
    """Where a map's points are and, behind them, its nodes, and the areas of the points' fans: `places` and `area`.

    `points`: a buffer of array<Vertex>, the plan's points as posed.
    """
    held = deforming(body, plan)
    size = len(plan.points.face) + plan.nodes
    found = graph.dispatch_outputs("sam/fans", size=size, points=points, starts=held.starts, corners=held.corners)
    return SimpleNamespace(places=over_nodes(graph, plan, "sam/places", "places", places=found.places), area=found.area)


def follow(graph: Graph, body: Body, plan: Plan, points: Any, *, anew: bool) -> list[Any]:
    """The entries of a body as posed, by block, where their senders are no nodes.

    Args:
        points: a buffer of array<Vertex>: the plan's points as posed.
        anew: from the senders at rest, and not from those of the last frame.
    """
    entries, held = plan.entries, deforming(body, plan)
    adjacency = body.stage.shared(
        ("adjacency", id(plan)), lambda: body.stage.gpu.buffer(_neighbours(body.rest.mesh, entries))
    )
    params = {
        "low": held.low,
        "steps": held.steps,
        "samples": entries.sender.shape[1],
        "receivers": 0 if entries.sender_samples is None else entries.sender_count,
        "anew": anew,
        "even": entries.sender_samples is not None,
    }
    places = posed(graph, body, plan, points).places
    return [
        graph.dispatch(
            "sam/update",
            size=(block.count, entries.sender.shape[1]),
            params=params,
            vertices=block.rows,
            at_rest=block.entries,
            moved=block.moved,
            places=places,
            rest=held.rest,
            adjacency=adjacency,
            table=held.table,
        )
        for block in plan.blocks
    ]
