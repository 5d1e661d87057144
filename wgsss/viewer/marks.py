"""What the chart of speed against accuracy shows: the two sides, what was measured before, and a bench."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wgsss.study.run_record import Run
from wgsss.study.scatter import LEAST_ERROR, style
from wgsss.viewer.trail import Point, label_of, words

if TYPE_CHECKING:
    from wgsss.methods import Method

FAINTEST = 0.35
"""opacity of the first point of a session, where the last has 1"""
BENCH = 0.4
"""opacity of a bench's runs"""
RADII = 7.0, 4.0, 3.0
"""logical pixels: of a side as it is, of what was measured before, of a bench"""


@dataclass(frozen=True)
class Mark:
    """Something measured."""

    ms: float
    error: float
    """percent"""
    about: str
    label: str
    """written beside it, where there is room"""
    colour: tuple[float, float, float, float]
    radius: float
    letter: str = ""
    """written on it"""


def session(points: Sequence[Point], methods: Sequence[Method]) -> list[Mark]:
    """The points of a session, the first measured first: the sides as they are last, and so on top."""
    labels = [label_of(method) for method in methods]
    before: list[Mark] = []
    now: list[Mark] = []
    for age, point in enumerate(reversed(points)):
        letter = "".join(side for side, label in zip("LR", labels, strict=True) if label == point.label)
        opacity = 1.0 if letter else 1.0 - (1.0 - FAINTEST) * age / max(len(points) - 1, 1)
        radius = RADII[not letter] * (1.5 if len(letter) > 1 else 1.0)
        found = point.ms, 100 * point.rel_rmse, point.label, point.label, colour(point.method, opacity), radius, letter
        (now if letter else before).append(Mark(*found))
    return [*reversed(before), *now]


def bench(runs: Sequence[Run]) -> list[Mark]:
    """A bench's runs, each method labelled where it is most accurate."""
    drawn = (run for run in runs if (run["error"]["rel_rmse"] or 0.0) > LEAST_ERROR)
    seen = sorted(drawn, key=lambda run: -(run["error"]["rel_rmse"] or 0.0))
    best = {run["method"]: run for run in seen}
    return [
        Mark(
            run["frame_ms"],
            100 * (run["error"]["rel_rmse"] or 0.0),
            words(run["method"], run["knobs"]),
            run["method"] if best[run["method"]] is run else "",
            colour(run["method"], BENCH),
            RADII[2],
        )
        for run in seen
    ]


def colour(method: str, opacity: float) -> tuple[float, float, float, float]:
    """That of the method in all charts; black is white here."""
    text = style(method)[0]
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return (red, green, blue, opacity) if red + green + blue > 0 else (1.0, 1.0, 1.0, opacity)


def limits(values: Sequence[float]) -> tuple[float, float]:
    """Of a logarithmic axis with room round all values: half a decade at least."""
    low, high = np.log10(min(values)), np.log10(max(values))
    room = max(0.1 * (high - low), 0.25 - 0.5 * (high - low), 0.08)
    return float(10 ** (low - room)), float(10 ** (high + room))
