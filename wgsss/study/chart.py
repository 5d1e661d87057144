"""Speed against accuracy as a picture: error over frame time, from runs alone. Nothing is rendered here."""

from __future__ import annotations

import math
import textwrap
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wgsss.errors import InputError
from wgsss.output import replacing
from wgsss.text import figure_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Run = dict[str, Any]
Label = tuple[float, float, str, Any]
"""time, error, text and colour"""

FILES = ("chart.svg", "chart.png", "chart.html")
LEAST = 1e-9
"""relative error above which a run is drawn: the axis is logarithmic"""

# Okabe and Ito's colours, which all eyes tell apart, and shapes for prints without: corners, whether a star, degrees.
_COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
_SHAPES = ((40, 0, 0), (4, 0, 45), (3, 0, 0), (4, 0, 0), (3, 0, 180), (5, 1, 0), (6, 0, 0), (4, 1, 0), (5, 0, 0))
# Places in the lists above that stay when methods come and go; those not named here take one by their name.
_PLACES = ("lambert", "deon07", "sam", "jensen02", "jimenez15", "jimenez08", "barre11", "francois06", "oat06")

_INK, _FAINT, _FRONT, _FLOOR = "#333333", "#767676", "#555555", "#EBEBEB"
_LOOK: dict[Any, Any] = {"font.size": 9.5, "svg.hashsalt": "wgsss", "text.color": _INK, "axes.edgecolor": _FAINT}
_COLUMNS = 3
_LONGEST_CAPTION = 2000  # characters
_OFFSETS = (
    *((7, 6), (7, -14), (-7, 6), (-7, -14), (0, 11), (0, -19), (11, -4), (-11, -4)),
    *((16, 14), (-16, -22), (-16, 14), (16, -22), (0, 22), (0, -30), (26, 4), (-26, -12)),
)


@dataclass(frozen=True)
class Panel:
    """The runs that may be compared with one another: of one scene, size, adapter and reference."""

    title: str
    runs: tuple[Run, ...]
    """by method, then by their place in its sweep"""

    @property
    def methods(self) -> list[str]:
        return list(dict.fromkeys(run["method"] for run in self.runs))

    @property
    def floor(self) -> float:
        """The greatest relative error that the reference itself may have."""
        return max(run["floor"] or 0.0 for run in self.runs)


def draw(runs: Sequence[Run], folder: str | Path) -> list[Path]:
    """Write chart.svg, chart.png and chart.html of runs, as `wgsss.study.bench.read` gives them, into a folder.

    Of runs that differ in nothing but date and version, the last one counts. Raises InputError where there is no run,
    or the folder cannot be written.
    """
    import matplotlib

    from wgsss.study.chart_html import page

    found = panels(runs)
    paths = [Path(folder) / name for name in FILES]
    with replacing(*paths) as (svg, png, html), matplotlib.rc_context(_LOOK):
        figure = _figure(found)
        figure.savefig(svg, metadata={"Date": None})
        figure.savefig(png, dpi=150)
        html.write_text(page(found, caption(found)), encoding="utf-8")
    return paths


def panels(runs: Sequence[Run]) -> list[Panel]:
    """Runs by what may be compared. Raises InputError where there are none."""
    if not runs:
        raise InputError("there are no runs to draw")
    groups: dict[tuple[Any, ...], dict[Any, Run]] = {}
    for run in runs:
        group = (run["scene"], tuple(run["size"]), run["adapter"], run["reference"])
        latest = groups.setdefault(group, {})
        key = (run["method"], tuple(sorted(run["knobs"].items())))
        latest.pop(key, None)
        latest[key] = run
    varied = [i for i in range(1, 4) if len({group[i] for group in groups}) > 1]
    says = (str, lambda size: f"{size[0]} x {size[1]}", str, lambda reference: f"against {reference}")
    found = []
    for group, latest in groups.items():
        title = ", ".join([group[0], *(says[i](group[i]) for i in varied)])
        ordered = sorted(latest.values(), key=lambda run: (_place(run["method"]), run["method"], run["step"]))
        found.append(Panel(title, tuple(ordered)))
    return found


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """The Pareto front of (time, error): indices of those that no other one beats, by time; less is better in both.

    One beats another where it is no worse in either and better in one.
    """
    found: list[int] = []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if not found or points[i][1] < points[found[-1]][1] or points[i] == points[found[-1]]:
            found.append(i)
    return found


def style(method: str) -> tuple[str, tuple[int, int, int]]:
    """The colour and the shape of a method's marks, the same in every chart."""
    place = _place(method)
    return _COLOURS[place % len(_COLOURS)], _SHAPES[place % len(_SHAPES)]


def _place(method: str) -> int:
    return (
        _PLACES.index(method)
        if method in _PLACES
        else len(_PLACES) + zlib.crc32(method.encode("utf-8", "surrogatepass")) % 1000
    )


def labels(runs: Sequence[Run]) -> list[str]:
    """What tells the runs of one method apart: the knobs that vary, named at the first."""
    varied = [knob for knob in runs[0]["knobs"] if len({repr(run["knobs"].get(knob)) for run in runs}) > 1]
    found = [", ".join(_number(run["knobs"].get(knob)) for knob in varied) for run in runs]
    if varied:
        found[0] = ", ".join(f"{knob} {_number(runs[0]['knobs'][knob])}" for knob in varied)
    return found


def _words(run: Run) -> tuple[str, ...]:
    """The knobs of a run that are words: along a curve, numbers change."""
    return tuple(value for value in run["knobs"].values() if isinstance(value, str))


def caption(found: Sequence[Panel]) -> str:
    """What the chart shows, where and when it was measured."""
    runs = [run for panel in found for run in panel.runs]

    def all_of(values: Any) -> str:
        return ", ".join(dict.fromkeys(values))

    sizes = [f"{width} x {height}" for width, height in (run["size"] for run in runs)]
    dates = sorted(run["date"][:10] for run in runs)
    when = dates[0] if dates[0] == dates[-1] else f"{dates[0]} to {dates[-1]}"
    return (
        f"Time: all passes of a frame by {all_of(run['clock'] for run in runs)}, median and middle half. "
        f"Error: of M over the object's pixels, against {all_of(run['reference'] for run in runs)}. "
        f"{all_of(run['adapter'] for run in runs)}; "
        f"{all_of(sizes)} pixels; "
        f"wgsss {all_of(run['version'] for run in runs)}; {when}."
    )


def ticks(low: float, high: float) -> list[float]:
    """Round numbers between two positive ones, few enough to be read."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for mantissas in ((1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9), (1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,)):
        found = [m * 10.0**decade for decade in decades for m in mantissas if low <= m * 10.0**decade <= high]
        if len(found) <= 7:
            break
    return found


def _figure(found: Sequence[Panel]) -> Any:
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine
    from matplotlib.lines import Line2D

    columns = min(len(found), _COLUMNS)
    rows = -(-len(found) // columns)
    size = (max(5.0 * columns, 6.4), 4.4 * rows + 1.2)
    text = textwrap.fill(figure_text(caption(found), _LONGEST_CAPTION), round(15.5 * size[0]))
    below = (0.22 + 0.15 * text.count("\n")) / size[1]
    layout = ConstrainedLayoutEngine(rect=(0.0, below, 1.0, 1.0 - below), w_pad=0.08, h_pad=0.08)
    figure = Figure(figsize=size, layout=layout, facecolor="white")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(found) :]:
        axis.set_axis_off()
    placed = [(axis, _panel(axis, panel)) for axis, panel in zip(axes, found, strict=False)]
    methods = sorted({method for panel in found for method in panel.methods}, key=lambda m: (_place(m), m))
    keys = [_mark(style(method), True) for method in methods]
    handles = [
        Line2D([], [], ls="--", lw=1.2, label=figure_text(m), **key) for m, key in zip(methods, keys, strict=True)
    ]
    handles.append(Line2D([], [], color=_FRONT, lw=1.8, label="best for its time"))
    figure.legend(handles=handles, loc="outside upper left", ncols=min(len(handles), 2 + 3 * columns), frameon=False)
    figure.text(0.1 / size[0], 0.08 / size[1], text, fontsize=8, color=_FAINT)
    figure.draw_without_rendering()  # settles the layout, which the labels need to know
    figure.set_layout_engine("none")
    for axis, wanted in placed:
        _place_labels(axis, wanted)
    return figure


def _mark(kind: tuple[str, tuple[int, int, int]], best: bool) -> dict[str, Any]:
    colour, shape = kind
    edge = {"markerfacecolor": colour, "markeredgecolor": "white", "markeredgewidth": 0.8}
    hollow = {"markerfacecolor": "white", "markeredgecolor": colour, "markeredgewidth": 1.2}
    return {"color": colour, "marker": shape, "markersize": 9 if best else 7, **(edge if best else hollow)}


def _panel(axis: Axes, panel: Panel) -> list[Label]:
    """Draw the marks, and give back the labels that they want."""
    shown = [run for run in panel.runs if (run["error"]["rel_rmse"] or 0.0) > LEAST]
    points = [(run["frame_ms"], 100.0 * run["error"]["rel_rmse"]) for run in shown]
    if points:
        _scales(axis, shown, points, 100.0 * panel.floor)
    best = front(points)
    if best:
        x, y = zip(*(points[i] for i in best), strict=True)
        ends = axis.get_xlim()[1], axis.get_ylim()[1]
        axis.plot((x[0], *x, ends[0]), (ends[1], *y, y[-1]), color=_FRONT, lw=1.8, drawstyle="steps-post", zorder=2)
    wanted = []
    for method in dict.fromkeys(run["method"] for run in shown):
        own = [i for i, run in enumerate(shown) if run["method"] == method]
        colour = style(method)[0]
        for words in dict.fromkeys(_words(shown[i]) for i in own):
            curve = [points[i] for i in own if _words(shown[i]) == words]
            axis.plot(*zip(*curve, strict=True), "--", color=colour, lw=1.2, alpha=0.45, zorder=3)
        for i in own:
            axis.plot(shown[i]["frame_ms_quartiles"], [points[i][1]] * 2, color=colour, lw=1.0, alpha=0.6, zorder=3)
            axis.plot(*points[i], **_mark(style(method), i in best), zorder=5 if i in best else 4)
        texts = labels([shown[i] for i in own])
        wanted += [(*points[i], text, _dark(colour)) for i, text in zip(own, texts, strict=True)]
    axis.set_title(figure_text(panel.title), loc="left", fontweight="bold", fontsize=11)
    axis.set_xlabel("frame time, ms")
    axis.set_ylabel("relative RMSE of M")
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(color="#E5E5E5", lw=0.6)
    axis.set_axisbelow(True)
    return wanted


def _scales(axis: Axes, shown: Sequence[Run], points: Sequence[tuple[float, float]], floor: float) -> None:
    """Logarithmic axes around all points, and the band below which the reference itself is no better."""
    times = [t for run in shown for t in run["frame_ms_quartiles"]] + [x for x, _ in points]
    errors = [y for _, y in points] + ([floor] if floor > LEAST else [])
    for one, values, unit in ((axis.xaxis, times, ""), (axis.yaxis, errors, " %")):
        spread = max(math.log10(max(values) / min(values)), 0.5)
        low, high = min(values) * 10.0 ** (-0.1 * spread), max(values) * 10.0 ** (0.1 * spread)
        one.axes.set(**{f"{one.axis_name}scale": "log", f"{one.axis_name}lim": (low, high)})
        at = ticks(low, high)
        one.set_ticks(at, [f"{value:g}{unit}" for value in at])
        one.set_ticks([], minor=True)
    if floor > LEAST:
        axis.axhspan(axis.get_ylim()[0], floor, color=_FLOOR, lw=0, zorder=0)
        corner: dict[str, Any] = {"xytext": (4, 4), "textcoords": "offset points", "fontsize": 8, "color": _FAINT}
        axis.annotate("the reference's own error", (axis.get_xlim()[0], axis.get_ylim()[0]), **corner)


def _place_labels(axis: Axes, wanted: Sequence[Label]) -> None:
    """Write each label beside its mark where it covers no other and no mark; where there is no room, nowhere."""
    from matplotlib.patheffects import withStroke

    frame = axis.get_window_extent()
    scale = axis.figure.dpi / 72.0
    marks = [axis.transData.transform((x, y)) for x, y, *_ in wanted]
    taken: list[Any] = [(x - 5 * scale, y - 5 * scale, x + 5 * scale, y + 5 * scale) for x, y in marks]
    for x, y, text, colour in wanted:
        for dx, dy in _OFFSETS if text else ():
            side = "left" if dx > 0 else "right" if dx < 0 else "center"
            look: dict[str, Any] = {"ha": side, "fontsize": 8, "color": colour, "zorder": 6}
            look["path_effects"] = [withStroke(linewidth=2.5, foreground="white")]
            label = axis.annotate(figure_text(text), (x, y), xytext=(dx, dy), textcoords="offset points", **look)
            box = label.get_window_extent().extents
            inside = frame.x0 <= box[0] and box[2] <= frame.x1 and frame.y0 <= box[1] and box[3] <= frame.y1
            if inside and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                break
            label.remove()


def _overlap(a: Any, b: Any) -> bool:
    return bool(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])


def _dark(colour: str) -> tuple[float, ...]:
    """As dark as text must be."""
    from matplotlib.colors import to_rgb

    return tuple(0.7 * channel for channel in to_rgb(colour))


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
