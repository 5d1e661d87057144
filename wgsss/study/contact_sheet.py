"""A contact sheet: for each method the picture, the error map, and the worst square beside the reference."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss.study import comparison_tables, error_maps
from wgsss.study.compare import Comparison, Run
from wgsss.text import figure_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[Any]

_PAPER, _BEHIND, _INK, _FAINT, _MARK = "#16161a", "#2b2b31", "#f2f2f4", "#a0a0aa", "#5fd0ff"
# Inches. A row is at least as high as its text.
_CELL, _LEAST_HEIGHT, _GAP, _EDGE, _HEAD, _TEXT = 2.7, 1.9, 0.1, 0.25, 0.62, 1.65


def draw(comparison: Comparison, path: Path) -> None:
    """Write the sheet as a PNG: a row for the reference with its own error, and a row for each method."""
    from matplotlib.figure import Figure

    aspect = comparison.size[0] / comparison.size[1]
    row_height = max(_CELL / max(aspect, 1.0), _LEAST_HEIGHT)
    picture_width = row_height * aspect
    columns = [_TEXT, picture_width, picture_width, row_height, row_height]
    width = sum(columns) + 4 * _GAP + 2 * _EDGE
    height = _HEAD + (len(comparison.runs) + 1) * (row_height + _GAP) + 0.25 + _EDGE
    figure = Figure(figsize=(width, height), facecolor=_PAPER)

    def axes(row: int) -> list[Axes]:
        lefts = _EDGE + np.cumsum([0.0, *columns[:-1]]) + _GAP * np.arange(5)
        bottom = height - _HEAD - row_height - row * (row_height + _GAP) - (0.25 if row else 0.0)
        return [
            figure.add_axes((left / width, bottom / height, cell_width / width, row_height / height))
            for left, cell_width in zip(lefts, columns, strict=True)
        ]

    end, maps = error_maps.scale_end(comparison), error_maps.maps(comparison)
    _draw_reference(axes(0), comparison, end)
    for row, run in enumerate(comparison.runs, start=1):
        _draw_method(axes(row), comparison, run, maps[run.name], end, has_titles=row == 1)
    _write_heading(figure, comparison, width, height)
    figure.savefig(path, dpi=120, facecolor=_PAPER, format="png")


def _write_heading(figure: Figure, comparison: Comparison, width: float, height: float) -> None:
    title = f"{comparison.scene} against {comparison.reference}"
    figure.text(_EDGE / width, 1 - 0.2 / height, figure_text(title), color=_INK, fontsize=15, va="top", weight="bold")
    caption = f"{comparison.size[0]} x {comparison.size[1]}, {comparison.adapter}"
    figure.text(
        1 - _EDGE / width, 1 - 0.25 / height, figure_text(caption), color=_FAINT, fontsize=8.5, va="top", ha="right"
    )


def _draw_reference(axes: list[Axes], comparison: Comparison, end: float) -> None:
    own = error_maps.coloured(error_maps.own(comparison), comparison.mask, end)
    _write_label(
        axes[0], comparison.reference, {"rel RMSE": comparison_tables.percent(comparison.runs[0].errors.floor)}
    )
    _show(axes[1], comparison.image.display)
    _show(axes[2], own)
    axes[1].set_title("picture", color=_FAINT, fontsize=9, pad=4)
    axes[2].set_title("its own error", color=_FAINT, fontsize=9, pad=4)
    for axis in axes[3:]:
        axis.set_axis_off()
    bar = axes[3].figure.add_axes(_between(axes[3], axes[4]))
    bar.imshow(error_maps.colour_bar(), aspect="auto", extent=(0.0, 1.0, 0.0, 1.0))
    bar.set_xticks(*map(list, zip(*error_maps.ticks(end), strict=True)))
    bar.set_yticks([])
    bar.tick_params(colors=_FAINT, labelsize=8, length=2)
    text = "error: luminance of |M - reference|\nover the root mean square of the reference"
    bar.set_title(text, color=_FAINT, fontsize=9, pad=6, loc="left")


def _between(left: Axes, right: Axes) -> tuple[float, float, float, float]:
    """Return a rectangle for the colour bar across two cells."""
    one, other = left.get_position(), right.get_position()
    span = other.x1 - one.x0
    return one.x0 + 0.06 * span, one.y0 + 0.42 * one.height, 0.88 * span, 0.06 * one.height


def _draw_method(
    axes: list[Axes], comparison: Comparison, run: Run, error: Array, end: float, has_titles: bool
) -> None:
    from matplotlib.patches import Rectangle

    x, y, side = error_maps.worst_square(error, comparison.mask)
    crop = np.s_[y : y + side, x : x + side]
    _write_label(axes[0], run.name, comparison_tables.measures(run))
    _show(axes[1], run.image.display)
    _show(axes[2], error_maps.coloured(error, comparison.mask, end))
    _show(axes[3], run.image.display[crop])
    _show(axes[4], comparison.image.display[crop])
    for axis in axes[1:3]:
        axis.add_patch(Rectangle((x - 0.5, y - 0.5), side, side, fill=False, lw=1.0, edgecolor=_MARK))
    if has_titles:
        titles = ("picture", "error", "largest error", f"{comparison.reference} there")
        for axis, title in zip(axes[1:], titles, strict=True):
            axis.set_title(title, color=_FAINT, fontsize=9, pad=4)


def _write_label(axis: Axes, name: str, lines: dict[str, str]) -> None:
    axis.set_axis_off()
    axis.text(0.0, 1.0, "\n".join(map(figure_text, name.split())), color=_INK, fontsize=13, weight="bold", va="top")
    text = "\n".join(f"{key:<9}{value}" for key, value in lines.items())
    axis.text(0.0, 0.0, text, color=_FAINT, fontsize=8, va="bottom", family="monospace", linespacing=1.5)


def _show(axis: Axes, pixels: Array) -> None:
    axis.imshow(pixels, interpolation="nearest")
    axis.set_facecolor(_BEHIND)
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_visible(False)
