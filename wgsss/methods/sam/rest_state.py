"""The rest pose of a sender map: the data on the GPU by which the map follows the deformation of its mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.fans import fan_areas
from wgsss.gpu import Buffer
from wgsss.methods.sam.upload import GpuSenderMap
from wgsss.optics.lookup import log_table
from wgsss.scene import Mesh
from wgsss.stage import Body

Array = npt.NDArray[Any]

_TABLE = 1024
_NEAREST, _FARTHEST = 1e-4, 4.0  # of the table, in diagonals of the mesh: 0.1 % apart or less where R_d counts


@dataclass(frozen=True, eq=False)
class RestState:
    """The data on the GPU by which the map of one body follows its deformation."""

    clusters: Buffer
    """array<Cluster> (wgsl/sam/cluster.wgsl), at rest: as `clusters_at_rest`"""
    starts: Buffer
    """u32: the index in `corners` of the first corner of each point's fan, and the end"""
    corners: Buffer
    """u32: points, three for each triangle of a fan"""
    table: Buffer
    """vec4f: log2 of R_d, 1/mm^2"""
    low: float
    """log2 of the first squared distance of the table, mm^2"""
    steps: float
    """steps of the table for each doubling of the squared distance"""


def rest_state(body: Body, gpu_map: GpuSenderMap) -> RestState:
    """Return the rest state of a body's map. It is uploaded once."""

    def make() -> RestState:
        gpu, mesh = body.stage.gpu, body.rest.mesh
        layout = wgsl.load("sam/fans").layout("array<Cluster>")
        starts, corners = _fan_corners(mesh, gpu_map.sender_map)
        diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        low, steps, table = log_table(body.profile, _NEAREST * diagonal, _FARTHEST * diagonal, _TABLE)
        return RestState(
            gpu.buffer(layout.pack(clusters_at_rest(mesh, gpu_map.sender_map))),
            gpu.buffer(starts.astype(np.uint32)),
            gpu.buffer(corners.astype(np.uint32)),
            gpu.buffer(table.astype(np.float32)),
            low,
            steps,
        )

    return body.stage.shared(("rest state", id(gpu_map)), make)


def clusters_at_rest(mesh: Mesh, sender_map: SenderMap) -> dict[str, Array]:
    """Return the clusters of a map at rest.

    They are those of its senders, then those of its tree nodes. If the senders are no vertices, those of the vertices
    follow.

    Returns:
        The fields of struct Cluster (wgsl/sam/cluster.wgsl) of N clusters: position (N, 3), mm; area (N,), mm^2; normal
        (N, 3); and variance (N,), mm^2. For a sender that is no vertex, the area is a third of that of its face.
    """
    positions, normals = mesh.positions.astype(np.float64), mesh.normals
    samples = sender_map.sender_samples
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
    points = {"position": positions, "area": area, "normal": normals, "variance": np.zeros(len(area))}
    tree, end = sender_map.tree, sender_map.sender_count
    if tree is None:
        return points
    weight = np.maximum(area[:end], 1e-20)
    sums = tree.sums(weight)
    centre = tree.sums(positions[:end] * weight[:, None]) / sums[:, None]
    square = tree.sums(np.square(positions[:end]).sum(axis=1) * weight) / sums
    variance = np.maximum(square - np.square(centre).sum(axis=1), 0.0)
    normal = tree.sums(normals[:end] * weight[:, None]) / sums[:, None]
    nodes = {"position": centre, "area": sums, "normal": normal, "variance": variance}
    return {name: np.concatenate([points[name][:end], nodes[name], points[name][end:]]) for name in points}


def _fan_corners(mesh: Mesh, sender_map: SenderMap) -> tuple[Array, Array]:
    """Return the triangles around each of n points of a map.

    The fan of a vertex is all its faces. A sender that is no vertex has the face that it is on; the vertices, which
    then follow as points, have no triangles.

    Returns:
        The indices (n + 1,) of each fan's first corner, and the end; and the corners (k,), which are points.
    """
    if sender_map.sender_samples is None:
        order = np.argsort(mesh.faces.ravel(), kind="stable")
        count = np.bincount(mesh.faces.ravel(), minlength=len(mesh.positions))
        faces = mesh.faces[order // 3]
    else:
        count = np.repeat([1, 0], [sender_map.sender_count, len(mesh.positions)])
        faces = mesh.faces[sender_map.sender_samples.face] + sender_map.sender_count
    return 3 * np.append(0, np.cumsum(count)), faces.ravel()
