"""The points, axes and labels of the scatter plot."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.methods import make_method
from wgsss.viewer import chart
from wgsss.viewer.chart import Box, ChartPoint
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
    frame = Box(0.0, 0.0, 100.0, 60.0)
    centres, size = [(20.0, 30.0), (24.0, 30.0), (60.0, 5.0), (50.0, 50.0)], (30.0, 12.0)
    corners = chart.place_labels(centres, [4.0] * 4, [size, size, (90.0, 12.0), (0.0, 12.0)], frame)
    points = [Box(x - 4.0, y - 4.0, x + 4.0, y + 4.0) for x, y in centres]
    boxes = [Box(x, y, x + size[0], y + size[1]) for x, y in (corner for corner in corners if corner is not None)]
    assert len(boxes) == 2 and corners[2:] == [None, None], "one is too wide, and one is empty"
    assert all(frame.contains(box) for box in boxes) and not boxes[0].overlaps(boxes[1])
    assert not any(box.overlaps(point) for box in boxes for point in points)
