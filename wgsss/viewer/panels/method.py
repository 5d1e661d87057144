"""Controls for the method of a side and its knobs, built from the metadata of the method's fields."""

from __future__ import annotations

from dataclasses import Field, fields
from functools import partial
from typing import Any

import numpy as np
from imgui_bundle import imgui

from wgsss.errors import InputError
from wgsss.methods import Method
from wgsss.registry import METHODS, REFERENCES, SURFACES, TRANSLUCENCIES, make_method, name_of
from wgsss.study.run_record import Knob
from wgsss.viewer.command import knob_values
from wgsss.viewer.panels.widgets import CLAMPED, LOGARITHMIC, choice, rounded
from wgsss.viewer.session import Session

KnobField = Field[Any]

DOUBLING_RANGE = 300
"""largest value of a whole number from which on its buttons double and halve it; otherwise they add and subtract 1"""
LOGARITHMIC_RATIO = 100
"""ratio of the largest to the smallest value above which a slider is logarithmic"""


def declare_method(session: Session, side: int) -> None:
    """Declare the choice of a side's method, and a control for each of its knobs."""
    method = session.methods[side]
    name = name_of(method)
    pairs = [f"{surface}+{translucency}" for surface in SURFACES for translucency in ("none", *TRANSLUCENCIES)]
    chosen = choice("method", name, dict.fromkeys([*METHODS, *REFERENCES, *pairs]))
    if chosen != name:
        session.attempt(lambda: session.set_method(side, make_method(chosen)))
        return
    for knob in fields(method):  # type: ignore[arg-type]
        value = getattr(method, knob.name)
        new = _declare_knob(knob, value)
        _declare_help(knob)
        if new != value:
            session.attempt(partial(_set_knob, session, side, knob, new))


def with_knob(method: Method, knob: KnobField, value: Knob) -> Method:
    """Return the method with another value of a knob.

    If the method refuses a whole number, such as an even one, take the next in the direction of the change. Raises
    InputError if both are refused.
    """
    name, values = name_of(method), knob_values(method)
    if type(value) is not int:
        return make_method(name, values | {knob.name: value})
    low, high = knob.metadata["range"]
    candidates = range(value, high + 1) if value > getattr(method, knob.name) else range(value, low - 1, -1)
    error = InputError(f"{knob.name} must lie between {low} and {high}, not {value}")
    for candidate in candidates[:2]:
        try:
            return make_method(name, values | {knob.name: candidate})
        except InputError as refusal:
            error = refusal
    raise error


def _set_knob(session: Session, side: int, knob: KnobField, value: Knob) -> None:
    session.set_method(side, with_knob(session.methods[side], knob, value))


def _declare_knob(knob: KnobField, value: Any) -> Any:
    """Declare a control that suits the type and the range of a knob, and return its value."""
    if "choices" in knob.metadata:
        return choice(knob.name, value, knob.metadata["choices"])
    if isinstance(value, bool):
        return imgui.checkbox(knob.name, value)[1]
    low, high = knob.metadata["range"]
    if isinstance(value, int):
        changed, new = imgui.input_int(knob.name, value, 1, 0, imgui.InputTextFlags_.enter_returns_true)
        if changed and high >= DOUBLING_RANGE and abs(new - value) == 1:
            new = 2 * value if new > value else value // 2
        return int(np.clip(new, low, high)) if changed else value
    flags = LOGARITHMIC if low > 0 and high / low > LOGARITHMIC_RATIO else CLAMPED
    changed, moved = imgui.slider_float(knob.name, value, low, high, "%.3g", flags)
    return rounded(moved) if changed else value


def _declare_help(knob: KnobField) -> None:
    """Declare a tooltip for the control above, with the help text and the unit of its knob."""
    unit = knob.metadata["unit"]
    imgui.set_item_tooltip(f"{knob.metadata['help']}{f', {unit}' if unit else ''}".replace("%", "%%"))
