"""A geodesic sphere of any frequency."""

from __future__ import annotations

import math

import numpy as np

from wgsss.errors import InputError
from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._rows import vertex_count


def sphere(radius: float = 20.0, vertices: int | None = None) -> Mesh:
    """Build a sphere of `radius` mm about the origin: an icosahedron with edges divided by f, 10 f^2 + 2 vertices.

    Vertices: 90 to 1000000, by default 4000. Raises InputError for another count or a radius out of range.
    """
    if not 0 < radius <= 1e9:
        raise InputError(f"sphere: radius must be above 0 mm, at most 1e9, got {radius}")
    target = vertex_count("sphere", vertices, 4000, 90, 1_000_000)
    frequency = round(math.sqrt((target - 2) / 10))
    corners, triangles = _icosahedron()

    i, j = (k.ravel() for k in np.meshgrid(np.arange(frequency + 1), np.arange(frequency + 1), indexing="ij"))
    inside = i + j <= frequency
    weights = np.stack([frequency - i - j, i, j], axis=1)[inside]
    index = np.full((frequency + 1, frequency + 1), -1)
    index[i[inside], j[inside]] = np.arange(len(weights))
    i, j = i[i + j < frequency], j[i + j < frequency]
    upright = np.stack([index[i, j], index[i + 1, j], index[i, j + 1]], axis=1)
    inner = i + j < frequency - 1
    i, j = i[inner], j[inner]
    flipped = np.stack([index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]], axis=1)
    patch = np.concatenate([upright, flipped])

    # A lattice point of two patches has the same integer weights for the same corners in both, so it is merged exactly.
    barycentric = np.zeros((20, len(weights), 12), dtype=np.int16)
    np.put_along_axis(barycentric, np.broadcast_to(triangles[:, None, :], (20, len(weights), 3)), weights[None], axis=2)
    key = np.sort(np.where(barycentric > 0, np.arange(12) * (frequency + 1) + barycentric, 0), axis=2)[..., -3:]
    _, first, welded = np.unique(key.reshape(-1, 3), axis=0, return_index=True, return_inverse=True)
    points = (barycentric.reshape(-1, 12)[first] / frequency) @ corners
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    faces = welded.reshape(20, -1)[:, patch].reshape(-1, 3)
    return Mesh(positions=points.astype(np.float32), faces=faces.astype(np.int32), name="sphere")


def _icosahedron() -> tuple[np.ndarray, np.ndarray]:
    """Return the unit corners (12,3) and faces (20,3) of an icosahedron, counter-clockwise from outside."""
    golden = (1 + math.sqrt(5)) / 2
    signs = [(s, t) for s in (-1, 1) for t in (-1, 1)]
    corners = np.array([np.roll((0, s, t * golden), k) for k in range(3) for s, t in signs]) / math.hypot(1, golden)
    near = np.linalg.norm(corners[:, None] - corners[None], axis=2) < 1.1  # an edge is 1.05 long
    np.fill_diagonal(near, False)
    triples = ((a, b, c) for a in range(12) for b in range(a) for c in range(b))
    faces = [(a, b, c) for a, b, c in triples if near[a, b] and near[b, c] and near[c, a]]
    turn = [np.linalg.det(corners[list(f)]) > 0 for f in faces]
    return corners, np.array([f if t else f[::-1] for f, t in zip(faces, turn, strict=True)])
