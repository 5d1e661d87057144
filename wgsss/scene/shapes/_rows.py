"""Triangulated strips between rows of points: how the shapes given by a parametrisation get well-shaped triangles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from wgsss.errors import InputError


def vertex_count(shape: str, vertices: int | None, default: int, low: int, high: int) -> int:
    """The approximate vertex count to aim at. Raises InputError outside low..high."""
    if vertices is None:
        return default
    if not isinstance(vertices, int) or not low <= vertices <= high:
        raise InputError(f"{shape}: vertices must be a whole number from {low} to {high}, not {vertices!r}")
    return vertices


def fit_spacing(count: Callable[[float], int], vertices: int) -> float:
    """The spacing, mm, at which `count(spacing)` (falling with the spacing) is nearest to `vertices`."""
    low, high = 0.01, 100.0
    for _ in range(24):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if count(middle) > vertices else (low, middle)
    return high


def spread(counts: np.ndarray, *, closed: bool) -> np.ndarray:
    """Evenly spaced parameters (sum(counts),), row after row: 0..1 with both ends, or [0, 1) around closed rows."""
    row = np.repeat(np.arange(len(counts)), counts)
    index = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    gaps = counts if closed else np.maximum(counts - 1, 1)
    return index / gaps[row]


def join_rows(counts: np.ndarray, params: np.ndarray, *, closed: bool) -> np.ndarray:
    """Faces (F,3) between each row of points and the next; rows of one point become fans.

    counts (R,): points per row; params (sum(counts),): rising within each row, 0..1. Seen with the parameter to the
    right and the next row above, the triangles are counter-clockwise. Edges advance in the order of their middles, so
    rows of different counts meet without slivers.
    """
    starts = np.cumsum(counts) - counts
    edges = np.where(counts > 1, counts if closed else counts - 1, 0)
    row = np.repeat(np.arange(len(counts)), edges)
    edge = np.arange(len(row)) - np.repeat(np.cumsum(edges) - edges, edges)
    head = starts[row] + edge
    tail = starts[row] + (edge + 1) % counts[row]
    middle = 0.5 * (params[head] + params[tail] + (tail < head))

    # Each row's edges stand below the strip with the next row and above the strip with the previous one.
    strip = np.concatenate([row, row - 1])
    lower = np.repeat([True, False], len(row))
    real = (strip >= 0) & (strip < len(counts) - 1)
    order = np.lexsort((np.concatenate([middle, middle])[real], strip[real]))
    strip, lower = strip[real][order], lower[real][order]
    head, tail = (np.concatenate([a, a])[real][order] for a in (head, tail))

    def passed(mine: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """The point reached on the other side: as many edges along its row as came before within this strip."""
        before = np.cumsum(mine) - mine
        first = np.searchsorted(strip, strip)
        return starts[owner] + (before - before[first]) % counts[owner]

    apex = np.where(lower, passed(~lower, strip + 1), passed(lower, strip))
    return np.where(lower[:, None], np.stack([head, tail, apex], 1), np.stack([tail, head, apex], 1)).astype(np.int32)
