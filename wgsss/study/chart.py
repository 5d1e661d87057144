"""Speed against accuracy as a picture: error over frame time, drawn from recorded runs. Nothing is rendered here."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wgsss.output import replacing
from wgsss.study import chart_html
from wgsss.study.run_record import Run
from wgsss.study.scatter import (
    ERROR_NAME,
    FLOOR_NAME,
    LEAST_ERROR,
    TIME_NAME,
    Box,
    Panel,
    Point,
    Style,
    axis_limits,
    caption,
    is_free,
    method_order,
    panels,
    pareto_front,
    style,
    ticks,
)
from wgsss.text import figure_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILES = ("chart.svg", "chart.png", "chart.html")

_INK, _FAINT, _FRONT, _FLOOR = "#333333", "#767676", "#555555", "#EBEBEB"
_LOOK: dict[Any, Any] = {"font.size": 9.5, "svg.hashsalt": "wgsss", "text.color": _INK, "axes.edgecolor": _FAINT}
_COLUMNS = 3
_LONGEST_CAPTION = 2000  # characters
# Positions of a label relative to its point, in the order in which they are tried. In typographic points.
_OFFSETS = (
    *((7, 6), (7, -14), (-7, 6), (-7, -14), (0, 11), (0, -19), (11, -4), (-11, -4)),
    *((16, 14), (-16, -22), (-16, 14), (16, -22), (0, 22), (0, -30), (26, 4), (-26, -12)),
)


def draw(runs: Sequence[Run], folder: str | Path) -> list[Path]:
    """Write chart.svg, chart.png and chart.html of runs into a folder, and return the files.

    Of runs that differ only in date and version, the last one counts. Raises InputError if there are no runs, or if
    the folder cannot be written.
    """
    import matplotlib

    groups = panels(runs)
    paths = [Path(folder) / name for name in FILES]
    with replacing(*paths) as (svg, png, html), matplotlib.rc_context(_LOOK):
        figure = _figure(groups)
        figure.savefig(svg, metadata={"Date": None})
        figure.savefig(png, dpi=150)
        html.write_text(chart_html.page(groups), encoding="utf-8")
    return paths


def _figure(groups: Sequence[Panel]) -> Figure:
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine
    from matplotlib.lines import Line2D

    columns = min(len(groups), _COLUMNS)
    rows = -(-len(groups) // columns)
    size = (max(5.0 * columns, 6.4), 4.4 * rows + 1.2)
    text = textwrap.fill(figure_text(caption(groups), _LONGEST_CAPTION), round(15.5 * size[0]))
    below = (0.22 + 0.15 * text.count("\n")) / size[1]
    layout = ConstrainedLayoutEngine(rect=(0.0, below, 1.0, 1.0 - below), w_pad=0.08, h_pad=0.08)
    figure = Figure(figsize=size, layout=layout, facecolor="white")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(groups) :]:
        axis.set_axis_off()
    for axis, panel in zip(axes, groups, strict=False):
        _draw_panel(axis, panel)
    methods = sorted({method for panel in groups for method in panel.methods}, key=method_order)
    handles = [
        Line2D([], [], ls="--", lw=1.2, label=figure_text(method), **_marker(style(method), is_best=True))
        for method in methods
    ]
    handles.append(Line2D([], [], color=_FRONT, lw=1.8, label="Pareto front"))
    figure.legend(handles=handles, loc="outside upper left", ncols=min(len(handles), 2 + 3 * columns), frameon=False)
    figure.text(0.1 / size[0], 0.08 / size[1], text, fontsize=8, color=_FAINT)
    figure.draw_without_rendering()  # settles the layout, which the labels need to know
    figure.set_layout_engine("none")
    for axis, panel in zip(axes, groups, strict=False):
        _write_labels(axis, panel.points)
    return figure


def _marker(look: Style, is_best: bool) -> dict[str, Any]:
    colour, shape = look
    edge = {"markerfacecolor": colour, "markeredgecolor": "white", "markeredgewidth": 0.8}
    hollow = {"markerfacecolor": "white", "markeredgecolor": colour, "markeredgewidth": 1.2}
    return {"color": colour, "marker": shape, "markersize": 9 if is_best else 7, **(edge if is_best else hollow)}


def _position(point: Point) -> tuple[float, float]:
    """Return a point in the coordinates of the axes: ms and per cent."""
    return point.time_ms, 100.0 * point.error


def _draw_panel(axis: Axes, panel: Panel) -> None:
    """Draw the axes, the front, the curves and the points of a panel."""
    points = panel.points
    positions = [_position(point) for point in points]
    if points:
        _set_scales(axis, points, 100.0 * panel.floor)
    best = pareto_front(positions)
    if best:
        x, y = zip(*(positions[i] for i in best), strict=True)
        ends = axis.get_xlim()[1], axis.get_ylim()[1]
        axis.plot((x[0], *x, ends[0]), (ends[1], *y, y[-1]), color=_FRONT, lw=1.8, drawstyle="steps-post", zorder=2)
    for method in dict.fromkeys(point.method for point in points):
        own = [i for i, point in enumerate(points) if point.method == method]
        colour = style(method).colour
        for curve in dict.fromkeys(points[i].curve for i in own):
            line = [positions[i] for i in own if points[i].curve == curve]
            axis.plot(*zip(*line, strict=True), "--", color=colour, lw=1.2, alpha=0.45, zorder=3)
        for i in own:
            quartiles = points[i].quartiles_ms or ()
            axis.plot(quartiles, [positions[i][1]] * len(quartiles), color=colour, lw=1.0, alpha=0.6, zorder=3)
            axis.plot(*positions[i], **_marker(style(method), i in best), zorder=5 if i in best else 4)
    axis.set_title(figure_text(panel.title), loc="left", fontweight="bold", fontsize=11)
    axis.set_xlabel(TIME_NAME)
    axis.set_ylabel(ERROR_NAME)
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(color="#E5E5E5", lw=0.6)
    axis.set_axisbelow(True)


def _set_scales(axis: Axes, points: Sequence[Point], floor: float) -> None:
    """Set logarithmic axes that show all points, and shade the errors below `floor` per cent."""
    times = [ms for point in points for ms in (*(point.quartiles_ms or ()), point.time_ms)]
    is_shaded = floor > LEAST_ERROR
    errors = [_position(point)[1] for point in points] + ([floor] if is_shaded else [])
    for one, values, unit in ((axis.xaxis, times, ""), (axis.yaxis, errors, " %")):
        low, high = axis_limits(values)
        one.axes.set(**{f"{one.axis_name}scale": "log", f"{one.axis_name}lim": (low, high)})
        at = ticks(low, high)
        one.set_ticks(at, [f"{value:g}{unit}" for value in at])
        one.set_ticks([], minor=True)
    if is_shaded:
        axis.axhspan(axis.get_ylim()[0], floor, color=_FLOOR, lw=0, zorder=0)
        corner: dict[str, Any] = {"xytext": (4, 4), "textcoords": "offset points", "fontsize": 8, "color": _FAINT}
        axis.annotate(FLOOR_NAME, (axis.get_xlim()[0], axis.get_ylim()[0]), **corner)


def _write_labels(axis: Axes, points: Sequence[Point]) -> None:
    """Write each label beside its point where it covers no other label and no point.

    A label is left out if there is no room for it.
    """
    from matplotlib.patheffects import withStroke

    window = axis.get_window_extent()
    frame = (window.x0, window.y0, window.x1, window.y1)
    radius = 5 * axis.figure.dpi / 72.0
    pixels = [axis.transData.transform(_position(point)) for point in points]
    taken: list[Box] = [(x - radius, y - radius, x + radius, y + radius) for x, y in pixels]
    for point in points:
        for dx, dy in _OFFSETS if point.label else ():
            side = "left" if dx > 0 else "right" if dx < 0 else "center"
            look: dict[str, Any] = {
                "ha": side,
                "fontsize": 8,
                "color": _darkened(style(point.method).colour),
                "zorder": 6,
            }
            look["path_effects"] = [withStroke(linewidth=2.5, foreground="white")]
            text = figure_text(point.label)
            label = axis.annotate(text, _position(point), xytext=(dx, dy), textcoords="offset points", **look)
            left, bottom, right, top = label.get_window_extent().extents
            box = (left, bottom, right, top)
            if is_free(box, frame, taken):
                taken.append(box)
                break
            label.remove()


def _darkened(colour: str) -> tuple[float, ...]:
    """Darken a colour so that text in it is readable on white."""
    from matplotlib.colors import to_rgb

    return tuple(0.7 * channel for channel in to_rgb(colour))
