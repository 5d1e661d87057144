"""Knobs: the fields of a method's dataclass, whose metadata describes which values they take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, fields
from typing import Any

from wgsss.errors import InputError, unknown
from wgsss.text import shown

_SWITCHES = {"on": True, "true": True, "yes": True, "1": True, "off": False, "false": False, "no": False, "0": False}


def check_declaration(name: str, kind: Any) -> None:
    """Raise TypeError unless the class of the method `name` has a source, a docstring, a sweep and described knobs.

    Each knob needs a default and the metadata `unit` and `help`; also `choices`, or else a `range` (least, greatest),
    unless it is a switch, on or off. The default and the values of the sweep must be allowed.
    """
    if not isinstance(getattr(kind, "source", None), str) or not kind.source:
        raise TypeError(f"method {name}: `source` is missing, the paper that it follows")
    if not kind.__doc__ or kind.__doc__.startswith(f"{kind.__name__}("):  # what a dataclass writes by itself
        raise TypeError(f"method {name}: the docstring is missing")
    if not isinstance(getattr(kind, "sweep", None), tuple):
        raise TypeError(f"method {name}: `sweep` is missing, a tuple of settings from cheap to expensive")
    knobs = {knob.name: knob for knob in fields(kind)}
    for knob in knobs.values():
        _check_knob(f"method {name}, knob {knob.name}", knob)
    for setting in kind.sweep:
        for knob_name, value in setting.items():
            if knob_name not in knobs:
                raise TypeError(f"method {name}: `sweep` sets {knob_name}, which is not a knob")
            if not _is_allowed(knobs[knob_name], value):
                raise TypeError(f"method {name}, knob {knob_name}: the value {value!r} of `sweep` is not allowed")


def _check_knob(name: str, knob: Field[Any]) -> None:
    if not isinstance(knob.default, bool | int | float | str):
        raise TypeError(f"{name}: the default is missing")
    needed = ["unit", "help"]
    if not isinstance(knob.default, bool):
        needed.append("choices" if isinstance(knob.default, str) else "range")
    for entry in needed:
        if entry not in knob.metadata:
            raise TypeError(f"{name}: the metadata has no `{entry}`")
    if not knob.metadata["help"]:
        raise TypeError(f"{name}: `help` is empty")
    if not _is_allowed(knob, knob.default):
        raise TypeError(f"{name}: the default {knob.default!r} is not allowed")


def _is_allowed(knob: Field[Any], value: Any) -> bool:
    if isinstance(knob.default, bool):
        return isinstance(value, bool)
    if "choices" in knob.metadata:
        return value in knob.metadata["choices"]
    low, high = knob.metadata["range"]
    return bool(low <= value <= high)


def parsed(name: str, kind: Any, values: Mapping[str, Any], others: Sequence[str] = ()) -> dict[str, Any]:
    """Return the values of knobs of the method `name`, each in the type of the knob's default.

    Raises InputError for an unknown knob, naming the known ones and `others`, and for a value that is not of the knob's
    type and range or not one of its choices.
    """
    knobs = {knob.name: knob for knob in fields(kind)}
    for knob in values:
        if knob not in knobs:
            raise unknown(f"knob of {name}", knob, [*knobs, *others])
    return {knob: _parsed(f"{name}: {knob}", knobs[knob], value) for knob, value in values.items()}


def _parsed(name: str, knob: Field[Any], value: Any) -> Any:
    choices = knob.metadata.get("choices")
    if choices is not None:
        if value not in choices:
            raise InputError(f"{name} must be one of {', '.join(choices)}, not {shown(value)}")
        return value
    kind: Any = type(knob.default)
    if kind is bool:
        return _switch(name, value)
    try:
        number = kind(float(value)) if kind is int and float(value).is_integer() else kind(value)
    except (TypeError, ValueError, OverflowError):
        sort = "a whole number" if kind is int else "a number"
        raise InputError(f"{name} must be {sort}, not {shown(value)}") from None
    low, high = knob.metadata["range"]
    if not low <= number <= high:
        unit = f" ({knob.metadata['unit']})" if knob.metadata["unit"] else ""
        raise InputError(f"{name} must lie between {low:g} and {high:g}{unit}, not {shown(number)}")
    return number


def _switch(name: str, value: Any) -> bool:
    state = _SWITCHES.get(str(value).lower())
    if state is None:
        raise InputError(f"{name} must be on or off, not {shown(value)}")
    return state
