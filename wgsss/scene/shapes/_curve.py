"""Smooth curves through given points."""

from __future__ import annotations

import numpy as np


def smooth_curve(points: np.ndarray, samples: int, *, closed: bool = False) -> np.ndarray:
    """Sample the Catmull-Rom curve through `points` (N,D) at equal steps of its parameter: (samples, D).

    A closed curve starts at the first point and does not repeat it. An open curve includes both ends.
    """
    points = np.asarray(points, dtype=float)
    n = len(points)
    t = np.linspace(0, n, samples, endpoint=False) if closed else np.linspace(0, n - 1, samples)
    k = np.minimum(t.astype(int), n - 1 if closed else n - 2)
    s = (t - k)[:, None]
    index = [(k + d) % n if closed else np.clip(k + d, 0, n - 1) for d in (-1, 0, 1, 2)]
    a, b, c, d = (points[i] for i in index)
    return 0.5 * (2 * b + s * (c - a) + s**2 * (2 * a - 5 * b + 4 * c - d) + s**3 * (3 * b - 3 * c + d - a))
