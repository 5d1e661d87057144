"""The methods by name. A new one is a file here, its modules in `wgsl/`, a row below and its goldens."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from wgsss.errors import InputError, unknown
from wgsss.methods.lambert import Lambert
from wgsss.methods.method import Diffused, Method
from wgsss.methods.point_cloud import PointCloud
from wgsss.methods.sam import SpatialAdjacencyMaps
from wgsss.methods.texture_space import TextureSpace

METHODS: dict[str, type[Method]] = {
    "lambert": Lambert,
    "deon07": TextureSpace,
    "jensen02": PointCloud,
    "sam": SpatialAdjacencyMaps,
}


def make_method(name: str, knobs: dict[str, Any] | None = None) -> Method:
    """The method, or the reference, `name` with its knobs set.

    Raises InputError for a name or knob that is not known, or a value that is not of the knob's type and range, or not
    one of its choices.
    """
    from wgsss.reference import REFERENCES

    kinds = {**METHODS, **REFERENCES}
    if name not in kinds:
        raise unknown("method", name, kinds)
    kind = kinds[name]
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    values = {}
    for knob, value in (knobs or {}).items():
        if knob not in known:
            raise unknown(f"knob of {name}", knob, known)
        values[knob] = _parsed(f"{name}: {knob}", known[knob], value)
    return kind(**values)


def name_of(method: Method) -> str:
    """The name that a method or a reference goes by."""
    from wgsss.reference import REFERENCES

    return next((n for n, kind in {**METHODS, **REFERENCES}.items() if kind is type(method)), type(method).__name__)


def _parsed(where: str, knob: Any, value: Any) -> Any:
    """A knob's value: one of its choices, or in the type of its default and within its range."""
    choices = knob.metadata.get("choices")
    if choices is not None:
        if value not in choices:
            raise InputError(f"{where} must be one of {', '.join(choices)}, not '{value}'")
        return value
    kind = type(knob.default)
    try:
        parsed = kind(float(value)) if kind is int and float(value).is_integer() else kind(value)
    except (TypeError, ValueError):
        raise InputError(f"{where} must be {'a whole number' if kind is int else 'a number'}, not '{value}'") from None
    low, high = knob.metadata["range"]
    if not low <= parsed <= high:
        raise InputError(f"{where} must lie between {low:g} and {high:g}, not {parsed:g}")
    return parsed


__all__ = ["METHODS", "Diffused", "Method", "make_method", "name_of"]
