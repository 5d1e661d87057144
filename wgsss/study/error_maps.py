"""Maps of error as pictures, on one scale for all methods."""

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
"""the exponent that takes an error to its place on the colour bar: small errors are told apart too"""
_NICE = (1.0, 1.5, 2.0, 3.0, 5.0, 7.5, 10.0)
_COVERED = 99.5  # per cent of the pixels that the scale is to hold


def maps(comparison: Comparison) -> dict[str, Array]:
    """Each run's error (H, W), see `metrics.error_map`."""
    return {run.name: error_map(run.M, comparison.truth.M, comparison.seen) for run in comparison.runs}


def own(comparison: Comparison) -> Array:
    """The reference's own error (H, W), in the same measure."""
    truth = comparison.truth
    return error_map(truth.M + truth.error, truth.M, comparison.seen)


def top(comparison: Comparison) -> float:
    """The end of a scale that holds the errors of all runs, but for a few pixels: a number that reads well."""
    seen = comparison.seen
    most = max((float(np.percentile(values[seen], _COVERED)) for values in maps(comparison).values()), default=0.0)
    if most <= 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(most))
    return float(next(n * decade for n in _NICE if n * decade >= 0.999 * most))


def ticks(end: float) -> list[tuple[float, str]]:
    """What to mark on the colour bar: places from 0 to 1, and the errors there."""
    return [(share**CURVE, f"{100.0 * share * end:.3g} %") for share in (0.0, 1 / 16, 1 / 4, 9 / 16, 1.0)]


def coloured(values: Array, seen: Array, end: float) -> Array:
    """uint8 (H, W, 4): a map on a scale up to `end`, transparent where nothing is seen."""
    import matplotlib

    place = np.power(np.clip(values / end, 0.0, 1.0), CURVE)
    pixels = np.asarray(matplotlib.colormaps[COLOURS](place, bytes=True))
    pixels[..., 3] = np.where(seen, 255, 0)
    return pixels


def bar(width: int = 256) -> Array:
    """uint8 (1, width, 4): the colours from no error to the end of the scale."""
    return coloured(np.linspace(0.0, 1.0, width)[None] ** (1.0 / CURVE), np.ones((1, width), bool), 1.0)


def worst(values: Array, seen: Array) -> tuple[int, int, int]:
    """Left, top and side of the square, a quarter as high as the image, whose mean error is the greatest."""
    height, width = values.shape
    side = max(min(height, width) // 4, 1)
    padded = np.zeros((height + 1, width + 1))
    padded[1:, 1:] = np.where(seen, values, 0.0).cumsum(axis=0).cumsum(axis=1)
    sums = padded[side:, side:] - padded[:-side, side:] - padded[side:, :-side] + padded[:-side, :-side]
    y, x = np.unravel_index(int(np.argmax(sums)), sums.shape)
    return int(x), int(y), side
