"""A line of a bench's file: a run as JSON, all of whose keys are checked before anything is made of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from wgsss.errors import InputError
from wgsss.text import one_line

Run = dict[str, Any]
"""what `wgsss.study.run.measure` gives back: what a line of the file holds"""

Check = Callable[[str, Any], None]
"""raises InputError, naming the key, where its value is not what it should be"""

_LONGEST = 100_000  # characters of a text
_SHORTEST = 1e-9  # ms of a frame, whose logarithm charts show
_GREATEST = 1e12  # a number, of any unit: so much that no product of a few overflows


def parsed(line: bytes) -> Run:
    """The run of a line, with the keys that are known. Raises InputError saying what is wrong with it."""
    try:
        run = json.loads(line.decode("utf-8"), parse_constant=_refuse)
    except UnicodeDecodeError:
        raise InputError("not UTF-8 text") from None
    except RecursionError:
        raise InputError("nested too deep") from None
    except json.JSONDecodeError:
        raise InputError("not JSON, or cut off") from None
    except ValueError:  # NaN, Infinity, thousands of digits
        raise InputError("it holds a number that is not finite or too long") from None
    return _members(run, _KEYS, "")


def _refuse(name: str) -> None:
    raise ValueError(name)


def _members(found: Any, keys: Mapping[str, Check], within: str) -> Run:
    if not isinstance(found, dict):
        raise InputError(f"{f'key {within[:-1]!r}' if within else 'it'} must be an object, not {_shown(found)}")
    for key, check in keys.items():
        if key not in found:
            raise InputError(f"key '{within}{key}' is missing")
        check(within + key, found[key])
    return {key: found[key] for key in keys}


def _require(fits: bool, key: str, wanted: str, value: Any) -> None:
    if not fits:
        raise InputError(f"key '{key}' must be {wanted}, not {_shown(value)}")


def _shown(value: Any) -> str:
    text = one_line(repr(value))
    return text if len(text) <= 40 else text[:37] + "..."


def _text(key: str, value: Any) -> None:
    _require(isinstance(value, str) and len(value) <= _LONGEST, key, f"text of {_LONGEST} characters at most", value)


def _flag(key: str, value: Any) -> None:
    _require(isinstance(value, bool), key, "true or false", value)


def _time(key: str, value: Any) -> None:
    _require(_is_number(value, _SHORTEST), key, f"a number from {_SHORTEST:g} to {_GREATEST:g}", value)


def _number(key: str, value: Any) -> None:
    _require(_is_number(value, 0.0), key, f"a number from 0 to {_GREATEST:g}", value)


def _signed_or_null(key: str, value: Any) -> None:
    _require(value is None or _is_number(value, -_GREATEST), key, f"null or a number up to {_GREATEST:g}", value)


def _number_or_null(key: str, value: Any) -> None:
    _require(value is None or _is_number(value, 0.0), key, f"null or a number from 0 to {_GREATEST:g}", value)


def _count(key: str, value: Any) -> None:
    _require(_is_number(value, 0.0) and isinstance(value, int), key, "a whole number from 0", value)


def _numbers(key: str, value: Any) -> None:
    fits = isinstance(value, dict) and all(_is_number(number, 0.0) for number in value.values())
    _require(fits, key, "an object of numbers from 0", value)


def _times(key: str, value: Any) -> None:
    fits = isinstance(value, list) and len(value) == 2 and all(_is_number(number, _SHORTEST) for number in value)
    _require(fits, key, f"two numbers from {_SHORTEST:g} to {_GREATEST:g}", value)


def _size(key: str, value: Any) -> None:
    fits = isinstance(value, list) and len(value) == 2 and all(isinstance(n, int) and _is_number(n, 1) for n in value)
    _require(fits, key, "two whole numbers from 1", value)


def _knobs(key: str, value: Any) -> None:
    fits = isinstance(value, dict) and all(
        isinstance(knob, bool | str) or _is_number(knob, -_GREATEST) for knob in value.values()
    )
    _require(fits, key, "an object of numbers, texts, true and false", value)


def _error(key: str, value: Any) -> None:
    checks = {"rel_rmse": _number_or_null, "psnr": _signed_or_null, "flip": _number_or_null, "bias": _signed_or_null}
    _members(value, checks, f"{key}.")
    if "flip_reason" in value:
        _text(f"{key}.flip_reason", value["flip_reason"])


def _is_number(value: Any, low: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= _GREATEST


_KEYS: dict[str, Check] = {
    **dict.fromkeys(("scene", "digest", "method", "reference", "version", "adapter", "clock", "date"), _text),
    "bake_ms": _number,
    "frame_ms": _time,
    **dict.fromkeys(("step", "frames", "bytes"), _count),
    "knobs": _knobs,
    "size": _size,
    "bake_cached": _flag,
    "frame_ms_quartiles": _times,
    "passes": _numbers,
    "error": _error,
    "floor": _number_or_null,
}
