"""JSON objects of a glTF file with typed access to their fields. Errors name the location of a wrong value."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from wgsss.errors import InputError

REQUIRED: Any = object()
"""in place of a default value: a missing field is an error"""


@dataclass(frozen=True)
class Item:
    """A JSON object and its location in the file. A field that is null counts as missing.

    Methods that read a field raise InputError if its value has the wrong type or is out of range, or if it is missing
    and has no default.
    """

    values: dict[str, Any]
    location: str = ""
    """location for messages, such as "mesh 0, primitive 1" """

    def error(self, message: str) -> InputError:
        """Make an error that names the location of this object."""
        return InputError(f"{self.location}: {message}" if self.location else message)

    def get(self, key: str) -> Any:
        """Return the value of a field as it is, or None."""
        return self.values.get(key)

    def has(self, key: str) -> bool:
        """Whether the object has a field."""
        return self.values.get(key) is not None

    def whole(self, key: str, default: int = REQUIRED, low: int = 0, high: int = sys.maxsize) -> int:
        """Read a whole number from low to high."""
        value = self._value(key, default)
        number = as_whole(value)
        if number is None or not low <= number <= high:
            bounds = f"from {low} to {high}" if high < sys.maxsize else f"of at least {low}"
            raise self.error(f"{key} must be a whole number {bounds}, not {json_text(value)}")
        return number

    def number(self, key: str, default: float = REQUIRED, low: float = -math.inf, high: float = math.inf) -> float:
        """Read a finite number from low to high."""
        value = self._value(key, default)
        number = as_number(value)
        if number is None or not low <= number <= high:
            bounds = "a finite number" if low == -math.inf else f"at least {low:g}"
            bounds = f"from {low:g} to {high:g}" if high < math.inf else bounds
            raise self.error(f"{key} must be {bounds}, not {json_text(value)}")
        return number

    def numbers(self, key: str, count: int, default: Collection[float] = REQUIRED) -> tuple[float, ...]:
        """Read a list of `count` finite numbers."""
        value = self._value(key, default)
        numbers = [as_number(v) for v in value] if isinstance(value, list | tuple) else []
        if len(numbers) != count or None in numbers or not isinstance(value, list | tuple):
            raise self.error(f"{key} must be {count} finite numbers")
        return tuple(v for v in numbers if v is not None)

    def text(self, key: str, default: str = REQUIRED, choices: Collection[str] = ()) -> str:
        """Read a string. If there are choices, it must be one of them."""
        value = self._value(key, default)
        if not isinstance(value, str):
            raise self.error(f"{key} must be text, not {json_text(value)}")
        if choices and value not in choices:
            raise self.error(f"{key} must be one of {', '.join(choices)}, not {printable(value)}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Read a boolean."""
        value = self._value(key, default)
        if not isinstance(value, bool):
            raise self.error(f"{key} must be true or false, not {json_text(value)}")
        return value

    @property
    def name(self) -> str:
        """The name of the object, or "" if it has none."""
        value = self.values.get("name")
        return printable(value) if isinstance(value, str) else ""

    def array(self, key: str) -> list[Any]:
        """Read a list of any values. Return an empty list if the field is missing."""
        value = self._value(key, [])
        if not isinstance(value, list):
            raise self.error(f"{key} must be a list, not {json_text(value)}")
        return value

    def item(self, key: str, label: str = "") -> Item | None:
        """Read an object. Return None if the field is missing. `label` replaces the key in messages."""
        value = self._value(key, None)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.error(f"{key} must be an object, not {json_text(value)}")
        name = label or key
        return Item(value, f"{self.location}: {name}" if self.location else name)

    def items(self, key: str, label: str) -> list[Item]:
        """Read a list of objects. Return an empty list if the field is missing. Messages call them `label` 0, 1, ..."""
        items = []
        for number, value in enumerate(self.array(key)):
            location = f"{self.location}, {label} {number}" if self.location else f"{label} {number}"
            if not isinstance(value, dict):
                raise InputError(f"{location} must be an object, not {json_text(value)}")
            items.append(Item(value, location))
        return items

    def extension(self, name: str) -> Item | None:
        """Return an extension of the object by its name. Return None if the object does not have it."""
        extensions = self.item("extensions")
        extension = None if extensions is None else extensions.item(name)
        return (
            None if extension is None else Item(extension.values, f"{self.location}: {name}" if self.location else name)
        )

    def extensions(self) -> list[str]:
        """Return the names of the extensions of the object."""
        extensions = self.item("extensions")
        return [] if extensions is None else [name for name in extensions.values if extensions.has(name)]

    def _value(self, key: str, default: Any) -> Any:
        value = self.values.get(key)
        if value is not None:
            return value
        if default is REQUIRED:
            raise self.error(f"{key} is missing")
        return default


def as_whole(value: Any) -> int | None:
    """Convert a JSON value to an int. Accept 3.0 as well as 3; return None for anything else."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def as_number(value: Any) -> float | None:
    """Convert a JSON value to a finite float. Return None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer with hundreds of digits
        return None
    return number if math.isfinite(number) else None


def json_text(value: Any) -> str:
    """Format a JSON value for a message, in one line of at most 60 characters."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > sys.maxsize:
        return "a number of very many digits"
    words = {True: "true", False: "false", None: "null"}
    return words[value] if value is None or isinstance(value, bool) else printable(repr(value))


def printable(text: str) -> str:
    """Format text of a file for a message: one line of at most 60 printable characters."""
    text = "".join(c if c.isprintable() else " " for c in text)
    text = " ".join(text.split())
    return text if len(text) <= 60 else f"{text[:57]}..."
