"""Pairs of a surface method and a translucency method: passes, knobs, names, sweeps and the knob `surface`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.frame import Frame, begin
from wgsss.gpu import Gpu
from wgsss.graph import Graph, Handle
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
    """A translucency method that reads the irradiance maps of texture-space diffusion."""

    source: ClassVar[str] = "a test"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()
    beside: ClassVar[type] = TextureSpace

    def bake(self, stage: Stage) -> None:
        pass

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        assert isinstance(surface, TextureSpace)
        return surface.blurs(frame, frame.stage.bodies[0])[0]


def test_M_front_is_that_of_the_first_part_and_M_back_that_of_the_second(gpu: Gpu) -> None:
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


def test_the_name_of_a_method_creates_the_same_method() -> None:
    names = {name_of(make_method(f"{surface}+none")): kind for surface, kind in SURFACES.items()}
    assert list(names.values()) == list(SURFACES.values())
    for name in (*METHODS, *names, "screen+sam"):
        assert name_of(make_method(name)) == name
        assert kind_of(name) is type(make_method(name))


def test_a_pair_that_is_a_named_method_goes_by_that_name() -> None:
    assert name_of(make_method("none+none")) == "lambert"
    assert name_of(make_method("texture+tsm")) == "deon07"
    assert name_of(make_method("texture+sam", {"map_size": 256})) == "sam"


def test_knobs_of_both_parts_of_a_named_pair_can_be_set() -> None:
    assert make_method("sam", {"map_size": 256, "samples": 4}) == make_method(
        "texture+sam", {"map_size": 256, "samples": 4}
    )


@pytest.mark.parametrize("name", ["sam", "screen+sam", "none+sam"])
@pytest.mark.parametrize("surface", SURFACES)
def test_the_knob_surface_replaces_the_surface_method_of_a_pair(name: str, surface: str) -> None:
    method = make_method(name, {"surface": surface, "samples": 8})
    assert method == make_method(f"{surface}+sam", {"samples": 8})
    assert name_of(method) == name_of(make_method(f"{surface}+sam"))


def test_the_knobs_of_the_new_surface_method_can_be_set_beside_it() -> None:
    knobs = {"surface": "screen", "kernel": "svd", "taps": 9}
    assert make_method("sam", knobs) == make_method("screen+sam", {"kernel": "svd", "taps": 9})
    assert name_of(make_method("sam", knobs)) == "screen+sam"


@pytest.mark.parametrize(
    ("name", "knobs", "message"),
    [
        ("sam", {"surface": "paper"}, "unknown surface 'paper'"),
        ("sam", {"surface": 3}, "unknown surface '3'"),
        ("sam", {"surface": "screen", "map_size": 64}, r"unknown knob of screen\+sam 'map_size'"),
        ("sam", {"surfaces": "screen"}, "unknown knob of sam 'surfaces'; did you mean 'surface'"),
        ("deon07", {"surface": "screen"}, "translucency tsm goes with surface texture, not with screen"),
        ("lambert", {"surface": "screen"}, "unknown knob of lambert 'surface'"),
    ],
)
def test_a_surface_that_does_not_fit_is_refused(name: str, knobs: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_method(name, knobs)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("paper+sam", "unknown surface 'paper'"),
        ("texture+paper", "unknown translucency 'paper'"),
        ("sam+texture", "unknown surface 'sam'"),
        ("+sam", "unknown surface ''"),
        ("screen+tsm", "translucency tsm goes with surface texture, not with screen"),
    ],
)
def test_names_that_are_no_pair_are_refused(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_method(name)


def test_passes_that_both_parts_read_are_declared_once(gpu: Gpu) -> None:
    kind = pair(TextureSpace, Reader)
    graph = Renderer(load_scene("slab", vertices=300), kind(map_size=64), (8, 8), gpu).frame().graph  # type: ignore[call-arg]
    assert sum(item.module.name == "texture_space/dilate" for item in graph.passes) == 1


def test_pairs_of_one_frame_share_the_passes_of_their_translucency_method(gpu: Gpu) -> None:
    """So both are blended with the last frame, which one estimate for each pair would advance twice."""
    stage = Stage(gpu, load_scene("slab", vertices=300))
    graph = Graph(gpu)
    frame = begin(graph, stage, (8, 8))
    knobs = {"select": "top", "samples": 2}
    first, second = (make_method(name, knobs).passes(frame) for name in ("none+sam", "screen+sam"))
    assert first.M_back == second.M_back and first.M_front != second.M_front
    assert sum(item.module.name == "sam/gather" for item in graph.passes) == 1


def test_the_sweep_of_a_pair_varies_the_knobs_of_both_parts() -> None:
    specs = _specs(load_scene("slab", vertices=300), ["screen+sam"], (8, 8), "integral")
    assert [(spec.knobs["taps"], spec.knobs["samples"]) for spec in specs] == [
        (9, 3),
        (17, 3),
        (33, 3),
        (65, 3),
        (0, 8),
    ]


def test_the_sweep_of_sam_goes_over_surface_methods_and_its_runs_keep_the_name_sam() -> None:
    specs = _specs(load_scene("slab", vertices=300), ["sam"], (8, 8), "integral")
    assert [(spec.method, *(spec.knobs[knob] for knob in ("surface", "samples", "select"))) for spec in specs] == [
        ("sam", "screen", 3, "fit"),
        ("sam", "screen", 8, "fit"),
        ("sam", "texture", 3, "fit"),
        ("sam", "texture", 8, "fit"),
        ("sam", "texture", 3, "top"),
        ("sam", "texture", 3, "coarse"),
    ]
    for spec in specs:  # the knobs of a run create its method
        assert name_of(make_method(spec.method, spec.knobs)) == ("sam", "screen+sam")[spec.knobs["surface"] == "screen"]
