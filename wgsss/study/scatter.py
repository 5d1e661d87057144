"""The scatter plot of frame time against error: points, panels, Pareto front, axes, labels and colours.

Three painters draw it: Matplotlib (`chart`), a page (`chart_html`) and the viewer. This module needs none of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from wgsss.errors import InputError
from wgsss.registry import colour_of, place_of
from wgsss.study.run_record import Knob, Run

LEAST_ERROR = 1e-9
"""Relative errors up to this one are not drawn: the axis is logarithmic."""
ERROR_NAME = "relative RMSE of M"
TIME_NAME = "frame time, ms"
FLOOR_NAME = "the reference's own error"

MANTISSAS = ((1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9), (1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,))
"""Sets of mantissas that ticks may have. The first set that gives at most MOST_TICKS ticks is used."""
MOST_TICKS = 7
MARGIN = 0.1
"""Margin at each end of an axis, as a share of the decades that its values span."""
LEAST_MARGIN = 0.05
"""Smallest margin at each end of an axis, in decades."""

# Shapes for prints without colour: number of corners, 1 for a star, rotation in degrees.
_SHAPES = ((40, 0, 0), (4, 0, 45), (3, 0, 0), (4, 0, 0), (3, 0, 180), (5, 1, 0), (6, 0, 0), (4, 1, 0), (5, 0, 0))

Box = tuple[float, float, float, float]
"""A rectangle: its least x and y, then its greatest x and y."""


class Style(NamedTuple):
    """How the points of a method look."""

    colour: str
    """As #RRGGBB."""
    shape: tuple[int, int, int]
    """Number of corners, 1 for a star or 0 for a polygon, rotation in degrees."""


@dataclass(frozen=True)
class Point:
    """One setting of a method, with its frame time and its error."""

    method: str
    label: str
    """The text beside the point, which may be empty."""
    time_ms: float
    error: float
    """Relative RMSE of M."""
    quartiles_ms: tuple[float, float] | None = None
    """The first and the third quartile of the frame times."""
    curve: tuple[str, ...] = ()
    """The knobs whose values are words. A line joins the points of a method that share them."""


@dataclass(frozen=True)
class Panel:
    """The runs that can be compared: those of one scene, size, adapter and reference."""

    title: str
    runs: tuple[Run, ...] = field(repr=False)
    """Ordered by method, then by their place in its sweep."""

    @cached_property
    def points(self) -> tuple[Point, ...]:
        """The points of the runs whose error a logarithmic axis can show."""
        drawn = [run for run in self.runs if (run["error"]["rel_rmse"] or 0.0) > LEAST_ERROR]
        return tuple(
            Point(
                run["method"],
                label,
                run["frame_ms"],
                run["error"]["rel_rmse"] or 0.0,
                (run["frame_ms_quartiles"][0], run["frame_ms_quartiles"][1]),
                curve_of(run),
            )
            for run, label in zip(drawn, labels(drawn), strict=True)
        )

    @property
    def methods(self) -> list[str]:
        return list(dict.fromkeys(run["method"] for run in self.runs))

    @property
    def floor(self) -> float:
        """The largest relative error that the reference itself may have."""
        return max(run["floor"] or 0.0 for run in self.runs)


def panels(runs: Sequence[Run]) -> list[Panel]:
    """Group runs into panels. Of runs that differ only in date and version, the last one counts.

    Raises InputError if there are no runs.
    """
    if not runs:
        raise InputError("there are no runs to draw")
    groups: dict[tuple[str, tuple[int, ...], str, str], dict[object, Run]] = {}
    for run in runs:
        group = (run["scene"], tuple(run["size"]), run["adapter"], run["reference"])
        latest = groups.setdefault(group, {})
        setting = (run["method"], tuple(sorted(run["knobs"].items())))
        latest.pop(setting, None)
        latest[setting] = run
    result = []
    for group, latest in groups.items():
        scene, size, adapter, reference = group
        texts = (scene, f"{size[0]} x {size[1]}", adapter, f"against {reference}")
        varies = [i for i in range(1, 4) if len({other[i] for other in groups}) > 1]
        title = ", ".join([scene, *(texts[i] for i in varies)])
        ordered = sorted(latest.values(), key=lambda run: (*method_order(run["method"]), run["step"]))
        result.append(Panel(title, tuple(ordered)))
    return result


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices of the (time, error) points that no other point beats, ordered by time.

    A point beats another one if it is better in one coordinate and not worse in the other. Less is better in both.
    """
    front: list[int] = []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if not front or points[i][1] < points[front[-1]][1] or points[i] == points[front[-1]]:
            front.append(i)
    return front


def axis_limits(
    values: Sequence[float], *, least_margin: float = LEAST_MARGIN, least_span: float = 0.0
) -> tuple[float, float]:
    """Return the ends of a logarithmic axis that shows all values.

    Args:
        least_margin: smallest margin at each end, in decades.
        least_span: smallest length of the axis, in decades.
    """
    low, high = min(values), max(values)
    decades = math.log10(high / low)
    margin = max(MARGIN * decades, least_margin, 0.5 * (least_span - decades))
    return low * 10.0**-margin, high * 10.0**margin


def ticks(low: float, high: float) -> list[float]:
    """Return round numbers between two positive numbers, few enough to be read."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for mantissas in MANTISSAS:
        values = [m * 10.0**decade for decade in decades for m in mantissas if low <= m * 10.0**decade <= high]
        if len(values) <= MOST_TICKS:
            break
    return values


def style(method: str) -> Style:
    """Return the colour and the shape of a method's points, the same in every chart."""
    return Style(colour_of(method), _SHAPES[place_of(method) % len(_SHAPES)])


def method_order(method: str) -> tuple[int, str]:
    """Return a key that sorts methods in the same order in every chart."""
    return place_of(method), method


def labels(runs: Sequence[Run]) -> list[str]:
    """Return a label for each run: the values of the knobs that vary between the runs of its method.

    The first label of each method also names these knobs.
    """
    by_method: dict[str, list[Run]] = {}
    for run in runs:
        by_method.setdefault(run["method"], []).append(run)
    varying = {method: _varying_knobs(own) for method, own in by_method.items()}
    texts = []
    for run in runs:
        knobs = varying[run["method"]]
        values = [_number(run["knobs"].get(knob)) for knob in knobs]
        named = [f"{knob} {value}" for knob, value in zip(knobs, values, strict=True)]
        texts.append(", ".join(named if run is by_method[run["method"]][0] else values))
    return texts


def _varying_knobs(runs: Sequence[Run]) -> list[str]:
    shared = [knob for knob in runs[0]["knobs"] if all(knob in run["knobs"] for run in runs)]
    return [knob for knob in shared if len({repr(run["knobs"][knob]) for run in runs}) > 1]


def setting_text(method: str, knobs: dict[str, Knob]) -> str:
    """Return a method and its knobs in words."""
    values = {knob: f"{value:.4g}" if isinstance(value, float) else str(value) for knob, value in knobs.items()}
    return ", ".join([method, *(f"{knob} {value}" for knob, value in values.items())])


def curve_of(run: Run) -> tuple[str, ...]:
    """Return the knobs of a run that are words. Along a curve, only numbers change."""
    return tuple(value for value in run["knobs"].values() if isinstance(value, str))


def caption(groups: Sequence[Panel]) -> str:
    """Return a text that says what the chart shows, and where and when it was measured."""
    runs = [run for panel in groups for run in panel.runs]

    def all_of(values: Iterable[str]) -> str:
        return ", ".join(dict.fromkeys(values))

    sizes = [f"{width} x {height}" for width, height in (run["size"] for run in runs)]
    dates = sorted(run["date"][:10] for run in runs)
    when = dates[0] if dates[0] == dates[-1] else f"{dates[0]} to {dates[-1]}"
    return (
        f"Time: sum of the passes of a frame by {all_of(run['clock'] for run in runs)}, median and quartiles. "
        f"Error: over the pixels that show an object, against {all_of(run['reference'] for run in runs)}. "
        f"{all_of(run['adapter'] for run in runs)}; "
        f"{all_of(sizes)} pixels; "
        f"wgsss {all_of(run['version'] for run in runs)}; {when}."
    )


def is_free(box: Box, frame: Box, taken: Sequence[Box]) -> bool:
    """Whether a label fits into a frame at a box and covers no other label and no point."""
    inside = frame[0] <= box[0] and frame[1] <= box[1] and box[2] <= frame[2] and box[3] <= frame[3]
    return inside and not any(_overlap(box, other) for other in taken)


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
