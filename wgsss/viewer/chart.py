"""Speed against accuracy, live: both sides as dots that move, before all that was measured until now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.study.scatter import pareto_front, ticks
from wgsss.viewer import marks
from wgsss.viewer.costs import SIDES
from wgsss.viewer.marks import Mark

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

HEIGHT = 260
"""logical pixels"""
_OFFSETS = ((8, -7), (-8, -7), (0, -21), (0, 7), (8, 5), (-8, 5), (8, -19), (-8, -19))
"""of labels from their marks, pixels: to the left a label ends there, above and below it is centred"""
_MOST_TIMES = 5
"""ticks that have room side by side"""


def errors(window: Window) -> None:
    """Declare how far each side is from the reference at this view, and the chart."""
    from imgui_bundle import imgui

    state, truth, measured = window.state, window.painter.truth, window.painter.measured
    state.is_measured = imgui.checkbox("measure against the integral", state.is_measured)[1]
    if truth.fault:
        imgui.text_wrapped(truth.fault)
    if measured is not None and any(measured.errors):
        imgui.text_disabled(f"reference at {truth.share:.3g} of the size")
        for name, found in zip(SIDES, measured.errors, strict=True):
            if found is not None and found.rel_rmse:
                psnr = "" if found.psnr is None else f", {found.psnr:.1f} dB"
                imgui.text(f"{name}: {100 * found.rel_rmse:.2f} %{psnr}")
    elif state.is_measured:
        imgui.text_disabled("refining in the background" if truth.is_refining else "when nothing moves")
    runs = window.trail.bench(state)
    session = marks.session(window.trail.points(state, window.full_size), state.methods)
    if session or runs:
        _draw(session, marks.bench(runs))
    if runs:
        imgui.text_disabled(f"faint: bench, {runs[0]['size'][0]} x {runs[0]['size'][1]} pixels, its own view")


def _draw(session: Sequence[Mark], bench: Sequence[Mark]) -> None:
    from imgui_bundle import imgui, implot

    flags = implot.Flags_.no_legend | implot.Flags_.no_inputs | implot.Flags_.no_mouse_text
    if not implot.begin_plot("##errors", (-1, HEIGHT), flags):
        return
    every = [*bench, *session]
    implot.setup_axes("ms a frame", "relative RMSE")
    for axis, values, unit in (
        (implot.ImAxis_.x1, [mark.ms for mark in every], ""),
        (implot.ImAxis_.y1, [mark.error for mark in every], " %"),
    ):
        low, high = marks.limits(values)
        at = ticks(low, high)
        if not unit and len(at) > _MOST_TIMES:
            at = [value for value in at if f"{value:e}".startswith("1")]
        implot.setup_axis_scale(axis, implot.Scale_.log10)
        implot.setup_axis_limits(axis, low, high, implot.Cond_.always)
        implot.setup_axis_ticks(axis, at, [f"{value:g}{unit}" for value in at])
    best = pareto_front([(mark.ms, mark.error) for mark in bench])
    if best:
        spec = implot.Spec()
        spec.line_color = imgui.ImVec4(1.0, 1.0, 1.0, 0.3)
        implot.plot_line("front", *_steps([bench[i] for i in best]), spec)
    for i, mark in enumerate(every):
        spec = implot.Spec()
        spec.marker, spec.marker_size = implot.Marker_.circle, mark.radius
        spec.marker_fill_color = spec.marker_line_color = imgui.ImVec4(*mark.colour)
        implot.plot_scatter(f"##{i}", np.array([mark.ms]), np.array([mark.error]), spec)
    _write(every[::-1])
    implot.end_plot()


def _steps(best: Sequence[Mark]) -> tuple[Any, Any]:
    """The best error that each time has reached."""
    x, y = np.array([mark.ms for mark in best]), np.array([mark.error for mark in best])
    return np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]


def _write(every: Sequence[Mark]) -> None:
    """Letters on marks, and beside them labels where they cover no other one and no mark; under a pointer, all of one.

    The first have the first choice of places.
    """
    from imgui_bundle import imgui, implot

    canvas = implot.get_plot_draw_list()
    frame = *implot.get_plot_pos(), *(implot.get_plot_pos() + implot.get_plot_size())
    places = [implot.plot_to_pixels(mark.ms, mark.error) for mark in every]
    taken = [_box(place.x - m.radius, place.y - m.radius, 2 * m.radius) for place, m in zip(places, every, strict=True)]
    for place, mark in zip(places, every, strict=True):
        if implot.is_plot_hovered() and np.hypot(*(imgui.get_mouse_pos() - place)) < mark.radius + 2:
            imgui.set_tooltip(f"{mark.about}\n{mark.ms:.4g} ms, {mark.error:.3g} %")
        size = imgui.calc_text_size(mark.letter)
        canvas.add_text(place - size * 0.5, imgui.IM_COL32(0, 0, 0, 255), mark.letter)
        width, height = imgui.calc_text_size(mark.label)
        for dx, dy in _OFFSETS if mark.label else ():
            box = _box(place.x + dx - width * (0.5 - 0.5 * np.sign(dx)), place.y + dy, width, height)
            if _inside(box, frame) and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                red, green, blue, opacity = mark.colour
                light = 0.5 + 0.5 * red, 0.5 + 0.5 * green, 0.5 + 0.5 * blue, max(opacity, 0.6)
                canvas.add_text(box[:2], imgui.get_color_u32(light), mark.label)
                break


def _box(x: float, y: float, width: float, height: float | None = None) -> Any:
    """Left, top, right and bottom."""
    return x, y, x + width, y + (width if height is None else height)


def _inside(box: Any, frame: Any) -> bool:
    return bool(frame[0] <= box[0] and box[2] <= frame[2] and frame[1] <= box[1] and box[3] <= frame[3])


def _overlap(a: Any, b: Any) -> bool:
    return bool(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])
