"""The scatter plot of speed against accuracy as the viewer shows it: points, Pareto front, axes and label positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wgsss.methods import Method
from wgsss.study import scatter
from wgsss.study.run_record import Run
from wgsss.study.scatter import LEAST_ERROR, Box, setting_text
from wgsss.viewer.history import MeasuredPoint, method_label

Colour = tuple[float, float, float, float]
"""sRGB and opacity, each from 0 to 1"""

OLDEST_OPACITY = 0.35
"""opacity of the point measured first, where the last has 1"""
BENCH_OPACITY = 0.4
SIDE_RADIUS, EARLIER_RADIUS, BENCH_RADIUS = 7.0, 4.0, 3.0
"""logical pixels: of the methods shown now, of those measured before, and of the runs of a benchmark"""
_LEAST_MARGIN = 0.08
"""at each end of an axis, decades"""
_MAX_TIME_TICKS = 5
"""ticks of the time axis that fit side by side"""
_LABEL_OFFSETS = ((8, -7), (-8, -7), (0, -21), (0, 7), (8, 5), (-8, 5), (8, -19), (-8, -19))
"""positions of a label relative to its point that are tried in this order, pixels, y down.

A label with a positive x starts there, one with a negative x ends there, and one with 0 is centred.
"""


@dataclass(frozen=True)
class ChartPoint:
    """A point of the scatter plot."""

    ms: float
    error: float
    """relative RMSE, percent"""
    description: str
    """shown while the pointer is over the point"""
    label: str
    """written beside the point, if there is room; empty: nothing is"""
    colour: Colour
    radius: float
    letter: str = ""
    """written on the point: the sides that it stands for"""


def session_points(measured: Sequence[MeasuredPoint], methods: Sequence[Method]) -> list[ChartPoint]:
    """Return a point for each measured one, those of the two sides' present methods last, and so drawn on top.

    Earlier points fade with their age. `measured` has the oldest first, `methods` those of the left and right side.
    """
    labels = [method_label(method) for method in methods]
    earlier: list[ChartPoint] = []
    present: list[ChartPoint] = []
    for age, point in enumerate(reversed(measured)):
        letter = "".join(side for side, label in zip("LR", labels, strict=True) if label == point.label)
        opacity = 1.0 if letter else 1.0 - (1.0 - OLDEST_OPACITY) * age / max(len(measured) - 1, 1)
        radius = (SIDE_RADIUS if letter else EARLIER_RADIUS) * (1.5 if len(letter) > 1 else 1.0)
        colour = method_colour(point.method, opacity)
        (present if letter else earlier).append(
            ChartPoint(point.ms, 100 * point.rel_rmse, point.label, point.label, colour, radius, letter)
        )
    return [*reversed(earlier), *present]


def bench_points(runs: Sequence[Run]) -> list[ChartPoint]:
    """Return a point for each run of a benchmark; each method is labelled at its most accurate run."""
    with_error = (run for run in runs if (run["error"]["rel_rmse"] or 0.0) > LEAST_ERROR)
    by_error = sorted(with_error, key=lambda run: -(run["error"]["rel_rmse"] or 0.0))
    most_accurate = {run["method"]: run for run in by_error}
    return [
        ChartPoint(
            run["frame_ms"],
            100 * (run["error"]["rel_rmse"] or 0.0),
            setting_text(run["method"], run["knobs"]),
            run["method"] if most_accurate[run["method"]] is run else "",
            method_colour(run["method"], BENCH_OPACITY),
            BENCH_RADIUS,
        )
        for run in by_error
    ]


def method_colour(method: str, opacity: float) -> Colour:
    """Return the colour of a method in all charts, with white in place of black."""
    text = scatter.style(method).colour
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return (red, green, blue, opacity) if red + green + blue > 0 else (1.0, 1.0, 1.0, opacity)


def front_steps(points: Sequence[ChartPoint]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return x and y of the steps along the Pareto front: the lowest error (y) that is reached within a time (x)."""
    best = [points[i] for i in scatter.pareto_front([(point.ms, point.error) for point in points])]
    x, y = np.array([point.ms for point in best]), np.array([point.error for point in best])
    return np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]


def axis_limits(values: Sequence[float]) -> tuple[float, float]:
    """Return limits of a logarithmic axis with a margin around all values; it spans half a decade at least."""
    return scatter.axis_limits(values, least_margin=_LEAST_MARGIN, least_span=0.5)


def time_ticks(low: float, high: float) -> list[float]:
    """Return the ticks of the time axis: powers of ten alone if there is no room for more."""
    values = scatter.ticks(low, high)
    return values if len(values) <= _MAX_TIME_TICKS else [value for value in values if f"{value:e}".startswith("1")]


def place_labels(
    centres: Sequence[tuple[float, float]], radii: Sequence[float], sizes: Sequence[tuple[float, float]], frame: Box
) -> list[tuple[float, float] | None]:
    """Choose the left top corner of each label, so that it lies in the frame and covers no point and no other label.

    Args:
        centres: of the points, pixels. Earlier ones choose first.
        radii: of the points, pixels.
        sizes: width and height of the labels, pixels; a label of no width is left out.
        frame: of the plot.

    Returns:
        None for a label for which there is no room.
    """
    taken = [(x - r, y - r, x + r, y + r) for (x, y), r in zip(centres, radii, strict=True)]
    corners: list[tuple[float, float] | None] = []
    for (x, y), (width, height) in zip(centres, sizes, strict=True):
        corner = None
        for dx, dy in _LABEL_OFFSETS if width else ():
            left, top = x + dx - width * (0.5 - 0.5 * float(np.sign(dx))), y + dy
            box = left, top, left + width, top + height
            if scatter.is_free(box, frame, taken):
                taken.append(box)
                corner = left, top
                break
        corners.append(corner)
    return corners
