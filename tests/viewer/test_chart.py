"""The points, axes and labels of the scatter plot."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.registry import make_method
from wgsss.study.scatter import is_free
from wgsss.viewer import chart
from wgsss.viewer.chart import ChartPoint
from wgsss.viewer.history import MeasuredPoint


def test_points_of_the_sides_are_last_and_stand_out() -> None:
    measured = [
        MeasuredPoint("sam", "sam", 3.0, 0.2),
        MeasuredPoint("lambert", "lambert", 1.0, 0.5),
        MeasuredPoint("deon07", "deon07", 9.0, 0.1),
    ]
    points = chart.session_points(measured, [make_method("lambert"), make_method("jimenez15")])
    assert [(point.label, point.letter, point.error) for point in points] == [
        *(("sam", "", 20.0), ("deon07", "", 10.0), ("lambert", "L", 50.0)),
    ]
    first, last, side = points
    assert first.colour[3] == pytest.approx(chart.OLDEST_OPACITY)
    assert first.colour[3] < last.colour[3] <= side.colour[3] == 1.0
    assert side.radius > last.radius
    assert chart.session_points(measured, [make_method("lambert")] * 2)[-1].letter == "LR"


def test_benchmark_labels_each_method_once_at_its_most_accurate_run() -> None:
    knobs = [("sam", {"samples": 3}, 0.3), ("lambert", {}, 0.5), ("sam", {"samples": 8}, 0.2), ("black", {}, None)]
    runs = [{"method": m, "knobs": k, "frame_ms": 1.0, "error": {"rel_rmse": e}} for m, k, e in knobs]
    assert {(point.description, point.label) for point in chart.bench_points(runs)} == {
        *(("lambert", "lambert"), ("sam, samples 3", ""), ("sam, samples 8", "sam")),
    }


def test_front_has_the_lowest_error_within_each_time() -> None:
    points = [ChartPoint(ms, error, "", "", (0, 0, 0, 1), 1.0) for ms, error in ((4, 2), (1, 8), (3, 9), (2, 4))]
    x, y = chart.front_steps(points)
    np.testing.assert_array_equal(x, [1, 2, 2, 4, 4])
    np.testing.assert_array_equal(y, [8, 8, 4, 4, 2])


def test_axis_holds_all_values_and_spans_half_a_decade_at_least() -> None:
    low, high = chart.axis_limits([10.0])
    assert high / low == pytest.approx(10**0.5) and low * high == pytest.approx(100.0)
    low, high = chart.axis_limits([1.0, 1000.0])
    assert low < 0.9 and high > 1100.0


def test_labels_cover_no_point_and_no_other_label() -> None:
    frame, radius, (width, height) = (0.0, 0.0, 100.0, 60.0), 4.0, (30.0, 12.0)
    centres = [(20.0, 30.0), (24.0, 30.0), (60.0, 5.0), (50.0, 50.0)]
    sizes = [(width, height), (width, height), (90.0, height), (0.0, height)]
    corners = chart.place_labels(centres, [radius] * 4, sizes, frame)
    assert corners[2:] == [None, None], "one is too wide, and one is empty"
    taken = [(x - radius, y - radius, x + radius, y + radius) for x, y in centres]
    for corner in corners[:2]:
        assert corner is not None
        box = (*corner, corner[0] + width, corner[1] + height)
        assert is_free(box, frame, taken)
        taken.append(box)
