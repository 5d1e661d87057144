"""Controls for a method and its knobs, by what the knobs' fields say of themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from wgsss.errors import InputError
from wgsss.methods import Method
from wgsss.registry import METHODS, REFERENCES, SURFACES, TRANSLUCENCIES, make_method, name_of

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

DOUBLED = 300
"""whole numbers that go further are doubled and halved by the buttons beside them; others go by one"""
DIGITS = 4
"""of what a slider sets, so that the command that is copied stays short"""


def shortened(value: float) -> float:
    """A value of DIGITS digits."""
    return float(f"{value:.{DIGITS}g}")


def choice(label: str, value: str, choices: Iterable[str]) -> str:
    """A drop-down list."""
    from imgui_bundle import imgui

    names = list(choices)
    changed, index = imgui.combo(label, names.index(value) if value in names else -1, names)
    return names[index] if changed else value


def method(window: Window, side: int) -> None:
    """A method and all its knobs."""
    shown = window.state.methods[side]
    name = name_of(shown)
    pairs = [f"{surface}+{part}" for surface in SURFACES for part in ("none", *TRANSLUCENCIES)]
    chosen = choice("method", name, dict.fromkeys([*METHODS, *REFERENCES, *pairs]))
    if chosen != name:
        window.attempt(lambda: window.change_method(side, make_method(chosen)))
        return
    for knob in fields(shown):  # type: ignore[arg-type]
        value = getattr(shown, knob.name)
        wanted = _knob(knob, value)
        _help(knob)
        if wanted != value:
            window.attempt(lambda knob=knob, wanted=wanted: window.change_method(side, with_knob(shown, knob, wanted)))


def with_knob(shown: Method, knob: Any, wanted: Any) -> Method:
    """The method with a knob at a value, or at the next one in the same direction that it can have.

    Raises InputError where there is none.
    """
    values = dict(vars(shown))
    if type(wanted) is not int:
        return make_method(name_of(shown), values | {knob.name: wanted})
    low, high = knob.metadata["range"]
    further = range(wanted, high + 1) if wanted > values[knob.name] else range(wanted, low - 1, -1)
    fault = InputError(f"{knob.name} must lie between {low} and {high}, not {wanted}")
    for number in further[:2]:
        try:
            return make_method(name_of(shown), values | {knob.name: number})
        except InputError as error:
            fault = error
    raise fault


def _knob(knob: Any, value: Any) -> Any:
    """A control for a knob of a method, by its type and range."""
    from imgui_bundle import imgui

    if "choices" in knob.metadata:
        return choice(knob.name, value, knob.metadata["choices"])
    if isinstance(value, bool):
        return imgui.checkbox(knob.name, value)[1]
    low, high = knob.metadata["range"]
    if isinstance(value, int):
        changed, new = imgui.input_int(knob.name, value, 1, 0, imgui.InputTextFlags_.enter_returns_true)
        if changed and high >= DOUBLED and abs(new - value) == 1:
            new = 2 * value if new > value else value // 2
        return int(np.clip(new, low, high)) if changed else value
    wide = imgui.SliderFlags_.logarithmic if low > 0 and high / low > 100 else imgui.SliderFlags_.none
    changed, moved = imgui.slider_float(knob.name, value, low, high, "%.3g", wide | imgui.SliderFlags_.always_clamp)
    return shortened(moved) if changed else value


def _help(knob: Any) -> None:
    """What a knob is for, under a pointer that rests on it."""
    from imgui_bundle import imgui

    unit = knob.metadata["unit"]
    imgui.set_item_tooltip(f"{knob.metadata['help']}{f', {unit}' if unit else ''}".replace("%", "%%"))
