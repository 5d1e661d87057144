"""All methods on one page: their pictures, where they err, and where each errs most beside the reference there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss.study import error_maps
from wgsss.study.compare import Comparison, Run
from wgsss.study.metrics import over_black
from wgsss.study.tables import measures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[Any]

_PAPER, _INK, _FAINT, _MARK = "#16161a", "#f2f2f4", "#a0a0aa", "#5fd0ff"
_CELL = 2.6  # inches


def draw(comparison: Comparison, path: Path) -> None:
    """Write the sheet, a PNG: a row for each method, below the reference's."""
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

    rows, aspect = len(comparison.runs), comparison.size[0] / comparison.size[1]
    wide = _CELL * min(max(aspect, 0.6), 2.2)
    width, height = 1.75 + 2 * wide + 2 * _CELL, 0.62 + rows * (wide / aspect + 0.12) + 0.75
    figure = Figure(figsize=(width, height), facecolor=_PAPER)
    grid = GridSpec(
        rows,
        5,
        figure,
        left=0.02,
        right=0.99,
        top=1 - 0.80 / height,
        bottom=0.62 / height,
        wspace=0.04,
        hspace=0.05,
        width_ratios=[1.55, wide, wide, _CELL, _CELL],
    )
    end, found = error_maps.top([comparison]), error_maps.maps(comparison)
    for row, run in enumerate(comparison.runs):
        axes = [figure.add_subplot(grid[row, column]) for column in range(5)]
        _row(axes, comparison, run, found[run.name], end)
        if row == 0:
            for axis, text in zip(axes[1:], _headings(comparison), strict=True):
                axis.set_title(text, color=_FAINT, fontsize=9.5)
    title = f"{comparison.scene} against {comparison.reference}"
    figure.text(0.02, 1 - 0.16 / height, title, color=_INK, fontsize=15, va="top", weight="bold")
    caption = f"{comparison.size[0]} x {comparison.size[1]}, {comparison.adapter}"
    figure.text(0.99, 1 - 0.2 / height, caption, color=_FAINT, fontsize=9, va="top", ha="right")
    _colour_bar(figure.add_axes((0.36, 0.40 / height, 0.44, 0.12 / height)), end)
    figure.savefig(path, dpi=120, facecolor=_PAPER, format="png")


def _headings(comparison: Comparison) -> tuple[str, ...]:
    return "picture", "error", "where it errs most", f"{comparison.reference} there"


def _row(axes: list[Axes], comparison: Comparison, run: Run, error: Array, end: float) -> None:
    from matplotlib.patches import Rectangle

    x, y, side = error_maps.worst(error, comparison.seen)
    crop = np.s_[y : y + side, x : x + side]
    picture, truth = over_black(run.image.display), over_black(comparison.image.display)
    shown = (picture, over_black(error_maps.coloured(error, comparison.seen, end)), picture[crop], truth[crop])
    for axis, pixels in zip(axes[1:], shown, strict=True):
        axis.imshow(pixels, interpolation="nearest" if pixels.shape[0] < 200 else "auto")
    for axis in axes:
        axis.set_xticks([])
        axis.set_yticks([])
        for spine in axis.spines.values():
            spine.set_visible(False)
    for axis in axes[1:3]:
        axis.add_patch(Rectangle((x - 0.5, y - 0.5), side, side, fill=False, lw=1.0, edgecolor=_MARK))
    axes[0].set_facecolor(_PAPER)
    axes[0].text(0.0, 0.93, run.name.replace(" ", "\n"), color=_INK, fontsize=13, weight="bold", va="top")
    lines = "\n".join(f"{name:<9}{value}" for name, value in measures(run).items())
    axes[0].text(0.0, 0.07, lines, color=_FAINT, fontsize=8.5, va="bottom", family="monospace", linespacing=1.5)


def _colour_bar(axis: Axes, end: float) -> None:
    axis.imshow(error_maps.bar(), aspect="auto", extent=(0.0, 1.0, 0.0, 1.0))
    ticks = error_maps.ticks(end)
    axis.set_xticks([(t / end) ** error_maps.CURVE for t in ticks], [f"{t:.3g}" for t in ticks])
    axis.set_yticks([])
    axis.tick_params(colors=_FAINT, labelsize=8, length=2)
    axis.set_title(
        "luminance of |M - reference|, over the reference's root mean square", color=_FAINT, fontsize=9, pad=4
    )
