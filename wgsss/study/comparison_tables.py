"""The numbers of a comparison as rows of text, for a terminal and for a page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wgsss.study.causes import CAUSES
from wgsss.study.compare import Comparison, Run

HEADINGS = ("method", "rel RMSE", "PSNR", "PSNR all", "bias", "FLIP", "frame", "bake", "memory")


def measures(run: Run) -> dict[str, str]:
    """Return the figures of a run by name, with their units."""
    errors = run.errors
    return {
        "rel RMSE": percent(errors.rel_rmse),
        "PSNR": decibels(errors.psnr),
        "PSNR all": decibels(errors.psnr_all),
        "bias": "-" if errors.bias is None else f"{errors.bias:.3f}",
        "FLIP": flip(errors.flip, errors.flip_reason),
        "frame": milliseconds(run.frame_ms),
        "bake": milliseconds(run.bake_ms),
        "memory": f"{run.bytes / 2**20:.3g} MiB",
    }


def by_method(comparison: Comparison) -> list[list[str]]:
    """Return the headings, and a row for each method."""
    return [list(HEADINGS), *([run.name, *measures(run).values()] for run in comparison.runs)]


def by_cause(comparison: Comparison) -> list[list[str]]:
    """Return a row for each method: the error of each cause alone and, in brackets, its part of the whole."""
    rows = [["method", "rel RMSE", *CAUSES]]
    for name, causes in comparison.causes.items():
        shares = [f"{percent(causes.own[cause])} ({causes.part[cause] * 100:+.2g})" for cause in CAUSES]
        rows.append([name, percent(causes.total), *shares])
    return rows


def by_light(comparison: Comparison) -> list[list[str]]:
    """Return the rel_rmse of each method under each type of light, and a last row for the reference's own error."""
    rows = [["method", *comparison.lights]]
    for i, run in enumerate(comparison.runs):
        rows.append([run.name, *(percent(other.runs[i].errors.rel_rmse) for other in comparison.lights.values())])
    floors = [percent(other.runs[0].errors.floor) for other in comparison.lights.values()]
    return [*rows, [f"({comparison.reference})", *floors]]


def floor(comparison: Comparison) -> str:
    """Return a sentence about the rel_rmse that the reference's own error accounts for."""
    return f"error of {comparison.reference} itself: {percent(comparison.runs[0].errors.floor)}"


def percent(value: float | None) -> str:
    return "-" if value is None else f"{value * 100:.3g} %"


def flip(value: float | None, reason: str | None) -> str:
    return f"{value:.3f}" if value is not None else "not installed" if reason else "-"


def decibels(value: float | None) -> str:
    return "-" if value is None else "no error" if math.isinf(value) else f"{value:.1f} dB"


def milliseconds(value: float) -> str:
    return f"{value:.3g} ms" if value < 1000.0 else f"{value / 1000.0:.3g} s"


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Format rows as lines of aligned columns: the first column to the left, numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    )
