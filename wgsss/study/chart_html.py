"""Speed against accuracy as a page that needs no network: every run's figures where the pointer is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from wgsss.study import page as pages

if TYPE_CHECKING:
    from wgsss.study.chart import Panel

_SHOWN = ("method", "knobs", "bake_ms", "bake_cached", "frame_ms", "frame_ms_quartiles", "frames", "passes", "bytes")
_ABOUT = ("error", "floor", "version", "date")


def page(panels: Sequence[Panel], caption: str) -> str:
    """The page as HTML, with everything that it shows inside."""
    from wgsss.study.chart import style

    methods = dict.fromkeys(method for panel in panels for method in panel.methods)
    data = {
        "caption": caption,
        "methods": {method: dict(zip(("colour", "shape"), style(method), strict=True)) for method in methods},
        "panels": [{"title": panel.title, "floor": panel.floor, "runs": _runs(panel)} for panel in panels],
    }
    return pages.page("chart", data)


def _runs(panel: Panel) -> list[dict[str, Any]]:
    from wgsss.study.chart import labels

    found = []
    for method in panel.methods:
        own = [run for run in panel.runs if run["method"] == method]
        for run, label in zip(own, labels(own), strict=True):
            found.append({**{name: run[name] for name in (*_SHOWN, *_ABOUT)}, "label": label})
    return found
