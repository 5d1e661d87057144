"""Geometry for all rooms: directions on the sphere, rotation about an axis, connected pieces, closed meshes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""rad: steps of it never close a circle, and fill it evenly at any number of steps"""


def fibonacci_sphere(count: int, lowest: float = -1.0) -> Array:
    """Return unit vectors, float64 (count, 3), on a spiral about +y with equal areas between its turns.

    They fill the sphere evenly from y = 1 down to y = `lowest`: -1 for all of it, 0 for the upper half.
    """
    i = np.arange(count) + 0.5
    y, azimuth = 1.0 - (1.0 - lowest) * i / count, GOLDEN_ANGLE * i
    ring = np.sqrt(1.0 - y * y)
    return np.stack([ring * np.sin(azimuth), y, ring * np.cos(azimuth)], axis=1)


def golden_azimuths(numbers: Array) -> Array:
    """Return azimuths (...), 0 to 2 pi, that are evenly spread for any range of whole `numbers` (...).

    They are multiples of 2 pi less the golden angle, reduced to one turn before pi comes in, so that large numbers lose
    no accuracy.
    """
    azimuths: Array = 2.0 * np.pi * np.modf(numbers * 0.6180339887498949)[0]
    return azimuths


def cosine_directions(normals: Array, azimuths: Array) -> Array:
    """Return directions (N, n, 3) above surfaces, with a density in proportion to the cosine to the normal.

    Each direction stands for the same share of the light that a surface receives from an even sky. `normals` (N, 3) are
    of length 1. `azimuths` (N, n), rad, are those about the normals, from the first direction, near the normal, to the
    last one, near the horizon.
    """
    count = azimuths.shape[1]
    sine = np.sqrt((np.arange(count) + 0.5) / count)
    side = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(side, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    across = (sine * np.cos(azimuths))[..., None] * u[:, None] + (sine * np.sin(azimuths))[..., None] * v[:, None]
    directions: Array = across + np.sqrt(1.0 - sine**2)[:, None] * normals[:, None]
    return directions


def rotate_about(vector: Array, axis: Array, degrees: float) -> Array:
    """Rotate a vector (3,) about a unit `axis` (3,), counter-clockwise seen from the tip of the axis (Rodrigues)."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return vector * cos + np.cross(axis, vector) * sin + axis * (axis @ vector) * (1.0 - cos)


def components(count: int, start: Array, end: Array) -> Array:
    """Return the connected component of each of `count` nodes, which edges join: int32 (count,), from 0 on.

    `start` and `end` (E,) are the nodes at the ends of the edges. Components are numbered by their first node.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(count, count))
    labels: Array = connected_components(graph, directed=False)[1]
    return labels


def face_components(faces: Array) -> Array:
    """Return the connected piece of each face: int32 (F,), from 0 on.

    Faces (F, 3) that share a vertex are in the same piece.
    """
    start, end = np.concatenate([faces[:, :2], faces[:, 1:]]).T
    of_vertex = components(int(faces.max()) + 1, start, end)
    return np.unique(of_vertex[faces[:, 0]], return_inverse=True)[1].astype(np.int32)


def signed_volume(mesh: Mesh) -> float:
    """Return the volume inside a closed mesh, mm^3: negative if its faces are wound inwards.

    Of an open mesh it is the volume between the surface and the middle of its bounding box.
    """
    corner = mesh.positions[mesh.faces[:, 0]].astype(np.float64) - mesh.bounds.mean(axis=0)
    return float(np.einsum("ij,ij->", corner, mesh.face_normals) / 6.0)


def is_closed(mesh: Mesh) -> bool:
    """Return whether a mesh encloses a volume: its back faces cannot be seen from outside.

    Each edge must belong to exactly two faces, which have it in opposite directions, and faces must be wound outwards.
    """
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    forward = ends @ [len(mesh.positions), 1]
    backward = ends @ [1, len(mesh.positions)]
    paired = len(np.unique(forward)) == len(forward) and np.array_equal(np.sort(forward), np.sort(backward))
    return paired and signed_volume(mesh) > 0.0
