"""The comparison with a reference: its measurements, and the types of light."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import HAS_FLIP
from scenes import MATTE, lit, plane
from standins import ERROR, FACTOR, Scaled, Volume, lambert

from wgsss.errors import InputError
from wgsss.registry import REFERENCES, make_method
from wgsss.scene import DirectionalLight, EnvironmentLight, Object, PerspectiveCamera, PointLight, RectLight, Scene
from wgsss.scene.shapes import sphere
from wgsss.study import compare as module
from wgsss.study.compare import compare, named
from wgsss.study.light_types import light_types, mean_irradiance

SIZE = (32, 24)
SUN = DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0))


@pytest.fixture(autouse=True)
def references(monkeypatch):
    monkeypatch.setitem(REFERENCES, "integral", Scaled)
    monkeypatch.setitem(REFERENCES, "volume", Volume)
    monkeypatch.setattr(module, "WARM_FRAMES", 1)


def ball(*lights) -> Scene:
    camera = PerspectiveCamera((0, 0, 90), (0, 0, 0), fov=20.0)
    return Scene("ball", (Object(sphere(radius=10.0, vertices=600), MATTE),), lights, camera)


def test_errors_are_those_of_M():
    """The M of Lambert is 1/FACTOR of the reference's everywhere, so that all measures are known."""
    found = compare(lit(SUN), ["lambert"], size=SIZE)
    (run,) = found.runs
    M = lambert(lit(SUN), SIZE)
    np.testing.assert_array_equal(run.M, M)
    assert run.errors.rel_rmse == pytest.approx(1 - 1 / FACTOR, rel=1e-5)
    assert run.errors.bias == pytest.approx(1 / FACTOR, rel=1e-5)
    assert run.errors.floor == pytest.approx(ERROR / FACTOR, rel=1e-5)
    mean = math.sqrt(np.square(M[found.mask]).mean()) * (FACTOR - 1)
    assert run.errors.psnr == pytest.approx(20 * math.log10(FACTOR * M.max() / mean), rel=1e-5)
    assert not HAS_FLIP or 0.0 < run.errors.flip < 0.5
    assert found.mask.any() and found.image.aovs["error"].shape == (24, 32, 3)


def test_json_has_the_keys_that_scripts_read():
    found = json.loads(json.dumps(compare(lit(SUN), ["lambert"], size=SIZE).json(), allow_nan=False))
    assert list(found) == ["scene", "reference", "adapter", "size", "methods"]
    assert (found["scene"], found["reference"], found["size"]) == ("test", "integral", [32, 24])
    (run,) = found["methods"]
    assert run.keys() == set("scene name method knobs size adapter bake_ms frame_ms passes bytes error".split())
    assert run["error"].keys() - {"flip_reason"} == {"rel_rmse", "psnr", "psnr_all", "bias", "flip", "floor"}
    assert run["frame_ms"] == pytest.approx(sum(run["passes"].values())) and "lambert/reflect" in run["passes"]
    assert run["bytes"] > 32 * 24 * 16  # a frame holds more than M


def test_a_reference_against_itself_has_no_error():
    (run,) = compare(lit(SUN), [Scaled(1.0)], Scaled(1.0), SIZE).runs
    assert (run.errors.rel_rmse, run.errors.psnr, run.errors.flip) == (0.0, math.inf, 0.0 if HAS_FLIP else None)
    assert run.errors.json()["psnr"] is None


def test_the_reference_computes_its_estimate_once(monkeypatch):
    asked = []
    estimate = Scaled.estimate
    monkeypatch.setattr(Scaled, "estimate", lambda self, *where: asked.append(where) or estimate(self, *where))
    found = compare(lit(SUN), ["lambert"], size=SIZE)
    assert len(asked) == 1
    assert found.image.metadata["method"] == "integral" and found.image.metadata["knobs"] == f"factor={FACTOR}"
    np.testing.assert_array_equal(found.image.aovs["M_front"], found.truth.M)


def test_relative_errors_are_undefined_without_light():
    (run,) = compare(lit(), ["lambert"], size=SIZE).runs
    assert run.errors.rel_rmse is None and run.errors.bias is None
    assert run.errors.flip == (0.0 if HAS_FLIP else None)


def test_time_moves_the_scene():
    camera = PerspectiveCamera((0, 0, 90), (0, 0, 0), fov=20.0, turn=90.0)
    scene = replace(ball(DirectionalLight((0, 0, -1), (1, 1, 1))), camera=camera)
    lights = [compare(scene, ["lambert"], "integral", SIZE, time).runs[0].M.sum() for time in (0.0, 2.0)]
    assert lights[0] > 1.0 and lights[1] < 1e-6 * lights[0]  # two seconds later the eye is on the dark side


def test_a_method_with_other_knobs_is_another_method():
    methods = [make_method("deon07", {"map_size": n}) for n in (64, 128, 64)] + [make_method("lambert")]
    assert list(named(methods)) == ["deon07 map_size=64", "deon07 map_size=128", "lambert"]


def test_unknown_names():
    with pytest.raises(InputError, match="unknown reference 'lambert'"):
        compare(lit(SUN), ["lambert"], "lambert", SIZE)
    with pytest.raises(InputError, match="unknown method 'lambrt'; did you mean 'lambert'"):
        compare(lit(SUN), ["lambrt"], size=SIZE)


def test_mean_irradiance_in_closed_form():
    """A plane that faces the light; a ball in parallel light has a quarter; under a sky it is pi times the radiance."""
    floor = lit(mesh=plane(2.0))
    assert mean_irradiance(floor, (DirectionalLight((0, -1, 0), (1, 2, 3)),)) == pytest.approx(2.0)
    assert mean_irradiance(floor, (DirectionalLight((0, -1, 1), (2, 2, 2)),)) == pytest.approx(math.sqrt(2.0))
    assert mean_irradiance(floor, (PointLight((0, 500, 0), (1, 1, 1)),)) == pytest.approx(4.0, rel=1e-4)
    patch = RectLight((0, 500, 0), (0, -1, 0), (0, 0, 1), 10, 10, (1, 1, 1))
    assert mean_irradiance(floor, (patch,)) == pytest.approx(1e-4 / 0.25, rel=1e-3)
    assert mean_irradiance(floor, (EnvironmentLight((1, 2, 3)),)) == pytest.approx(2 * math.pi)
    wall = Object(plane(4.0, cells=1), MATTE, rotate=(90, 0, 0))  # four times as large, in grazing light
    both = lit(mesh=plane(2.0), extra=(wall,))
    assert mean_irradiance(both, (DirectionalLight((0, -1, 0), (1, 1, 1)),)) == pytest.approx(0.2)
    light = DirectionalLight((1, 2, -3), (8, 8, 8))
    assert mean_irradiance(ball(), (light,)) == pytest.approx(2.0, rel=0.01)


def test_lights_of_all_types_give_the_same_mean_irradiance():
    scene = ball(SUN, EnvironmentLight((0.1, 0.1, 0.1)))
    found = light_types(scene)
    assert list(found) == ["directional", "point", "area", "environment"]
    wanted = mean_irradiance(scene, scene.lights)
    for name, other in found.items():
        assert other.name == f"ball, {name}" and len(other.lights) == 1 and other.objects is scene.objects
        assert mean_irradiance(other, other.lights) == pytest.approx(wanted)
    # From behind: what faces the viewer, here along +z, is lit from the far side.
    assert found["directional"].lights[0].direction[2] > 0.0
    for name in ("point", "area"):
        assert found[name].lights[0].position[2] < -10.0
    M = lambert(found["environment"], SIZE)[12, 16, 0] / MATTE.profile.total[0]
    assert 0.9 * wanted < M < wanted  # the light that enters through the surface, at the image centre
