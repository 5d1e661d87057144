"""Panels, without a window: what they show changes nothing, and what a control sets is valid."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

import pytest

from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.registry import METHODS, REFERENCES, make_method
from wgsss.scene import MATERIALS
from wgsss.study.light_types import light_types
from wgsss.viewer.command import Source
from wgsss.viewer.session import Session

imgui_bundle = pytest.importorskip("imgui_bundle")

from wgsss.viewer.panels.light import declare_light  # noqa: E402
from wgsss.viewer.panels.material import changed_table, declare_material  # noqa: E402
from wgsss.viewer.panels.method import declare_method, with_knob  # noqa: E402
from wgsss.viewer.panels.widgets import rounded  # noqa: E402

Show = Callable[[Callable[[Session], None], Session], None]


def open_slab(gpu: Gpu, *methods: Any, **options: Any) -> Session:
    return Session.open(gpu, Source("slab", vertices=300), methods, **options)


def change_knob(name: str, knobs: dict[str, Any], knob: str, value: Any) -> Any:
    """Return the value that a knob of a method has after a control has set it."""
    method: Any = make_method(name, knobs)
    return getattr(with_knob(method, next(f for f in fields(method) if f.name == knob), value), knob)


def test_knob_takes_the_next_value_that_the_method_accepts() -> None:
    assert change_knob("jimenez15", {"taps": 17}, "taps", 18) == 19, "taps are odd"
    assert change_knob("jimenez15", {"taps": 17}, "taps", 16) == 15
    assert change_knob("jimenez15", {"taps": 17}, "taps", 33) == 33
    assert change_knob("sam", {"samples": 3}, "samples", 4) == 4
    assert change_knob("jensen02", {}, "epsilon", 0.3) == 0.3
    with pytest.raises(InputError, match="between"):
        change_knob("jimenez15", {"taps": 65}, "taps", 66)


def test_changing_a_knob_keeps_the_others() -> None:
    method: Any = make_method("sam", {"samples": 5, "surface": "screen"})
    knob = next(f for f in fields(method) if f.name == "samples")
    assert with_knob(method, knob, 9) == make_method("sam", {"samples": 9, "surface": "screen"})


def test_sliders_round_to_four_digits() -> None:
    assert (rounded(0.123456), rounded(12345.6), rounded(1e-9)) == (0.1235, 12350.0, 1e-9)


def test_changing_a_coefficient_keeps_the_rest_of_a_material(gpu: Gpu) -> None:
    session = open_slab(gpu)
    session.set_material(
        {"preset": "ketchup", "roughness": 0.31, "specular": 0.5, "base_color": [0.5, 0.6, 0.7], "eta": 1.4}
    )
    before = session.scene.objects[0].material
    session.set_material(changed_table(before, {"sigma_a": [0.1, 0.2, 0.3]}))
    after = session.scene.objects[0].material
    assert after.sigma_a == (0.1, 0.2, 0.3)
    for name in ("sigma_s_prime", "eta", "roughness", "specular", "base_color", "color_after"):
        assert getattr(after, name) == getattr(before, name)
    assert "base_color" not in changed_table(MATERIALS["skin1"], {}), "a texture would be lost"


@pytest.fixture
def show() -> Iterator[Show]:
    """Declare a panel of a session for a few frames, without a window and without input."""
    imgui, implot = imgui_bundle.imgui, imgui_bundle.implot
    context = imgui.create_context()
    imgui.set_current_context(context)
    plots = implot.create_context()
    imgui.get_io().backend_flags |= imgui.BackendFlags_.renderer_has_textures
    imgui.get_io().display_size = 400, 800
    imgui.get_io().set_ini_filename("")

    def declare(panel: Callable[[Session], None], session: Session) -> None:
        for _ in range(3):
            imgui.new_frame()
            imgui.begin("panel")
            panel(session)
            imgui.end()
            imgui.end_frame()
        assert not session.notes

    yield declare
    implot.destroy_context(plots)
    imgui.destroy_context(context)


@pytest.mark.parametrize("name", [*METHODS, *REFERENCES, "texture+none"])
def test_showing_a_method_keeps_its_knobs(gpu: Gpu, show: Show, name: str) -> None:
    session = open_slab(gpu, make_method(name), make_method(name))
    method = session.methods[1]
    show(lambda session: declare_method(session, 1), session)
    assert session.methods[1] is method


@pytest.mark.parametrize("kind", ["of the scene", "directional", "point", "area", "environment"])
def test_showing_a_light_keeps_it(gpu: Gpu, show: Show, kind: str) -> None:
    session = open_slab(gpu)
    if kind != "of the scene":
        session.scene = replace(session.scene, lights=light_types(session.scene)[kind].lights)
    scene = session.scene
    show(declare_light, session)
    assert session.scene is scene


@pytest.mark.parametrize("name", MATERIALS)
def test_showing_a_material_keeps_it(gpu: Gpu, show: Show, name: str) -> None:
    session = open_slab(gpu, material=name)
    scene = session.scene
    show(declare_material, session)
    assert session.scene is scene
