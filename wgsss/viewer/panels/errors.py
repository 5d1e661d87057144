"""The errors of both sides against a reference, and the scatter plot of error over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui, implot

from wgsss.study.scatter import ticks
from wgsss.viewer import chart
from wgsss.viewer.chart import ChartPoint, Colour
from wgsss.viewer.session import SIDES, Session

HEIGHT = 260
"""of the plot, logical pixels"""
HOVER_MARGIN = 2
"""distance from a point within which the pointer is on it, logical pixels"""


def declare_errors(session: Session) -> None:
    """Declare the switch that starts measuring, the errors of both sides at this view, and the plot."""
    painter = session.painter
    reference, measurement = painter.reference, painter.measurement
    session.is_measured = imgui.checkbox("measure against the integral", session.is_measured)[1]
    if reference.error_message:
        imgui.text_wrapped(reference.error_message)
    if measurement is not None and any(measurement.errors):
        imgui.text_disabled(f"reference at {reference.scale:.3g} of the size")
        for name, errors in zip(SIDES, measurement.errors, strict=True):
            if errors is not None and errors.rel_rmse:
                psnr = "" if errors.psnr is None else f", {errors.psnr:.1f} dB"
                imgui.text(f"{name}: {100 * errors.rel_rmse:.2f} %{psnr}")
    elif session.is_measured:
        imgui.text_disabled("estimating in the background" if reference.is_refining else "starts when nothing moves")
    runs = session.history.bench_runs(session.opened, session.scene)
    points = chart.session_points(session.history.points(session.view), session.methods)
    if points or runs:
        _declare_plot(points, chart.bench_points(runs))
    if runs:
        imgui.text_disabled(f"faint: bench, {runs[0]['size'][0]} x {runs[0]['size'][1]} pixels, its own view")


def _declare_plot(points: Sequence[ChartPoint], bench: Sequence[ChartPoint]) -> None:
    """Declare the plot: the runs of a benchmark and their Pareto front behind the points of this session."""
    flags = implot.Flags_.no_legend | implot.Flags_.no_inputs | implot.Flags_.no_mouse_text
    if not implot.begin_plot("##errors", (-1, HEIGHT), flags):
        return
    drawn = [*bench, *points]
    implot.setup_axes("ms a frame", "relative RMSE")
    low, high = chart.axis_limits([point.ms for point in drawn])
    times = chart.time_ticks(low, high)
    _setup_axis(implot.ImAxis_.x1, low, high, times, "")
    low, high = chart.axis_limits([point.error for point in drawn])
    _setup_axis(implot.ImAxis_.y1, low, high, ticks(low, high), " %")
    if bench:
        spec = implot.Spec()
        spec.line_color = imgui.ImVec4(1.0, 1.0, 1.0, 0.3)
        implot.plot_line("front", *chart.front_steps(bench), spec)
    for i, point in enumerate(drawn):
        spec = implot.Spec()
        spec.marker, spec.marker_size = implot.Marker_.circle, point.radius
        spec.marker_fill_color = spec.marker_line_color = imgui.ImVec4(*point.colour)
        implot.plot_scatter(f"##{i}", np.array([point.ms]), np.array([point.error]), spec)
    _write_labels(drawn[::-1])
    implot.end_plot()


def _setup_axis(axis: int, low: float, high: float, values: Sequence[float], unit: str) -> None:
    """Make an axis logarithmic, from `low` to `high`, with ticks at some values."""
    implot.setup_axis_scale(axis, implot.Scale_.log10)
    implot.setup_axis_limits(axis, low, high, implot.Cond_.always)
    implot.setup_axis_ticks(axis, list(values), [f"{value:g}{unit}" for value in values])


def _write_labels(points: Sequence[ChartPoint]) -> None:
    """Write letters on points, and labels beside those where there is room; the first points choose first.

    The pointer over a point shows all about it.
    """
    canvas = implot.get_plot_draw_list()
    centres = [implot.plot_to_pixels(point.ms, point.error) for point in points]
    for centre, point in zip(centres, points, strict=True):
        if implot.is_plot_hovered() and np.hypot(*(imgui.get_mouse_pos() - centre)) < point.radius + HOVER_MARGIN:
            imgui.set_tooltip(f"{point.description}\n{point.ms:.4g} ms, {point.error:.3g} %")
        size = imgui.calc_text_size(point.letter)
        canvas.add_text(centre - size * 0.5, imgui.IM_COL32(0, 0, 0, 255), point.letter)
    left_top = implot.get_plot_pos()
    right_bottom = left_top + implot.get_plot_size()
    sizes = [imgui.calc_text_size(point.label) for point in points]
    corners = chart.place_labels(
        [(centre.x, centre.y) for centre in centres],
        [point.radius for point in points],
        [(size.x, size.y) for size in sizes],
        (left_top.x, left_top.y, right_bottom.x, right_bottom.y),
    )
    for corner, point in zip(corners, points, strict=True):
        if corner is not None:
            canvas.add_text(corner, imgui.get_color_u32(_label_colour(point.colour)), point.label)


def _label_colour(colour: Colour) -> Colour:
    """Return a lighter shade of the colour of a point, opaque enough to be read."""
    red, green, blue, opacity = colour
    return 0.5 + 0.5 * red, 0.5 + 0.5 * green, 0.5 + 0.5 * blue, max(opacity, 0.6)
