"""What the panel's controls make of a method and a material."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import pytest

from wgsss.errors import InputError
from wgsss.registry import METHODS, REFERENCES, make_method
from wgsss.scene import MATERIALS
from wgsss.study.light_types import light_types
from wgsss.viewer import knobs, lamps, media
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
    state.wear({"preset": "ketchup", "roughness": 0.31, "specular": 0.5, "base_color": [0.5, 0.6, 0.7], "eta": 1.4})
    before: Any = state.scene.objects[0].material
    state.wear(changed_table(before, {"sigma_a": [0.1, 0.2, 0.3]}))
    after: Any = state.scene.objects[0].material
    assert after.sigma_a == (0.1, 0.2, 0.3)
    for name in ("sigma_s_prime", "eta", "roughness", "specular", "base_color", "color_after"):
        assert getattr(after, name) == getattr(before, name)
    assert "base_color" not in changed_table(MATERIALS["skin1"], {}), "a texture would be lost"


@pytest.fixture
def shown() -> Iterator[Callable[[Callable[[Any], None], State], None]]:
    """Declares a part of the panel for a few frames; without a window, and without input."""
    bundle = pytest.importorskip("imgui_bundle")
    imgui = bundle.imgui
    context = imgui.create_context()
    imgui.set_current_context(context)
    plots = bundle.implot.create_context()
    imgui.get_io().backend_flags |= imgui.BackendFlags_.renderer_has_textures
    imgui.get_io().display_size = 400, 800
    imgui.get_io().set_ini_filename("")

    def attempt(act: Any) -> None:
        raise AssertionError("nothing was touched")

    def declare(part: Callable[[Any], None], state: State) -> None:
        window: Any = SimpleNamespace(state=state, attempt=attempt)
        for _ in range(3):
            imgui.new_frame()
            imgui.begin("panel")
            part(window)
            imgui.end()
            imgui.end_frame()

    yield declare
    bundle.implot.destroy_context(plots)
    imgui.destroy_context(context)


@pytest.mark.parametrize("name", [*METHODS, *REFERENCES, "texture+none"])
def test_knobs_that_are_shown_stay_as_they_are(shown: Any, name: str) -> None:
    state = State.open(Source("slab", vertices=300), [make_method(name)] * 2)
    shown(lambda window: knobs.method(window, 1), state)
    assert state.methods[1] == make_method(name)


@pytest.mark.parametrize("kind", ["own", "directional", "point", "area", "environment"])
def test_a_light_that_is_shown_stays_as_it_is(shown: Any, kind: str) -> None:
    state = State.open(Source("slab", vertices=300), [])
    if kind != "own":
        state.scene = replace(state.scene, lights=light_types(state.scene)[kind].lights)
    scene = state.scene
    shown(lamps.lamp, state)
    assert state.scene is scene


@pytest.mark.parametrize("name", MATERIALS)
def test_a_material_that_is_shown_stays_as_it_is(shown: Any, name: str) -> None:
    state = State.open(Source("slab", vertices=300), [], material=name)
    scene = state.scene
    shown(media.medium, state)
    assert state.scene is scene
