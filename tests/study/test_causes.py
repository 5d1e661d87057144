"""Errors by cause: vectors computed by hand, and a chain of replaced integrals."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from scenes import MATTE, lit, write_environment

from wgsss.errors import InputError
from wgsss.optics import Dipole
from wgsss.scene import MATERIALS, DirectionalLight, EnvironmentLight
from wgsss.study import causes as module
from wgsss.study.causes import CAUSES, SUNS, causes, photon_profiles, split, suns, with_suns

SEEN = np.ones((1, 2), bool)


def pixels(*values: float) -> np.ndarray:
    return np.array(values)[None, :, None] * np.ones(3)


def test_split_by_hand():
    """Orthogonal errors of 3 and 4 of 10 give 5 of 10, to which they contribute 9/5 and 16/5."""
    volume = pixels(6.0, 8.0)  # mean square 50
    by_photons = volume + pixels(0.0, 4.0)
    method = by_photons + pixels(3.0, 0.0)
    found = split([method, by_photons, by_photons, by_photons, volume], SEEN)
    assert found.total == pytest.approx(0.5)
    assert found.own == pytest.approx({"method": 0.3, "profile": 0.0, "occlusion": 0.0, "diffusion": 0.4})
    assert found.part == pytest.approx({"method": 0.18, "profile": 0.0, "occlusion": 0.0, "diffusion": 0.32})


def test_errors_that_compensate_each_other():
    volume = pixels(1.0, 1.0)
    found = split([volume * 1.1, volume * 1.4, volume, volume, volume], SEEN)
    assert found.total == pytest.approx(0.1)
    assert found.own["method"] == pytest.approx(0.3) and found.own["profile"] == pytest.approx(0.4)
    assert found.part["method"] == pytest.approx(-0.3) and found.part["profile"] == pytest.approx(0.4)
    assert split([volume] * 5, SEEN).part == dict.fromkeys(CAUSES, 0.0)


def test_parts_sum_to_the_whole():
    rng = np.random.default_rng(1)
    steps = [rng.random((5, 7, 3)) + 1.0 for _ in range(5)]
    seen = rng.random((5, 7)) < 0.7
    found = split(steps, seen)
    assert sum(found.part.values()) == pytest.approx(found.total)
    whole = (steps[0] - steps[-1])[seen]
    assert found.total == pytest.approx(np.sqrt((whole**2).mean() / (steps[-1][seen] ** 2).mean()))


@pytest.fixture
def integral(monkeypatch):
    """Replace the integral: 3 with the profiles of the materials, 2 with others, and 1 less without an environment."""
    asked = []

    def integral(stage, size, *, profiles=None, **knobs):
        asked.append((stage.scene, profiles, stage.time_s))
        M = (3.0 if profiles is None else 2.0) - (not stage.environments())
        return SimpleNamespace(M=np.full((size[1], size[0], 3), M))

    stand_in = ModuleType("wgsss.reference.integral")
    stand_in.integral = integral
    monkeypatch.setitem(sys.modules, "wgsss.reference.integral", stand_in)
    monkeypatch.setattr(module, "photon_profiles", lambda scene: {0: MATERIALS["skin1"].profile})
    return asked


def test_chain_from_method_to_volume(integral):
    sky, seen = lit(EnvironmentLight((1, 1, 1))), np.ones((2, 3), bool)
    found = causes(sky, {"a": np.full((2, 3, 3), 3.5)}, np.full((2, 3, 3), 0.5), seen, (3, 2), time=1.5)["a"]
    assert found.own == pytest.approx({"method": 1.0, "profile": 2.0, "occlusion": 2.0, "diffusion": 1.0})
    assert found.part == pytest.approx(found.own) and found.total == pytest.approx(6.0)
    (_, own, _), (_, photons, _), (shadowed, again, _) = integral
    assert own is None and photons is again and {time for *_, time in integral} == {1.5}
    assert all(isinstance(light, DirectionalLight) for light in shadowed.lights)


def test_occlusion_is_no_cause_without_a_sky(integral):
    scene = lit(DirectionalLight((0, -1, 0), (1, 1, 1)))
    found = causes(scene, {"a": np.full((2, 3, 3), 2.0)}, np.full((2, 3, 3), 0.5), np.ones((2, 3), bool), (3, 2))["a"]
    assert found.own["occlusion"] == 0.0 and len(integral) == 2


def test_a_black_volume_has_no_causes(integral):
    black = np.zeros((2, 3, 3))
    assert causes(lit(), {"a": black + 1.0}, black, np.ones((2, 3), bool), (3, 2)) == {} and not integral


def test_photons_are_traced_once_per_material(monkeypatch):
    monkeypatch.setattr(module, "PHOTONS", 20_000)
    skin = MATERIALS["skin1"]
    scene = lit(material=skin)
    two = replace(scene, objects=scene.objects * 2)
    found = photon_profiles(two)
    assert list(found) == [0, 1] and found[0] is found[1]
    dipole = Dipole(skin.sigma_a, skin.sigma_s_prime, skin.eta)
    np.testing.assert_allclose(found[0].total, dipole.total, rtol=0.25)
    with pytest.raises(InputError, match="material 'white' is known by its profile only"):
        photon_profiles(lit(material=MATTE))


def test_suns_together_have_the_light_of_the_sky(tmp_path):
    towards, irradiance = suns([EnvironmentLight((1.0, 2.0, 3.0))])
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 1.0)
    up = np.maximum(towards[:, 1], 0.0)
    np.testing.assert_allclose(irradiance.sum(axis=0), 4 * np.pi * np.array([1, 2, 3]))
    np.testing.assert_allclose(up @ irradiance, np.pi * np.array([1, 2, 3]), rtol=2e-3)

    image = np.zeros((32, 64, 3), np.float32)
    image[15:17, 47:49] = (1.0, 0.5, 0.25)  # u = 3/4, v = 1/2: towards +x
    file = write_environment(tmp_path / "spot.exr", image)
    solid_angle = 4 * (np.pi / 32) * (2 * np.pi / 64)
    for rotation, axis in ((0.0, (1, 0, 0)), (90.0, (0, 0, -1))):
        towards, irradiance = suns([EnvironmentLight(file=file, rotation=rotation)])
        lit_by = irradiance[:, 0] > 0.0
        assert 1 <= lit_by.sum() <= 4 and (towards[lit_by] @ axis).min() > 0.9
        np.testing.assert_allclose(irradiance.sum(axis=0), solid_angle * np.array([1, 0.5, 0.25]), rtol=0.01)


def test_only_environments_become_suns():
    key = DirectionalLight((0, -1, 0), (1, 1, 1))
    assert with_suns(lit(key)).lights == (key,)
    found = with_suns(lit(key, EnvironmentLight((0.1, 0.1, 0.1))))
    assert found.lights[0] is key and len(found.lights) == 1 + SUNS
    assert len(with_suns(lit(key, EnvironmentLight((0.0, 0.0, 0.0)))).lights) == 1
