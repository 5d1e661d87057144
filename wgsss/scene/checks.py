"""Validation of dataclass fields, shared by materials, lights, cameras and scenes.

Each function reads one field of a frozen dataclass that is being built, raises `InputError` naming the field, its unit
and its range, and stores the value in its plain form (lists, as scene files give them, become tuples of float).

Every quantity has limits, so that products of several stay within the range of single precision. The sun lies within
them, as a sphere of radius 7e11 mm at a distance of 1.5e14 mm with 2e7 W/(m^2 sr), or as a point of 3e25 W/sr.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from wgsss.errors import InputError
from wgsss.scene.images.files import MAX_SIDE
from wgsss.text import shown, span
from wgsss.values import is_number

Triple = tuple[float, float, float]

COORDINATE = 1e15
"""Largest coordinate of a position, mm, of either sign. Its square is within the range of float32."""
LENGTH = 1e13
"""Largest length, mm."""
SMALLEST = 1e-6
"""Smallest length, mm."""
ANGLE = 1e9
"""Largest angle in degrees, or angular speed in degrees per second, of either sign."""
SECONDS = 1e9
"""Largest time, of either sign."""
BRIGHTEST = 1e12
"""Largest radiance, W/(m^2 sr), and irradiance, W/m^2. Those of the sun are 2e7 and 1.4e3."""
STRONGEST = 1e30
"""Largest intensity, W/sr."""


def number(owner: object, field: str, low: float, high: float, unit: str = "", *, above: bool = False) -> None:
    """Check that a field is a number in low..high; `above` excludes low itself."""
    value = getattr(owner, field)
    if not is_number(value) or not low <= value <= high or (above and value == low):
        raise InputError(f"{field} must be {span(low, high, above, unit)}, not {shown(value)}")
    object.__setattr__(owner, field, float(value))


def integer(owner: object, field: str, low: int, high: int) -> None:
    """Check that a field is a whole number in low..high."""
    value = getattr(owner, field)
    if not is_number(value) or int(value) != value or not low <= value <= high:
        raise InputError(f"{field} must be a whole number from {low} to {high}, not {shown(value)}")
    object.__setattr__(owner, field, int(value))


def triple(owner: object, field: str, low: float, high: float, unit: str = "") -> None:
    """Check that a field is three numbers, each in low..high."""
    value = getattr(owner, field)
    parts = list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes | dict) else []
    if len(parts) != 3 or not all(is_number(part) and low <= part <= high for part in parts):
        raise InputError(f"{field} must be three numbers, each {span(low, high, unit=unit)}, not {shown(value)}")
    object.__setattr__(owner, field, tuple(float(part) for part in parts))


def position(owner: object, field: str) -> None:
    """Check that a field is a position, mm."""
    triple(owner, field, -COORDINATE, COORDINATE, "mm")


def direction(owner: object, field: str) -> None:
    """Check that a field is a vector of nonzero length."""
    triple(owner, field, -COORDINATE, COORDINATE)
    if math.hypot(*getattr(owner, field)) < 1 / COORDINATE:
        raise InputError(f"{field} must not be the zero vector")


def name(owner: object, field: str = "name") -> None:
    """Check that a field is a name: text that is not empty."""
    value = getattr(owner, field)
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{field} must be text that is not empty, not {shown(value)}")


def image_size(size: tuple[int, int]) -> None:
    """Check the width and height of a picture, in pixels."""
    if len(size) != 2 or not all(is_number(side) and int(side) == side and 1 <= side <= MAX_SIDE for side in size):
        sides = " x ".join(map(shown, size))
        raise InputError(f"the image size must be 1 to {MAX_SIDE} pixels a side, not {sides}")


def time(time_s: float) -> None:
    """Check a time, in seconds."""
    if not is_number(time_s) or abs(time_s) > SECONDS:
        raise InputError(f"the time must be {span(-SECONDS, SECONDS, unit='seconds')}, not {shown(time_s)}")


def not_parallel(first: Iterable[float], second: Iterable[float], message: str) -> None:
    """Raise InputError with `message` if two vectors, given as triples, are parallel."""
    (a, b, c), (x, y, z) = first, second
    cross = math.hypot(b * z - c * y, c * x - a * z, a * y - b * x)
    if cross <= 1e-9 * math.hypot(a, b, c) * math.hypot(x, y, z):
        raise InputError(message)
