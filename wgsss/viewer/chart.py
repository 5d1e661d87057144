"""Speed against accuracy, live: both sides as dots, before what was measured until now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.study.chart import front, style, ticks
from wgsss.viewer.costs import SIDES
from wgsss.viewer.trail import label_of

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

HEIGHT = 280
"""logical pixels"""
FAINTEST = 0.35
"""opacity of the first point of a session, where the last has 1"""
BENCH = 0.4
"""opacity of a bench's runs"""
_OFFSETS = ((8, -7), (-8, -7), (0, -19), (0, 5), (8, 5), (-8, 5), (8, -19), (-8, -19))
"""of labels from their marks, pixels; to the left a label ends there, above and below it is centred"""


@dataclass(frozen=True)
class Mark:
    """Something measured: error in percent."""

    ms: float
    error: float
    label: str
    colour: tuple[float, float, float, float]
    size: float


def errors(window: Window) -> None:
    """Declare how far each side is from the reference at this view, and the chart."""
    from imgui_bundle import imgui

    state, painter = window.state, window.painter
    state.is_measured = imgui.checkbox("measure against the integral", state.is_measured)[1]
    if painter.truth.fault:
        imgui.text_wrapped(painter.truth.fault)
    measured = painter.measured
    if measured is None or not any(measured.errors):
        if state.is_measured:
            imgui.text_disabled("refining in the background" if painter.truth.is_refining else "when nothing moves")
    else:
        imgui.text_disabled(f"reference at {painter.truth.share:.3g} of the size")
        for name, found in zip(SIDES, measured.errors, strict=True):
            if found is not None and found.rel_rmse:
                psnr = "" if found.psnr is None else f", {found.psnr:.1f} dB"
                imgui.text(f"{name}: {100 * found.rel_rmse:.2f} %{psnr}")
    runs = window.trail.bench(state)
    marks = session(window)
    if marks or runs:
        _draw(marks, bench_marks(runs))
    if runs:
        imgui.text_disabled(f"faint: bench, {runs[0]['size'][0]} x {runs[0]['size'][1]} pixels, its own view")


def session(window: Window) -> list[Mark]:
    """What was measured at this view: the sides as they are now first and largest, then the last before."""
    points = window.trail.points(window.state, window.full_size)
    sides = {label_of(method): name for name, method in zip(SIDES, window.state.methods, strict=True)}
    found = []
    for age, point in enumerate(reversed(points)):
        now = sides.get(point.label)
        opacity = 1.0 if now else 1.0 - (1.0 - FAINTEST) * age / max(len(points) - 1, 1)
        label = f"{now}: {point.label}" if now else point.label
        found.append(Mark(point.ms, 100 * point.rel_rmse, label, colour(point.method, opacity), 7.0 if now else 4.0))
    return sorted(found, key=lambda mark: -mark.size)


def bench_marks(runs: Sequence[dict[str, Any]]) -> list[Mark]:
    """A bench's runs, those that no other beats labelled."""
    seen = [run for run in runs if run["error"]["rel_rmse"]]
    points = [(run["frame_ms"], 100 * run["error"]["rel_rmse"]) for run in seen]
    best = front(points)
    return [
        Mark(*points[i], run["method"] if i in best else "", colour(run["method"], BENCH), 3.0)
        for i, run in enumerate(seen)
    ]


def colour(method: str, opacity: float) -> tuple[float, float, float, float]:
    """That of the method in all charts; black is white here."""
    text = style(method)[0]
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return (red, green, blue, opacity) if red + green + blue > 0 else (1.0, 1.0, 1.0, opacity)


def limits(values: Sequence[float]) -> tuple[float, float]:
    """Of a logarithmic axis with room round all values: half a decade at least."""
    low, high = np.log10(min(values)), np.log10(max(values))
    room = max(0.12 * (high - low), 0.25 - 0.5 * (high - low), 0.1)
    return float(10 ** (low - room)), float(10 ** (high + room))


def _draw(marks: Sequence[Mark], behind: Sequence[Mark]) -> None:
    from imgui_bundle import imgui, implot

    every = [*behind, *reversed(marks)]
    flags = implot.Flags_.no_legend | implot.Flags_.no_inputs
    if not implot.begin_plot("##errors", (-1, HEIGHT), flags):
        return
    implot.setup_axes("ms a frame", "relative RMSE")
    for axis, values, unit in (
        (implot.ImAxis_.x1, [mark.ms for mark in every], ""),
        (implot.ImAxis_.y1, [mark.error for mark in every], " %"),
    ):
        low, high = limits(values)
        at = ticks(low, high)
        implot.setup_axis_scale(axis, implot.Scale_.log10)
        implot.setup_axis_limits(axis, low, high, implot.Cond_.always)
        implot.setup_axis_ticks(axis, at, [f"{value:g}{unit}" for value in at])
    best = front([(mark.ms, mark.error) for mark in behind])
    if best:
        x, y = (np.array([getattr(behind[i], name) for i in best]) for name in ("ms", "error"))
        spec = implot.Spec()
        spec.line_color = imgui.ImVec4(1.0, 1.0, 1.0, 0.3)
        implot.plot_line("front", *_steps(x, y), spec)
    for i, mark in enumerate(every):
        spec = implot.Spec()
        spec.marker, spec.marker_size = implot.Marker_.circle, mark.size
        spec.marker_fill_color = imgui.ImVec4(*mark.colour)
        spec.marker_line_color = imgui.ImVec4(1.0, 1.0, 1.0, 1.0) if mark.size > 6 else spec.marker_fill_color
        implot.plot_scatter(f"##{i}", np.array([mark.ms]), np.array([mark.error]), spec)
    _labels([*marks, *behind])
    implot.end_plot()


def _steps(x: Any, y: Any) -> tuple[Any, Any]:
    """The best error that each time has reached."""
    return np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]


def _labels(marks: Sequence[Mark]) -> None:
    """Each beside its mark where it covers no other one and no mark; where there is no room, nowhere."""
    from imgui_bundle import imgui, implot

    canvas = implot.get_plot_draw_list()
    left, top = implot.get_plot_pos()
    across, down = implot.get_plot_size()
    places = [implot.plot_to_pixels(mark.ms, mark.error) for mark in marks]
    taken = [(p.x - m.size, p.y - m.size, p.x + m.size, p.y + m.size) for p, m in zip(places, marks, strict=True)]
    for place, mark in zip(places, marks, strict=True):
        if not mark.label:
            continue
        width, height = imgui.calc_text_size(mark.label)
        for dx, dy in _OFFSETS:
            x = place.x + dx - (0 if dx > 0 else width if dx < 0 else 0.5 * width)
            box = (x, place.y + dy, x + width, place.y + dy + height)
            inside = left <= box[0] and box[2] <= left + across and top <= box[1] and box[3] <= top + down
            if inside and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                canvas.add_text(box[:2], imgui.get_color_u32((*mark.colour[:3], max(mark.colour[3], 0.6))), mark.label)
                break


def _overlap(a: Any, b: Any) -> bool:
    return bool(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])
