"""A comparison's numbers as rows of text, for a terminal and a page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wgsss.study.causes import CAUSES
from wgsss.study.compare import Comparison, Run

HEADINGS = ("method", "rel RMSE", "PSNR", "PSNR all", "bias", "FLIP", "frame", "bake", "memory")


def measures(run: Run) -> dict[str, str]:
    """A run's figures by name, with their units."""
    found = run.errors
    return {
        "rel RMSE": percent(found.rel_rmse),
        "PSNR": decibels(found.psnr),
        "PSNR all": decibels(found.psnr_all),
        "bias": "-" if found.bias is None else f"{found.bias:.3f}",
        "FLIP": flip(found.flip, found.flip_reason),
        "frame": milliseconds(run.frame_ms),
        "bake": milliseconds(run.bake_ms),
        "memory": f"{run.bytes / 2**20:.3g} MiB",
    }


def by_method(comparison: Comparison) -> list[list[str]]:
    """A row for each method, below the headings."""
    return [list(HEADINGS), *([run.name, *measures(run).values()] for run in comparison.runs)]


def by_cause(comparison: Comparison) -> list[list[str]]:
    """What each cause alone would be and, in brackets, what it adds to the whole."""
    rows = [["method", "rel RMSE", *CAUSES]]
    for name, found in comparison.causes.items():
        shares = [f"{percent(found.own[cause])} ({found.part[cause] * 100:+.2g})" for cause in CAUSES]
        rows.append([name, percent(found.total), *shares])
    return rows


def by_light(comparison: Comparison) -> list[list[str]]:
    """rel_rmse of each method under each type of light, and what the reference's own error accounts for."""
    rows = [["method", *comparison.lights]]
    for i, run in enumerate(comparison.runs):
        rows.append([run.name, *(percent(other.runs[i].errors.rel_rmse) for other in comparison.lights.values())])
    floors = [percent(other.runs[0].errors.floor) for other in comparison.lights.values()]
    return [*rows, [f"({comparison.reference})", *floors]]


def floor(comparison: Comparison) -> str:
    """What the reference's own error accounts for."""
    found = comparison.runs[0].errors.floor
    return f"error of {comparison.reference} itself: {percent(found)}"


def percent(value: float | None) -> str:
    return "-" if value is None else f"{value * 100:.3g} %"


def flip(value: float | None, reason: str | None) -> str:
    return f"{value:.3f}" if value is not None else "not installed" if reason else "-"


def decibels(value: float | None) -> str:
    return "-" if value is None else "no error" if math.isinf(value) else f"{value:.1f} dB"


def milliseconds(value: float) -> str:
    return f"{value:.3g} ms" if value < 1000.0 else f"{value / 1000.0:.3g} s"


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Rows of text in columns, one row a line, the numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    )
