"""Triangulation of polygons: a fan for convex polygons, ear clipping in a coordinate plane for all others.

Ear clipping is that of mapbox-earcut. It may make triangles without area at corners on a straight line. These corners
are therefore removed before, and afterwards inserted into the edges of the triangles.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mapbox_earcut
import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]

STRAIGHT = 1e-5  # three corners lie on a line if the height of their triangle over its length is below this
MAX_FANS = 300  # corners of a polygon for which the fan with the least area is searched
MAX_CORNERS = 100_000  # corners of a face that is not convex: ear clipping may take quadratic time


def triangulate(path: Path, positions: Array, corners: Array, counts: Array, notes: list[str]) -> tuple[Array, Array]:
    """Split faces into triangles.

    `corners` (C,) are indices into positions (V, 3), face after face; `counts` (F,) are the numbers of corners of the
    faces. Returns int64 (T, 3), indices into `corners`, with the winding of the faces, and int64 (T,), the face of each
    triangle, in order. Faces of fewer than three corners are left out and counted in a note. A face without area gives
    triangles without area. Raises InputError, naming the file, if no face is left, or if a face that is not convex has
    more than MAX_CORNERS corners.
    """
    if not len(counts):
        raise InputError(f"{path}: the mesh is empty: it has no faces")
    short = np.count_nonzero(counts < 3)
    if short == len(counts):
        raise InputError(f"{path}: the mesh is empty: no face has three corners")
    if short:
        notes.append(f"{short} faces of fewer than three corners are left out")
    if (counts == 3).all():
        return np.arange(len(corners)).reshape(-1, 3), np.arange(len(counts))
    first = np.cumsum(counts) - counts
    triangles: list[Array] = []
    faces: list[Array] = []
    for count in np.unique(counts[counts >= 3]):
        of_this_size = np.flatnonzero(counts == count)
        places = first[of_this_size][:, None] + np.arange(count)
        fan = _fan(count)
        if count == 3:
            clip = np.zeros(len(places), bool)
        else:
            plane, straight, clip = _flattened(positions[corners[places]])
        triangles.append(places[~clip][:, fan].reshape(-1, 3))
        faces.append(np.repeat(of_this_size[~clip], len(fan)))
        for i in np.flatnonzero(clip):
            if count > MAX_CORNERS:
                raise InputError(f"{path}: a face of {count} corners is too large")
            cut = _clipped(positions[corners[places[i]]], plane[i], straight[i])
            triangles.append(places[i][cut])
            faces.append(np.full(len(cut), of_this_size[i]))
    order = np.argsort(np.concatenate(faces), kind="stable")
    return np.concatenate(triangles)[order], np.concatenate(faces)[order]


def _fan(count: int) -> Array:
    """Return the triangles (count - 2, 3) of a fan from the first corner."""
    after = np.arange(1, count - 1)
    return np.stack([np.zeros_like(after), after, after + 1], axis=1)


def _least_fan(points: Array) -> Array:
    """Return the fan of a polygon (N, 3) whose triangles have the least total area, over all start corners."""
    count = len(points)
    if count > MAX_FANS:
        return _fan(count)
    fans = (np.arange(count)[:, None, None] + _fan(count)) % count
    a, b, c = (points[fans[..., i]] for i in range(3))
    with np.errstate(all="ignore"):
        area = np.linalg.norm(np.cross(b - a, c - a), axis=2).sum(axis=1)
    least: Array = fans[area.argmin()]
    return least


def _flattened(points: Array) -> tuple[Array, Array, Array]:
    """Project polygons (F, N, 3) onto the coordinate plane that each faces most.

    Returns the projections, float64 (F, N, 2), counter-clockwise; for each corner whether it lies on a straight line
    between its neighbours, bool (F, N); and for each polygon whether it needs ear clipping, bool (F,): it is finite and
    not strictly convex. Projection drops one coordinate. A rotation would round, and move corners off a line.
    """
    with np.errstate(all="ignore"):
        points = points - points[:, :1]
        size = np.abs(points).max(axis=(1, 2), keepdims=True)
        points = np.ldexp(points, -np.frexp(size)[1])  # scaling by a power of 2 does not round
        normal = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)  # Newell's method
        axis = np.abs(normal).argmax(axis=1)
        backwards = np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] < 0
        axes = np.stack([axis + 1, axis + 2], axis=1) % 3
        axes = np.where(backwards[:, None], axes[:, ::-1], axes)
        plane = np.take_along_axis(points, axes[:, None, :], axis=2)
        to_here, to_next = plane - np.roll(plane, 1, axis=1), np.roll(plane, -1, axis=1) - plane
        turn = to_here[..., 0] * to_next[..., 1] - to_here[..., 1] * to_next[..., 0]
        ahead = np.einsum("fnk,fnk->fn", to_here, to_next)
        span = np.square(to_here + to_next).sum(axis=-1)
        straight = (np.abs(turn) <= STRAIGHT * span) & (ahead > 0)
        once = np.arctan2(turn, ahead).sum(axis=1) < 3 * np.pi  # a pentagram turns in one direction, too, but twice
        convex = ((turn > 0) & ~straight).all(axis=1) & once
        return plane, straight, ~convex & np.isfinite(plane).all(axis=(1, 2))


def _clipped(points: Array, plane: Array, straight: Array) -> Array:
    """Triangulate one polygon (N, 3) by ear clipping, given its counter-clockwise projection (N, 2): int64 (T, 3).

    Every edge of the polygon is an edge of a triangle, even if the projection crosses itself, so that no hole opens
    next to it.
    """
    count = len(plane)
    distinct = np.flatnonzero((points != np.roll(points, 1, axis=0)).any(axis=1))
    if 3 <= len(distinct) < count:
        return distinct[_clipped(points[distinct], plane[distinct], straight[distinct])]
    ring = np.flatnonzero(~straight)
    if len(ring) < 3 or len(distinct) < 3:
        return _fan(count)  # triangles without area, which the caller drops
    ends = np.array([len(ring)], np.uint32)
    cut = mapbox_earcut.triangulate_float64(np.ascontiguousarray(plane[ring]), ends).reshape(-1, 3)
    if len(cut) < len(ring) - 2:
        cut = _least_fan(points[ring])
    triangles = ring[cut]
    if len(ring) == count:
        return triangles
    following = dict(zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True))
    todo, done = triangles.tolist(), []
    while todo:
        triangle = todo.pop()
        for i in range(3):
            a, b, c = (triangle[(i + j) % 3] for j in range(3))
            between = (a + 1) % count
            if following.get(a) == b and between != b:
                following[a], following[between] = between, b
                todo += [[a, between, c], [between, b, c]]
                break
        else:
            done.append(triangle)
    return np.array(done)
