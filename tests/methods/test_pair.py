"""Methods of two parts: each part does what it does alone, and the knobs are those of both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.frame import Frame
from wgsss.gpu import Gpu
from wgsss.graph import Handle
from wgsss.methods import Method
from wgsss.methods.lambert import Lambert
from wgsss.methods.pair import pair
from wgsss.methods.texture_space import TextureSpace
from wgsss.registry import METHODS, SURFACES, kind_of, make_method, name_of
from wgsss.rendering import Renderer
from wgsss.scene import load_scene
from wgsss.stage import Stage
from wgsss.study.bench import _specs


@dataclass(frozen=True)
class Reader:
    """A translucency that reads the maps of texture-space diffusion."""

    source: ClassVar[str] = "a test"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()
    beside: ClassVar[type] = TextureSpace

    def bake(self, stage: Stage) -> None:
        pass

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        assert isinstance(surface, TextureSpace)
        return surface.blurs(frame, frame.stage.bodies[0])[0]


def test_front_is_the_surfaces_and_back_the_translucencys(gpu: Gpu) -> None:
    scene = load_scene("slab", vertices=300)

    def slots(method: Method) -> dict[str, Any]:
        return Renderer(scene, method, (24, 24), gpu).frame(aovs=["M_front", "M_back"]).aovs

    both = slots(make_method("none+sam", {"samples": 2, "select": "top"}))
    np.testing.assert_array_equal(both["M_front"], slots(Lambert())["M_front"])
    np.testing.assert_array_equal(both["M_back"], slots(make_method("sam", {"samples": 2, "select": "top"}))["M_back"])
    assert both["M_back"].max() > 0.0


def test_knobs_are_those_of_both_parts() -> None:
    method = make_method("screen+sam", {"taps": "9", "samples": 4})
    assert vars(method) == {"taps": 9, "kernel": "line-spread", "samples": 4, "select": "fit"}
    with pytest.raises(InputError, match=r"unknown knob of screen\+sam 'map_size'"):
        make_method("screen+sam", {"map_size": 64})


def test_names_and_kinds_go_both_ways() -> None:
    names = {name_of(make_method(f"{surface}+none")): kind for surface, kind in SURFACES.items()}
    assert list(names.values()) == list(SURFACES.values())
    for name in (*METHODS, *names, "screen+sam"):
        assert name_of(make_method(name)) == name
        assert kind_of(name) is type(make_method(name))


def test_presets_are_found_by_the_pair_that_they_are() -> None:
    assert name_of(make_method("none+none")) == "lambert"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("paper+sam", "unknown surface 'paper'"),
        ("texture+paper", "unknown translucency 'paper'"),
        ("sam+texture", "unknown surface 'sam'"),
        ("+sam", "unknown surface ''"),
        ("screen+tsm", "translucency tsm goes with surface texture, not with screen"),
    ],
)
def test_what_is_no_pair_is_refused(name: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make_method(name)


def test_what_both_parts_read_is_declared_once(gpu: Gpu) -> None:
    kind = pair(TextureSpace, Reader)
    graph = Renderer(load_scene("slab", vertices=300), kind(map_size=64), (8, 8), gpu).frame().graph  # type: ignore[call-arg]
    assert sum(item.module.name == "texture_space/dilate" for item in graph.passes) == 1


def test_a_pair_is_swept_over_the_settings_of_both() -> None:
    specs = _specs(load_scene("slab", vertices=300), ["screen+sam"], (8, 8), "integral")
    assert [(spec.knobs["taps"], spec.knobs["samples"]) for spec in specs] == [
        (9, 3),
        (17, 3),
        (33, 3),
        (65, 3),
        (0, 8),
    ]
