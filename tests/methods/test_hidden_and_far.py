"""Bodies that a motion hides by scaling them to zero, and scenes far from the origin, by every method."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from wgsss.gpu import Gpu
from wgsss.reference.integral import Integral
from wgsss.registry import METHODS, make_method
from wgsss.rendering import AOVS, Renderer
from wgsss.scene import (
    MATERIALS,
    DirectionalLight,
    EnvironmentLight,
    Object,
    PerspectiveCamera,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
)
from wgsss.scene.shapes import sphere
from wgsss.stage import Stage

SIZE = (24, 24)
BALL = sphere(radius=10.0, vertices=300)
SUN = DirectionalLight((0.3, -0.4, -1.0), (2.0, 2.0, 2.0))
KNOBS: dict[str, dict[str, Any]] = {name: {"map_size": 128} for name in ("deon07", "jimenez08", "oat06")}


@dataclass(frozen=True)
class Vanishing:
    """Visible up to half a second, then scaled to zero, as glTF files hide parts."""

    period_s: float = 1.0

    def apply(self, positions: Any, time_s: float) -> Any:
        return np.asarray(positions, np.float32) * np.float32(time_s % 1.0 < 0.5) + np.float32([0, 0, 1])


def two(gpu: Gpu, name: str) -> Renderer:
    """A ball that stays, and one to its right that vanishes."""
    camera = PerspectiveCamera((0, 0, 90), (0, 0, 0))
    stays = Object(BALL, MATERIALS["marble"], translate=(-12, 0, 0))
    goes = Object(BALL, MATERIALS["skin1"], translate=(12, 0, 0), motion=Vanishing())
    scene = Scene("two", (stays, goes), (SUN, EnvironmentLight((0.2, 0.2, 0.2))), camera)
    return Renderer(scene, make_method(name, KNOBS.get(name)), SIZE, gpu)


@pytest.mark.parametrize("name", METHODS)
def test_bodies_scaled_to_zero_are_not_drawn(gpu: Gpu, name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        renderer = two(gpu, name)
        there, gone, again = (renderer.frame(time_s, aovs=AOVS) for time_s in (0.25, 0.75, 1.25))
    assert there.pixels[12, 15:, 3].max() == 1 and gone.pixels[12, 15:, 3].max() == 0
    for values in (gone.pixels, *(gone.aovs[a] for a in AOVS if a != "depth")):
        assert np.isfinite(values).all()
    assert gone.pixels[12, 5:8] == pytest.approx(there.pixels[12, 5:8], rel=0.02), "the other one stays as it is"
    np.testing.assert_allclose(again.pixels, there.pixels, rtol=1e-4, atol=1e-5)  # sam keeps a share of M_back


def test_the_reference_leaves_out_bodies_scaled_to_zero(gpu: Gpu) -> None:
    stage = Stage(gpu, two(gpu, "lambert").stage.rest, time_s=0.75)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found = Integral(samples=2000, tolerance=0.1).estimate(stage, SIZE)
    assert np.isfinite(found.M).all() and found.M[12, 15:].max() == 0 and found.M[12, 5:8].min() > 0


def lit_ball(offset: tuple[float, float, float]) -> Scene:
    def at(*point: float) -> tuple[float, float, float]:
        x, y, z = (p + o for p, o in zip(point, offset, strict=True))
        return x, y, z

    lights = (
        SUN,
        PointLight(at(40, 20, 30), (2e-3, 1e-3, 1e-3)),
        RectLight(at(-40, 0, 30), (1, 0, -0.7), (0, 1, 0), 20, 20, (2, 1, 1), samples=4),
        SphereLight(at(0, 60, 0), 5, (10, 10, 10), samples=4),
    )
    camera = PerspectiveCamera(at(20, 10, 60), at(0, 0, 0), fov=25)
    return Scene("far", (Object(BALL, MATERIALS["marble"], translate=at(0, 0, 0)),), lights, camera)


@pytest.mark.parametrize("name", METHODS)
def test_a_scene_a_kilometre_away_is_drawn_as_at_the_origin(gpu: Gpu, name: str) -> None:
    here, there = (
        Renderer(lit_ball(offset), make_method(name, KNOBS.get(name)), SIZE, gpu).frame().pixels
        for offset in ((0.0, 0.0, 0.0), (1048576.0, -524288.0, 262144.0))
    )
    np.testing.assert_allclose(there, here, rtol=1e-4, atol=1e-5)


def test_a_scene_near_the_origin_is_not_moved() -> None:
    scene = lit_ball((30.0, 0.0, 0.0))
    assert scene.near_origin() is scene
    turned = replace(scene, camera=replace(scene.camera, turn=10.0))
    assert turned.near_origin().camera.turn == 10.0
