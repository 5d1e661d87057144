"""A gyroid shell inside a ball."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from wgsss.scene.geometry import face_components
from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes._implicit import spacing_for
from wgsss.scene.shapes._relax import relax, vertex_normals
from wgsss.scene.shapes._rows import vertex_count

_RADIUS = 25.0  # mm
_PERIOD = 25.0  # mm
_WALL = 1.8  # mm
_AREA = 16_300.0  # mm^2, both sides


def gyroid(vertices: int | None = None) -> Mesh:
    """Build a gyroid sheet of period 25 mm, 1.8 mm thick, in a ball of 50 mm, with a rounded rim; closed, one piece.

    Vertices: 2000 to 500000, by default 12000. Raises InputError for another count.
    """
    target = vertex_count("gyroid", vertices, 12_000, 2000, 500_000)
    spacing = spacing_for(target, _AREA)
    positions, faces = _sheet(spacing)
    positions, faces = _cut(positions, faces, spacing)
    faces = _largest_piece(faces)
    used, faces = np.unique(faces, return_inverse=True)
    positions, faces = positions[used], faces.reshape(-1, 3)
    return _thicken(positions, faces, spacing)


def _field(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the gyroid function (N,) and its gradient (N,3), 1/mm, at points (N,3)."""
    k = 2 * math.pi / _PERIOD
    s, c = np.sin(k * p), np.cos(k * p)
    value = s[:, 0] * c[:, 1] + s[:, 1] * c[:, 2] + s[:, 2] * c[:, 0]
    return value, k * (c * np.roll(c, -1, axis=1) - s * np.roll(s, 1, axis=1))


def _onto(positions: np.ndarray) -> np.ndarray:
    """Move positions (N,3) towards the gyroid by one Newton step."""
    value, gradient = _field(positions)
    return positions - gradient * (value / np.maximum((gradient**2).sum(axis=1), 1e-3))[:, None]


def _sheet(spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate the gyroid evenly in a box that is slightly larger than the ball."""
    from skimage.measure import marching_cubes

    cells = math.ceil((_RADIUS + 2 * spacing) / spacing)
    axis = np.arange(-cells, cells + 1) * spacing
    s, c = (f(2 * math.pi / _PERIOD * axis) for f in (np.sin, np.cos))
    value = s[:, None, None] * c[:, None] + s[:, None] * c + s * c[:, None, None]
    value = np.where(np.abs(value) < 0.02, np.where(value < 0, -0.02, 0.02), value)  # avoids triangles without area
    positions, faces, _, _ = marching_cubes(value.astype(np.float32), 0.0, allow_degenerate=False)
    positions = (positions - cells) * spacing
    for _ in range(4):
        positions = _onto(relax(positions, faces, steps=1))
    _, gradient = _field(positions)
    if np.mean(np.sum(vertex_normals(positions, faces) * gradient, axis=1)) < 0:
        faces = faces[:, ::-1]
    return positions, faces


def _cut(positions: np.ndarray, faces: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Cut the sheet by the ball, minus the radius of the rim. Vertices close to the cut move onto it."""
    radius = _RADIUS - _WALL / 2
    beyond = np.linalg.norm(positions, axis=1) - radius
    near = np.abs(beyond) < 0.35 * spacing
    positions[near] = _onto_cut(positions[near], radius)
    side = np.where(near, 0, np.sign(beyond)).astype(int)

    inside = faces[(side[faces] <= 0).all(axis=1) & (side[faces] < 0).any(axis=1)]
    crossed = faces[(side[faces] > 0).any(axis=1) & (side[faces] < 0).any(axis=1)]
    outside = (side[crossed] > 0).sum(axis=1)
    # Rotate the corners of each crossed triangle so that the single one comes first: the only corner outside, or the
    # only one inside.
    first = np.argmax(np.where((outside == 1)[:, None], side[crossed] > 0, side[crossed] < 0), axis=1)
    a, b, c = (np.take_along_axis(crossed, ((first + k) % 3)[:, None], axis=1)[:, 0] for k in range(3))

    spans = np.sort(np.concatenate([np.stack([a, b], 1), np.stack([a, c], 1)]), axis=1)
    split = side[spans].prod(axis=1) < 0
    edges, which = np.unique(spans[split], axis=0, return_inverse=True)
    weight = np.abs(beyond[edges])
    middle = (positions[edges[:, 0]] * weight[:, 1:] + positions[edges[:, 1]] * weight[:, :1]) / weight.sum(1)[:, None]
    new = np.full(len(spans), -1)
    new[split] = len(positions) + which.ravel()
    ab, ac = np.split(new, 2)
    # If a corner lies on the cut, the cut meets its edge at this corner.
    ab, ac = np.where(ab < 0, b, ab), np.where(ac < 0, c, ac)
    tip = outside == 2
    pieces = [
        inside,
        np.stack([a, ab, ac], 1)[tip],
        np.stack([ab, b, c], 1)[~tip & (side[b] < 0)],
        np.stack([ab, c, ac], 1)[~tip & (side[c] < 0)],
    ]
    return np.concatenate([positions, _onto_cut(middle, radius)]), np.concatenate(pieces)


def _onto_cut(positions: np.ndarray, radius: float) -> np.ndarray:
    """Move positions (N,3) onto the intersection of gyroid and ball, by Newton steps in the plane of both gradients."""
    for _ in range(4):
        _, gradient = _field(positions)
        normal = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
        distance = np.linalg.norm(positions, axis=1)
        out = positions / distance[:, None]
        along = out - normal * np.sum(out * normal, axis=1, keepdims=True)
        # Where the ball is nearly tangent to the sheet, the curve is far: limit the step.
        size = np.maximum(np.sum(along**2, axis=1), 0.1)
        positions = positions - along * ((distance - radius) / size)[:, None]
        positions = _onto(positions)
    return positions


def _largest_piece(faces: np.ndarray) -> np.ndarray:
    """Return the faces of the largest connected piece, without faces at vertices that the rim passes twice."""
    while True:
        rim = _rim(faces)
        visits = np.bincount(rim[:, 0], minlength=faces.max() + 1)
        if visits.max() < 2:
            break
        faces = faces[(visits[faces] < 2).all(axis=1)]
    piece = face_components(faces)
    return faces[piece == np.argmax(np.bincount(piece))]


def _rim(faces: np.ndarray) -> np.ndarray:
    """Return the edges (E,2) that belong to one face only, in the direction of that face."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    size = int(faces.max()) + 1
    return edges[~np.isin(edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0])]


def _thicken(positions: np.ndarray, faces: np.ndarray, spacing: float) -> Mesh:
    """Turn the sheet into a wall: a copy on each side, joined by half-round strips along the rim."""
    _, gradient = _field(positions)
    normal = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    rim = _rim(faces)
    edge = np.unique(rim)
    out = positions[edge] / np.linalg.norm(positions[edge], axis=1, keepdims=True)
    out -= normal[edge] * np.sum(out * normal[edge], axis=1, keepdims=True)
    out /= np.linalg.norm(out, axis=1, keepdims=True)

    half, count = _WALL / 2, len(positions)
    layers = [positions + half * normal, positions - half * normal]
    rows = [np.arange(count)]
    steps = max(round(math.pi * half / spacing), 2)
    for k in range(1, steps):
        angle = math.pi * (0.5 - k / steps)
        row = np.empty(count, dtype=int)
        row[edge] = 2 * count + (k - 1) * len(edge) + np.arange(len(edge))
        rows.append(row)
        layers.append(positions[edge] + half * (math.sin(angle) * normal[edge] + math.cos(angle) * out))
    rows.append(count + np.arange(count))

    a, b = rim.T
    strips = []
    for upper, lower in pairwise(rows):
        strips += [np.stack([upper[b], upper[a], lower[a]], 1), np.stack([upper[b], lower[a], lower[b]], 1)]
    faces = np.concatenate([faces, faces[:, ::-1] + count, *strips]).astype(np.int32)
    positions = relax(np.concatenate(layers), faces, steps=2)
    return Mesh(positions=positions.astype(np.float32), faces=faces, name="gyroid")
