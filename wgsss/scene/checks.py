"""Validation of dataclass fields, shared by materials, lights, cameras and scenes.

Each function reads one field of a frozen dataclass that is being built, raises `InputError` naming the field, and
stores the value in its plain form (lists, as scene files give them, become tuples of float).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from wgsss.errors import InputError
from wgsss.scene.images.files import MAX_SIDE

Triple = tuple[float, float, float]

# What single precision holds: squares of coordinates, which may have either sign (the sun is 1.5e14 mm away), and all
# other numbers (its intensity is 3e25 W/sr).
LARGEST_SIGNED, LARGEST = 1e15, 3e38


def number(owner: object, field: str, low: float = -math.inf, high: float = math.inf, *, above: bool = False) -> None:
    """Check that a field is a finite number in low..high; `above` excludes low itself."""
    value = getattr(owner, field)
    if not _is_number(value) or not low <= value <= high or (above and value == low):
        raise InputError(f"{field} must be {_range(low, high, above, 'a finite number')}, not {_show(value)}")
    _bounded(field, [value], low)
    object.__setattr__(owner, field, float(value))


def integer(owner: object, field: str, low: int, high: int) -> None:
    """Check that a field is a whole number in low..high."""
    value = getattr(owner, field)
    if not _is_number(value) or int(value) != value or not low <= value <= high:
        raise InputError(f"{field} must be a whole number from {low} to {high}, not {_show(value)}")
    object.__setattr__(owner, field, int(value))


def triple(
    owner: object,
    field: str,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    nonzero: bool = False,
) -> None:
    """Check that a field is three finite numbers, each in low..high; `nonzero` refuses the zero vector."""
    value = getattr(owner, field)
    parts = list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes | dict) else []
    if len(parts) != 3 or not all(_is_number(p) and low <= p <= high and not (above and p == low) for p in parts):
        wanted = _range(low, high, above, "finite")
        raise InputError(f"{field} must be three numbers, each {wanted}, not {_show(value)}")
    _bounded(field, parts, low)
    if nonzero and math.hypot(*parts) < 1 / LARGEST_SIGNED:
        raise InputError(f"{field} must not be the zero vector")
    object.__setattr__(owner, field, tuple(float(p) for p in parts))


def image_size(size: tuple[int, int]) -> None:
    """Check the width and height of a picture, in pixels."""
    if len(size) != 2 or not all(_is_number(n) and int(n) == n and 1 <= n <= MAX_SIDE for n in size):
        shown = " x ".join(map(_show, size))
        raise InputError(f"the image size must be 1 to {MAX_SIDE} pixels a side, not {shown}")


def not_parallel(first: Iterable[float], second: Iterable[float], message: str) -> None:
    """Raise `message` where two vectors, given as triples, do not span a plane."""
    (a, b, c), (x, y, z) = first, second
    cross = math.hypot(b * z - c * y, c * x - a * z, a * y - b * x)
    if cross <= 1e-9 * math.hypot(a, b, c) * math.hypot(x, y, z):
        raise InputError(message)


def _bounded(field: str, values: list[Any], low: float) -> None:
    largest = LARGEST_SIGNED if low < 0 else LARGEST
    for value in values:
        if abs(value) > largest:
            raise InputError(f"{field} must not be beyond {largest:g} in size, not {_show(value)}")


def _is_number(value: Any) -> bool:
    try:
        return not isinstance(value, bool | str | bytes) and math.isfinite(value)
    except (TypeError, OverflowError):  # an integer of hundreds of digits
        return False


def _range(low: float, high: float, above: bool, otherwise: str) -> str:
    if math.isfinite(high):
        return f"{'above' if above else 'from'} {low:g} {'up ' if above else ''}to {high:g}"
    if math.isfinite(low):
        return f"{'above' if above else 'at least'} {low:g}"
    return otherwise


def _show(value: Any) -> str:
    text = repr(value).replace("\n", " ")
    return text if len(text) <= 60 else text[:57] + "..."
