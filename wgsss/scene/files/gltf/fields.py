"""The objects of a glTF file's JSON, read field by field: a value of a wrong type is an error that says where it is."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from wgsss.errors import InputError

REQUIRED: Any = object()
"""in place of a default: without the field there is an error"""


@dataclass(frozen=True)
class Item:
    """A JSON object, and where it is, for messages: "mesh 0, primitive 1". A field that is null is not there.

    Every method raises InputError for a value of another kind than asked for.
    """

    values: dict[str, Any]
    where: str = ""

    def error(self, message: str) -> InputError:
        """An error that says where this object is."""
        return InputError(f"{self.where}: {message}" if self.where else message)

    def get(self, key: str) -> Any:
        """The value as it is; None where there is none."""
        return self.values.get(key)

    def has(self, key: str) -> bool:
        """Whether there is a value."""
        return self.values.get(key) is not None

    def whole(self, key: str, default: int = REQUIRED, low: int = 0, high: int = sys.maxsize) -> int:
        """A whole number from low to high."""
        value = self._value(key, default)
        number = as_whole(value)
        if number is None or not low <= number <= high:
            wanted = f"from {low} to {high}" if high < sys.maxsize else f"of at least {low}"
            raise self.error(f"{key} must be a whole number {wanted}, not {shown(value)}")
        return number

    def number(self, key: str, default: float = REQUIRED, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number from low to high."""
        value = self._value(key, default)
        number = as_number(value)
        if number is None or not low <= number <= high:
            wanted = "a finite number" if low == -math.inf else f"at least {low:g}"
            wanted = f"from {low:g} to {high:g}" if high < math.inf else wanted
            raise self.error(f"{key} must be {wanted}, not {shown(value)}")
        return number

    def numbers(self, key: str, count: int, default: Collection[float] = REQUIRED) -> tuple[float, ...]:
        """So many finite numbers."""
        value = self._value(key, default)
        found = [as_number(v) for v in value] if isinstance(value, list | tuple) else []
        if len(found) != count or None in found or not isinstance(value, list | tuple):
            raise self.error(f"{key} must be {count} finite numbers")
        return tuple(v for v in found if v is not None)

    def text(self, key: str, default: str = REQUIRED, choices: Collection[str] = ()) -> str:
        """A text, one of some where there are choices."""
        value = self._value(key, default)
        if not isinstance(value, str):
            raise self.error(f"{key} must be text, not {shown(value)}")
        if choices and value not in choices:
            raise self.error(f"{key} must be one of {', '.join(choices)}, not {plain(value)}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self._value(key, default)
        if not isinstance(value, bool):
            raise self.error(f"{key} must be true or false, not {shown(value)}")
        return value

    @property
    def name(self) -> str:
        """What the object is called, "" where it has no name."""
        value = self.values.get("name")
        return plain(value) if isinstance(value, str) else ""

    def array(self, key: str) -> list[Any]:
        """A list of whatever; empty where there is none."""
        value = self._value(key, [])
        if not isinstance(value, list):
            raise self.error(f"{key} must be a list, not {shown(value)}")
        return value

    def item(self, key: str, label: str = "") -> Item | None:
        """An object; None where there is none. `label` stands for the key in messages."""
        value = self._value(key, None)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.error(f"{key} must be an object, not {shown(value)}")
        where = label or key
        return Item(value, f"{self.where}: {where}" if self.where else where)

    def items(self, key: str, label: str) -> list[Item]:
        """A list of objects; empty where there is none. One of them is called `label` and its number."""
        found = []
        for number, value in enumerate(self.array(key)):
            where = f"{self.where}, {label} {number}" if self.where else f"{label} {number}"
            if not isinstance(value, dict):
                raise InputError(f"{where} must be an object, not {shown(value)}")
            found.append(Item(value, where))
        return found

    def extension(self, name: str) -> Item | None:
        """One of the object's extensions; None where it has not got it."""
        found = self.item("extensions")
        extension = None if found is None else found.item(name)
        return None if extension is None else Item(extension.values, f"{self.where}: {name}" if self.where else name)

    def extensions(self) -> list[str]:
        """The names of the object's extensions."""
        found = self.item("extensions")
        return [] if found is None else [name for name in found.values if found.has(name)]

    def _value(self, key: str, default: Any) -> Any:
        value = self.values.get(key)
        if value is not None:
            return value
        if default is REQUIRED:
            raise self.error(f"{key} is missing")
        return default


def as_whole(value: Any) -> int | None:
    """A whole number, also if written as 3.0; None for anything else."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def as_number(value: Any) -> float | None:
    """A finite number; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return None
    return number if math.isfinite(number) else None


def shown(value: Any) -> str:
    """A JSON value for a message, in one line of at most 60 characters."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > sys.maxsize:
        return "a number of very many digits"
    words = {True: "true", False: "false", None: "null"}
    return words[value] if value is None or isinstance(value, bool) else plain(repr(value))


def plain(text: str) -> str:
    """Text of a file for a message: in one line of at most 60 characters, all of which can be printed."""
    text = "".join(c if c.isprintable() else " " for c in text)
    text = " ".join(text.split())
    return text if len(text) <= 60 else f"{text[:57]}..."
