"""Profiles given as a table, which was measured or computed elsewhere."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError
from wgsss.optics.medium import CHANNELS, LONGEST, MOST_TOTAL
from wgsss.optics.profile import Profile, distances, shares
from wgsss.text import shown, span
from wgsss.userfiles import read_text
from wgsss.values import array_of

Array = NDArray[np.float64]

_COLUMNS = ("r", *(f"R of {channel}" for channel in CHANNELS))

# R^(1/16) is interpolated over the square root of r, in which profiles are nearly straight: an exponential or a power
# of r, from 64 entries over four decades, is reproduced within 0.2 %. Unlike log R over log r, it allows R = 0 and r =
# 0.
_ROOT = 16

_LARGEST_R = 1e18  # 1/mm^2
_MOST_ROWS = 10_000

# For each interval: exact for r R dr, a polynomial of degree 51 in the square root of r.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(26)


@dataclass(frozen=True, eq=False)
class Tabulated(Profile):
    """R(r) interpolated in a table. It is monotone between neighbouring entries, and so never negative.

    `r` (n,): mm, at least 0, ascending, n at least 2. `R` (n, 3): 1/mm^2, at least 0. Below the first distance R is
    constant, beyond the last one it is 0. Raises InputError for other values.
    """

    r: Array
    R: Array

    def __post_init__(self) -> None:
        try:
            r, R = array_of(self.r), array_of(self.R)
        except ValueError:
            raise InputError("a table of a profile must be numbers") from None
        if r.ndim != 1 or R.shape != (r.size, 3):
            raise InputError(f"a table needs n distances and n rows of 3 values, not shapes {r.shape} and {R.shape}")
        _check(r, R, lambda i: f"in row {i + 1}")
        r.flags.writeable = R.flags.writeable = False
        object.__setattr__(self, "r", r)
        object.__setattr__(self, "R", R)
        for channel, total in zip(CHANNELS, self.total.tolist(), strict=True):
            if not total <= MOST_TOTAL:
                raise InputError(
                    f"the total of R of {channel} is {total:.3g}, and may be {MOST_TOTAL:g} at most "
                    "(r is in mm, R in 1/mm^2)"
                )

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a profile from a CSV file with four columns: r in mm, then R of red, green and blue in 1/mm^2.

        The first line may hold titles. Blank lines and text after a # are skipped. Raises InputError, naming the file,
        the line and the value, if the file cannot be read or does not hold such a table.
        """
        path = Path(path)
        text = read_text(path, "a CSV file")
        try:
            lines, table = _parse(text)
            _check(table[:, 0], table[:, 1:], lambda i: f"on line {lines[i]}")
            return cls(table[:, 0], table[:, 1:])
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @cached_property
    def total(self) -> Array:
        first = np.pi * np.square(self.r[0]) * self.R[0]
        return first + self._outside[0]

    def reflectance(self, r: ArrayLike) -> Array:
        r = distances(r)
        R = self._curve(np.sqrt(np.clip(r, self.r[0], self.r[-1]))) ** _ROOT
        return np.where((r <= self.r[-1])[..., None], R, 0.0)

    def beyond(self, r: ArrayLike) -> Array:
        r = distances(r)
        inside = np.clip(r, self.r[0], self.r[-1])
        following = np.clip(np.searchsorted(self.r, inside, side="right"), 1, self.r.size - 1)
        outside = self._outside[following] + _between(self._ring, np.sqrt(inside), np.sqrt(self.r[following]))
        disc = np.pi * np.maximum(np.square(self.r[0]) - np.square(r), 0.0)
        return shares(outside + disc[..., None] * self.R[0], self.total)

    def line_spread(self, x: ArrayLike) -> Array:
        x = np.abs(np.asarray(x, dtype=np.float64))[..., None]
        edges = np.sqrt(np.maximum(np.square(np.append(0.0, self.r)) - np.square(distances(x)), 0.0))
        along = _between(lambda y: self.reflectance(np.hypot(x[..., None], y)), edges[..., :-1], edges[..., 1:])
        return 2.0 * along.sum(axis=-2)

    def _ring(self, root: Array) -> Array:
        """Return 2 pi r R dr for each step of the square root of r, at roots (...): (..., 3)."""
        return 4.0 * np.pi * root[..., None] ** 3 * self._curve(root) ** _ROOT

    @cached_property
    def _outside(self) -> Array:
        """The integral of R over the plane beyond each distance of the table (n, 3)."""
        root = np.sqrt(self.r)
        rings = _between(self._ring, root[:-1], root[1:])
        return np.append(np.cumsum(rings[::-1], axis=0)[::-1], np.zeros((1, 3)), axis=0)

    @cached_property
    def _curve(self) -> Any:
        """R^(1/_ROOT) as a function of the square root of r."""
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(np.sqrt(self.r), self.R ** (1.0 / _ROOT))


def _between(f: Callable[[Array], Array], a: Array, b: Array) -> Array:
    """Return the integrals (..., 3) of f from `a` (...) to `b` (...). f maps (...) to (..., 3) and is smooth there."""
    half = 0.5 * (b - a)[..., None]
    values = f(a[..., None] + half * (1.0 + _NODES))
    return (values * (half * _WEIGHTS)[..., None]).sum(axis=-2)


def _parse(text: str) -> tuple[list[int], Array]:
    """Return the line number of each row of a CSV file, and the numbers (n, 4)."""
    lines: list[int] = []
    rows: list[list[float]] = []
    titled = False
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            cells = next(csv.reader([line.partition("#")[0]], skipinitialspace=True), [])
        except csv.Error:
            raise InputError(f"line {number} is not a line of a CSV file") from None
        if not "".join(cells).strip():
            continue
        numbers = [_number(cell) for cell in cells]
        if not (rows or titled) and not any(isinstance(n, float) for n in numbers):
            titled = True
            continue
        if len(cells) != len(_COLUMNS):
            raise InputError(f"line {number} has {len(cells)} columns, not 4 (r, R of red, green and blue)")
        for name, cell, value in zip(_COLUMNS, cells, numbers, strict=True):
            if value is None:
                raise InputError(f"{name} on line {number} is not a number: {shown(cell.strip())}")
        if len(rows) == _MOST_ROWS:
            raise InputError(f"line {number}: a table of a profile has {_MOST_ROWS} rows at most")
        lines.append(number)
        rows.append([n for n in numbers if n is not None])
    return lines, np.array(rows).reshape(-1, 4)


def _number(cell: str) -> float | None:
    """Return the number in a cell of the file; None if it is not a number."""
    try:
        return float(cell)
    except ValueError:
        return None


def _check(r: Array, R: Array, place: Callable[[int], str]) -> None:
    """Raise InputError if a table does not hold a profile. `place` describes where a row of it is, for the error."""
    if r.size < 2:
        raise InputError(f"a table of a profile needs at least 2 rows, not {r.size}")
    for i, distance in enumerate(r.tolist()):
        if not 0.0 <= distance <= LONGEST:
            raise InputError(f"r {place(i)} must be a number {span(0.0, LONGEST, unit='mm')}, not {distance:g}")
        if i and not r[i - 1] < distance:
            raise InputError(f"r must ascend: {distance:g} {place(i)} follows {r[i - 1]:g}")
    for i, channel in np.argwhere(~((R >= 0.0) & (R <= _LARGEST_R))):
        raise InputError(
            f"R of {CHANNELS[channel]} {place(i)} must be a number {span(0.0, _LARGEST_R, unit='1/mm^2')}, "
            f"not {R[i, channel]:g}"
        )
