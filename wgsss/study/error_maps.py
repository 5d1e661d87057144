"""Maps of the error as pictures, on one colour scale for all methods."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.study.compare import Comparison
from wgsss.study.metrics import error_map

Array = npt.NDArray[Any]

COLOURS = "magma"
CURVE = 0.5
"""An error takes its colour at (error / end of the scale) ** CURVE, so that small errors are distinguishable too."""
_NICE = (1.0, 1.5, 2.0, 3.0, 5.0, 7.5, 10.0)
_COVERED = 99.5  # per cent of the pixels that the scale must cover


def maps(comparison: Comparison) -> dict[str, Array]:
    """Return the error map (H, W) of each run by name, see `metrics.error_map`."""
    return {run.name: error_map(run.M, comparison.truth.M, comparison.mask) for run in comparison.runs}


def own(comparison: Comparison) -> Array:
    """Return the map (H, W) of the reference's own error, in the same measure."""
    truth = comparison.truth
    return error_map(truth.M + truth.error, truth.M, comparison.mask)


def scale_end(comparison: Comparison) -> float:
    """Return a round number as the end of a scale that covers the errors of all runs except a few pixels."""
    mask = comparison.mask
    most = max((float(np.percentile(values[mask], _COVERED)) for values in maps(comparison).values()), default=0.0)
    if most <= 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(most))
    return float(next(n * decade for n in _NICE if n * decade >= 0.999 * most))


def ticks(end: float) -> list[tuple[float, str]]:
    """Return the ticks of the colour bar: positions from 0 to 1, and the errors at them as text."""
    return [(share**CURVE, f"{100.0 * share * end:.3g} %") for share in (0.0, 1 / 16, 1 / 4, 9 / 16, 1.0)]


def coloured(values: Array, mask: Array, end: float) -> Array:
    """Return a map in colours on a scale up to `end`, uint8 (H, W, 4), transparent outside the mask."""
    import matplotlib

    position = np.power(np.clip(values / end, 0.0, 1.0), CURVE)
    pixels = np.asarray(matplotlib.colormaps[COLOURS](position, bytes=True))
    pixels[..., 3] = np.where(mask, 255, 0)
    return pixels


def colour_bar(width: int = 256) -> Array:
    """Return the colours from no error to the end of the scale, uint8 (1, width, 4)."""
    return coloured(np.linspace(0.0, 1.0, width)[None] ** (1.0 / CURVE), np.ones((1, width), bool), 1.0)


def worst_square(values: Array, mask: Array) -> tuple[int, int, int]:
    """Return the square with the largest mean error: left, top and side. Its side is a quarter of
    the shorter side of the image."""
    height, width = values.shape
    side = max(min(height, width) // 4, 1)
    padded = np.zeros((height + 1, width + 1))
    padded[1:, 1:] = np.where(mask, values, 0.0).cumsum(axis=0).cumsum(axis=1)
    sums = padded[side:, side:] - padded[:-side, side:] - padded[side:, :-side] + padded[:-side, :-side]
    y, x = np.unravel_index(int(np.argmax(sums)), sums.shape)
    return int(x), int(y), side
