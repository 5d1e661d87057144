"""Speed against accuracy as a page that needs no network. It shows the figures of the run under the pointer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wgsss.study import html_page, scatter
from wgsss.study.scatter import Panel

_SHOWN = ("method", "bake_ms", "bake_cached", "frame_ms", "frame_ms_quartiles", "frames", "passes", "bytes")
_ABOUT = ("error", "floor", "version", "date")


def page(panels: Sequence[Panel]) -> str:
    """Return the page as HTML, with all its data inside.

    A reader can hide methods and choose another error, so that `chart.js` repeats the front, the ends of the axes and
    the ticks of `scatter`.
    """
    methods = dict.fromkeys(method for panel in panels for method in panel.methods)
    data = {
        "caption": scatter.caption(panels),
        "methods": {method: scatter.style(method)._asdict() for method in methods},
        "panels": [{"title": panel.title, "floor": panel.floor, "runs": _runs(panel)} for panel in panels],
        "names": {"time": scatter.TIME_NAME, "error": scatter.ERROR_NAME, "floor": scatter.FLOOR_NAME},
        "axis": {
            "mantissas": scatter.MANTISSAS,
            "mostTicks": scatter.MOST_TICKS,
            "margin": scatter.MARGIN,
            "leastMargin": scatter.LEAST_MARGIN,
        },
    }
    return html_page.fill("chart", data)


def _runs(panel: Panel) -> list[dict[str, Any]]:
    return [
        {
            **{name: value for name, value in run.items() if name in (*_SHOWN, *_ABOUT)},
            "label": label,
            "setting": scatter.setting_text(run["method"], run["knobs"]),
            "curve": " ".join([run["method"], *scatter.curve_of(run)]),
        }
        for run, label in zip(panel.runs, scatter.labels(panel.runs), strict=True)
    ]
