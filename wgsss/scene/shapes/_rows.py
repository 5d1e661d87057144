"""Triangulation of strips between rows of points, for parametric shapes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from wgsss.errors import InputError


def vertex_count(shape: str, vertices: int | None, default: int, low: int, high: int) -> int:
    """Return the number of vertices to aim at. Raises InputError if `vertices` is outside low..high."""
    if vertices is None:
        return default
    if not isinstance(vertices, int) or not low <= vertices <= high:
        raise InputError(f"{shape}: vertices must be a whole number from {low} to {high}, not {vertices!r}")
    return vertices


def fit_spacing(count: Callable[[float], int], vertices: int) -> float:
    """Find the spacing, mm, at which `count(spacing)`, a decreasing function, is nearest to `vertices`."""
    low, high = 0.01, 100.0
    for _ in range(24):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if count(middle) > vertices else (low, middle)
    return high


def spread(counts: np.ndarray, *, closed: bool) -> np.ndarray:
    """Return evenly spaced parameters (sum(counts),), row after row: 0..1 with both ends, or [0, 1) for closed rows."""
    row = np.repeat(np.arange(len(counts)), counts)
    index = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    gaps = counts if closed else np.maximum(counts - 1, 1)
    return index / gaps[row]


def join_rows(counts: np.ndarray, params: np.ndarray, *, closed: bool) -> np.ndarray:
    """Triangulate the strips between successive rows of points: faces (F,3). A row of one point gives a fan.

    counts (R,): points per row; params (sum(counts),): increasing within each row, 0..1. If the parameter increases to
    the right and the next row is above, triangles are counter-clockwise. The edges of both rows of a strip are sorted
    by their midpoints, so that rows of different counts are joined without slivers.
    """
    starts = np.cumsum(counts) - counts
    edges = np.where(counts > 1, counts if closed else counts - 1, 0)
    row = np.repeat(np.arange(len(counts)), edges)
    edge = np.arange(len(row)) - np.repeat(np.cumsum(edges) - edges, edges)
    head = starts[row] + edge
    tail = starts[row] + (edge + 1) % counts[row]
    middle = 0.5 * (params[head] + params[tail] + (tail < head))

    # Each edge of a row borders the strip to the next row from below, and the strip to the previous row from above.
    strip = np.concatenate([row, row - 1])
    lower = np.repeat([True, False], len(row))
    real = (strip >= 0) & (strip < len(counts) - 1)
    order = np.lexsort((np.concatenate([middle, middle])[real], strip[real]))
    strip, lower = strip[real][order], lower[real][order]
    head, tail = (np.concatenate([a, a])[real][order] for a in (head, tail))

    def reached(edges: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Return the point on the opposite `row` of each edge: the number of opposite edges before it in its strip."""
        before = np.cumsum(edges) - edges
        first = np.searchsorted(strip, strip)
        return starts[row] + (before - before[first]) % counts[row]

    apex = np.where(lower, reached(~lower, strip + 1), reached(lower, strip))
    return np.where(lower[:, None], np.stack([head, tail, apex], 1), np.stack([tail, head, apex], 1)).astype(np.int32)
