"""What the panel's controls make of a method and a material."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from wgsss.errors import InputError
from wgsss.methods import make_method
from wgsss.scene import MATERIALS
from wgsss.viewer.knobs import shortened, with_knob
from wgsss.viewer.media import changed_table
from wgsss.viewer.state import Source, State


def turned(name: str, values: dict[str, Any], knob: str, wanted: Any) -> Any:
    method: Any = make_method(name, values)
    return vars(with_knob(method, next(f for f in fields(method) if f.name == knob), wanted))[knob]


def test_a_knob_goes_on_to_the_next_value_that_it_can_have() -> None:
    assert turned("jimenez15", {"taps": 17}, "taps", 18) == 19, "taps are odd"
    assert turned("jimenez15", {"taps": 17}, "taps", 16) == 15
    assert turned("jimenez15", {"taps": 17}, "taps", 33) == 33
    assert turned("sam", {"samples": 3}, "samples", 4) == 4
    assert turned("jensen02", {}, "epsilon", 0.3) == 0.3
    with pytest.raises(InputError, match="between"):
        turned("jimenez15", {"taps": 65}, "taps", 66)


def test_other_knobs_stay() -> None:
    method: Any = make_method("sam", {"samples": 5, "surface": "screen"})
    knob = next(f for f in fields(method) if f.name == "samples")
    assert with_knob(method, knob, 9) == make_method("sam", {"samples": 9, "surface": "screen"})


def test_sliders_set_short_numbers() -> None:
    assert (shortened(0.123456), shortened(12345.6), shortened(1e-9)) == (0.1235, 12350.0, 1e-9)


def test_a_coefficient_set_leaves_the_rest_of_a_material() -> None:
    state = State.open(Source("slab", vertices=300), [])
    state.wear({"preset": "ketchup", "roughness": 0.31, "base_color": [0.5, 0.6, 0.7], "eta": 1.4})
    before: Any = state.scene.objects[0].material
    state.wear(changed_table(before, {"sigma_a": [0.1, 0.2, 0.3]}))
    after: Any = state.scene.objects[0].material
    assert after.sigma_a == (0.1, 0.2, 0.3)
    for name in ("sigma_s_prime", "eta", "roughness", "specular", "base_color", "color_after"):
        assert getattr(after, name) == getattr(before, name)
    assert "base_color" not in changed_table(MATERIALS["skin1"], {}), "a texture would be lost"
