"""Built-in scenes: names and docstrings, lights of the right magnitude, and objects that fill the image."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.builtin import SCENES, crowd
from wgsss.scene.light import DirectionalLight, EnvironmentLight, PointLight, RectLight, SphereLight
from wgsss.scene.scene import Scene

SMALL = {"slab": 200, "sphere": 200, "ear": 1000, "milk": 5000, "gyroid": 2000, "statue": 5000, "leaf": 1000}
SMALL |= {"wave": 300, "crowd": 1000, "skin-patch": 300, "organ": 300}


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    return {name: build(SMALL[name]) for name, build in SCENES.items()}


def test_names_in_order_and_docstrings_of_one_line(scenes: dict[str, Scene]) -> None:
    first = ["slab", "sphere", "ear", "milk", "gyroid", "statue", "leaf", "wave", "crowd"]
    assert list(SCENES) == [*first, "skin-patch", "organ"]
    assert [scene.name for scene in scenes.values()] == list(SCENES)
    for build in SCENES.values():
        assert build.__doc__ and "\n" not in build.__doc__


@pytest.mark.parametrize("name", SCENES)
def test_the_camera_frames_the_objects_with_a_small_margin(scenes: dict[str, Scene], name: str) -> None:
    scene = scenes[name]
    low, high = [], []
    for time_s in np.linspace(0, 4, 9):
        still = scene.at(time_s)
        points = np.concatenate([o.placed for o in still.objects])
        clip = (
            np.column_stack([points, np.ones(len(points))])
            @ (still.camera.projection(1.0, 1, 1e5) @ still.camera.view()).T
        )
        assert (clip[:, 3] > 0).all()
        low.append((clip[:, :2] / clip[:, 3:]).min(axis=0))
        high.append((clip[:, :2] / clip[:, 3:]).max(axis=0))
    low, high = np.min(low, axis=0), np.max(high, axis=0)
    assert np.abs([low, high]).max() == pytest.approx(1 / 1.08, abs=0.02)
    assert low == pytest.approx(-high, abs=0.12), "the objects are centred"


def irradiance(scene: Scene) -> float:
    """Compute the irradiance, W/m^2, green, of all lights except the environment on facing surfaces at the centre."""
    middle, total = scene.bounds.mean(axis=0), 0.0
    for light in scene.lights:
        match light:
            case DirectionalLight():
                total += light.irradiance[1]
            case PointLight():
                total += light.intensity[1] / (np.sum((middle - light.position) ** 2) * 1e-6)
            case SphereLight():
                total += light.radiance[1] * np.pi * light.radius**2 / np.sum((middle - light.position) ** 2)
            case RectLight():
                to = middle - np.array(light.position)
                cosine = to @ light.direction / np.linalg.norm(to) / np.linalg.norm(light.direction)
                total += light.radiance[1] * light.width * light.height * cosine / (to @ to)
    return total


@pytest.mark.parametrize("name", SCENES)
def test_lights_suit_an_exposure_of_zero(scenes: dict[str, Scene], name: str) -> None:
    assert 2 < irradiance(scenes[name]) < 16
    for light in scenes[name].lights:
        if isinstance(light, EnvironmentLight):
            assert 0.05 < max(light.radiance) < 0.6


def test_every_kind_of_light_appears(scenes: dict[str, Scene]) -> None:
    kinds = {type(light) for scene in scenes.values() for light in scene.lights}
    assert kinds == {DirectionalLight, PointLight, RectLight, SphereLight, EnvironmentLight}


def test_wave_moves_from_its_rest_pose(scenes: dict[str, Scene]) -> None:
    wave = scenes["wave"]
    rest, start, later = (s.objects[0].mesh for s in (wave, wave.at(0), wave.at(0.7)))
    assert start.positions == pytest.approx(rest.positions, abs=1e-4)
    assert np.array_equal(later.faces, rest.faces)
    assert np.abs(later.positions - rest.positions).max() > 5


@pytest.mark.parametrize("copies", [1, 2, 4, 7, 16])
def test_crowd_shares_one_mesh_and_stands_apart(copies: int) -> None:
    scene = crowd(1000, copies=copies)
    assert len(scene.objects) == copies
    assert len({id(o.mesh) for o in scene.objects}) == 1
    places = np.array([o.translate for o in scene.objects])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)[~np.eye(copies, dtype=bool)]
    assert apart.size == 0 or apart.min() > 220


def test_bad_vertex_counts_are_errors() -> None:
    with pytest.raises(InputError, match="copies must be a whole number from 1 to 16, not 17"):
        crowd(copies=17)
    with pytest.raises(InputError, match="ear: vertices must be a whole number from 500 to 500000, not 3"):
        SCENES["ear"](3)
