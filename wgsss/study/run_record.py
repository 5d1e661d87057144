"""A run of the benchmark as one line of JSON. Reading a line checks every key."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, NotRequired, TypedDict, cast

from wgsss.errors import InputError
from wgsss.text import one_line

Knob = bool | int | float | str


class RunErrors(TypedDict):
    """The errors of a run, with the meanings of `metrics.Errors`."""

    rel_rmse: float | None
    psnr: float | None
    flip: float | None
    bias: float | None
    flip_reason: NotRequired[str]


class Run(TypedDict):
    """One setting of a method in one scene: its cost and its errors."""

    scene: str
    digest: str
    """Digest of the scene's content."""
    method: str
    knobs: dict[str, Knob]
    step: int
    """Place of the setting in the method's sweep."""
    size: list[int]
    """Width and height, pixels."""
    reference: str
    version: str
    """Version of wgsss, with the commit in a checkout."""
    adapter: str
    clock: str
    """The clock that times passes."""
    date: str
    bake_ms: float
    """Time to prepare the method."""
    bake_cached: bool
    """Whether the cache already held everything that the method prepares."""
    frame_ms: float
    """Median of the time that the passes of a frame take."""
    frame_ms_quartiles: list[float]
    """First and third quartile of the same."""
    frames: int
    """Number of frames timed."""
    passes: dict[str, float]
    """Time of each pass in the median frame, ms."""
    bytes: int
    """Size of the textures and buffers of a frame, transient and persistent."""
    error: RunErrors
    floor: float | None
    """The rel_rmse that the reference's own error accounts for."""


Check = Callable[[str, Any], None]
"""Raises InputError that names the key if the value is not valid."""

_LONGEST = 100_000  # characters of a text
_SHORTEST = 1e-9  # ms of a frame; charts show the logarithm
_GREATEST = 1e12  # largest number, of any unit, so that products of a few do not overflow


def parse_run(line: bytes) -> Run:
    """Parse a line. Unknown keys are dropped. Raises InputError that says what is wrong with the line."""
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
    return cast(Run, _checked_members(run, _CHECKS, ""))


def _refuse(name: str) -> None:
    raise ValueError(name)


def _checked_members(value: Any, checks: Mapping[str, Check], prefix: str) -> dict[str, Any]:
    """Return the members of an object that have a check, after running the checks."""
    if not isinstance(value, dict):
        raise InputError(f"{f'key {prefix[:-1]!r}' if prefix else 'it'} must be an object, not {_shown(value)}")
    for key, check in checks.items():
        if key not in value:
            raise InputError(f"key '{prefix}{key}' is missing")
        check(prefix + key, value[key])
    return {key: value[key] for key in checks}


def _require(is_valid: bool, key: str, expected: str, value: Any) -> None:
    if not is_valid:
        raise InputError(f"key '{key}' must be {expected}, not {_shown(value)}")


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
    is_valid = isinstance(value, dict) and all(_is_number(number, 0.0) for number in value.values())
    _require(is_valid, key, "an object of numbers from 0", value)


def _times(key: str, value: Any) -> None:
    is_valid = isinstance(value, list) and len(value) == 2 and all(_is_number(number, _SHORTEST) for number in value)
    _require(is_valid, key, f"two numbers from {_SHORTEST:g} to {_GREATEST:g}", value)


def _size(key: str, value: Any) -> None:
    is_pair = isinstance(value, list) and len(value) == 2
    is_valid = is_pair and all(isinstance(n, int) and _is_number(n, 1) for n in value)
    _require(is_valid, key, "two whole numbers from 1", value)


def _knobs(key: str, value: Any) -> None:
    is_valid = isinstance(value, dict) and all(
        isinstance(knob, bool | str) or _is_number(knob, -_GREATEST) for knob in value.values()
    )
    _require(is_valid, key, "an object of numbers, texts, true and false", value)


def _error(key: str, value: Any) -> None:
    checks = {"rel_rmse": _number_or_null, "psnr": _signed_or_null, "flip": _number_or_null, "bias": _signed_or_null}
    _checked_members(value, checks, f"{key}.")
    if "flip_reason" in value:
        _text(f"{key}.flip_reason", value["flip_reason"])


def _is_number(value: Any, low: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= _GREATEST


_CHECKS: dict[str, Check] = {
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
