"""Splitting polygons into triangles: convex ones as a fan, all others by ear clipping in the plane that fits them.

Ear clipping is mapbox-earcut's. It may cut triangles without area off corners that lie on a straight line, so those
corners are left out first, and split the triangles beside them afterwards.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mapbox_earcut
import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]

STRAIGHT = 1e-5  # height over length of the triangle of three corners, below which they lie on a line
MAX_FANS = 300  # of which the one with the least area is looked for
MAX_CORNERS = 100_000  # of a face that is not convex: the time of ear clipping may grow with their square


def triangulate(path: Path, positions: Array, corners: Array, counts: Array, notes: list[str]) -> tuple[Array, Array]:
    """Triangles of faces, whose `corners` (C,) are indices into positions (V, 3) and follow one another by `counts`.

    Returns int64 (T, 3), the places of their corners in `corners`, wound as the faces are, and int64 (T,), the face of
    each, rising. Faces of fewer than three corners are left out, which a note counts. A face without an area gives
    triangles without one. Raises InputError, naming the file, where no face is left, and for a face of more than
    MAX_CORNERS that is not convex.
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
    after = np.arange(1, count - 1)
    return np.stack([np.zeros_like(after), after, after + 1], axis=1)


def _least_fan(points: Array) -> Array:
    """The fan from that corner of a polygon (N, 3) from which its triangles have the least area."""
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
    """Polygons (F, N, 3) in the coordinate plane that they face most, float64 (F, N, 2) and counter-clockwise there;
    which of their corners lie on a straight line between their neighbours, bool (F, N); and which polygons are neither
    strictly convex nor beyond help, bool (F,).

    A coordinate is left out instead of turning the polygon, so that no rounding moves its corners off a line.
    """
    with np.errstate(all="ignore"):
        points = points - points[:, :1]
        size = np.abs(points).max(axis=(1, 2), keepdims=True)
        points = np.ldexp(points, -np.frexp(size)[1])  # by a power of 2, which rounds nothing
        normal = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)  # Newell's
        axis = np.abs(normal).argmax(axis=1)
        backwards = np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] < 0
        kept = np.stack([axis + 1, axis + 2], axis=1) % 3
        kept = np.where(backwards[:, None], kept[:, ::-1], kept)
        plane = np.take_along_axis(points, kept[:, None, :], axis=2)
        to_here, to_next = plane - np.roll(plane, 1, axis=1), np.roll(plane, -1, axis=1) - plane
        turn = to_here[..., 0] * to_next[..., 1] - to_here[..., 1] * to_next[..., 0]
        ahead = np.einsum("fnk,fnk->fn", to_here, to_next)
        span = np.square(to_here + to_next).sum(axis=-1)
        straight = (np.abs(turn) <= STRAIGHT * span) & (ahead > 0)
        once = np.arctan2(turn, ahead).sum(axis=1) < 3 * np.pi  # a star turns in one direction too, but twice
        convex = ((turn > 0) & ~straight).all(axis=1) & once
        return plane, straight, ~convex & np.isfinite(plane).all(axis=(1, 2))


def _clipped(points: Array, plane: Array, straight: Array) -> Array:
    """Triangles int64 (T, 3) of one polygon (N, 3), which is counter-clockwise in a plane (N, 2).

    All its edges are edges of triangles, even where it crosses itself in that plane, so that no hole opens beside it.
    """
    count = len(plane)
    distinct = np.flatnonzero((points != np.roll(points, 1, axis=0)).any(axis=1))
    if 3 <= len(distinct) < count:
        return distinct[_clipped(points[distinct], plane[distinct], straight[distinct])]
    ring = np.flatnonzero(~straight)
    if len(ring) < 3 or len(distinct) < 3:
        return _fan(count)  # without an area, which is for the caller to find
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
