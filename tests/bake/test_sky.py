"""The visible share of the sky, compared with closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import MATTE, WHITE, lit, plane, write_environment

from wgsss.bake.sky import sky_visibility
from wgsss.gpu import Gpu
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import EnvironmentLight, Object, Scene
from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes import sphere
from wgsss.stage import Stage

UP = np.array([[0.0, 1.0, 0.0]])
SKY = EnvironmentLight((1, 1, 1))


def ball(height: float) -> Mesh:
    """Return a ball of radius 5 mm around (0, height, 0)."""
    found = sphere(radius=5.0, vertices=4000)
    return Mesh(found.positions + np.array([0, height, 0], np.float32), found.faces, name="ball")


def wall(x: float) -> Mesh:
    """Return a practically infinite wall. It ends only towards y < 0, where no ray gets."""
    corners = np.array([[x, -1e4, -1e4], [x, -1e4, 1e4], [x, 1e4, 1e4], [x, 1e4, -1e4]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), name="wall")


def seen(found: Scene, x: tuple[float, float, float], n: np.ndarray = UP) -> float:
    return float(sky_visibility(found, found.lights, np.array([x]), n)[0])


@pytest.mark.parametrize("distance", [6.0, 10.0, 25.0])
def test_a_ball_overhead_hides_its_form_factor(distance: float) -> None:
    """The form factor of a ball straight above is (a / d)^2."""
    assert seen(lit(SKY, mesh=ball(distance)), (0, 0, 0)) == pytest.approx(1 - (5.0 / distance) ** 2, abs=0.01)


def test_a_wall_hides_half() -> None:
    assert seen(lit(SKY, mesh=wall(5.0)), (2.0, 0, 0)) == pytest.approx(0.5, abs=0.02)
    assert seen(lit(SKY, mesh=wall(5.0)), (7.0, 0, 0), np.array([[1.0, 0, 0]])) == 1.0


def test_a_convex_body_sees_the_whole_sky_from_outside_and_none_from_inside(gpu: Gpu) -> None:
    scene = lit(SKY, mesh=ball(0.0))
    stage = Stage(gpu, scene)
    assert stage.bodies[0].sky.min() > 0.995
    assert seen(scene, (1, 0, 0)) == 0.0


def test_the_hidden_part_of_the_sky_is_weighted_by_its_radiance(tmp_path: Path) -> None:
    """One half of the sky, x > 0, is three times as bright as the other, and a wall hides one half."""
    pixels = np.ones((32, 64, 3), np.float32)
    pixels[:, 32:] = 3.0
    file = write_environment(tmp_path / "sky.exr", pixels)
    for rotation, left in ((0.0, 0.25), (180.0, 0.75)):
        light = EnvironmentLight(file=file, rotation=rotation)
        assert seen(lit(light, mesh=wall(5.0)), (2.0, 0, 0)) == pytest.approx(left, abs=0.02)


def test_irradiance_of_the_sky_beside_a_ball(gpu: Gpu) -> None:
    """L_d on the ground is pi (1 - F) times the radiance of the sky; F = (a / d)^2 cos is the ball's form factor."""
    scene = lit(SKY, mesh=plane(side=60.0, cells=60), extra=(Object(ball(12.0), MATTE),))
    for method in ("lambert", "deon07"):
        image = Renderer(scene, make_method(method), (41, 41), gpu).frame(aovs=["irradiance"])
        x = (np.array([34, 37, 40]) + 0.5) / 41 * 20 - 10  # beside the ball as the camera above sees it
        d2 = np.square(x) + 12.0**2
        wanted = np.pi * (1 - 25.0 / d2 * 12.0 / np.sqrt(d2))
        np.testing.assert_allclose(image.aovs["irradiance"][20, [34, 37, 40], 1], wanted, rtol=0.01)


def test_the_reflection_of_the_sky_has_the_same_visible_share(gpu: Gpu) -> None:
    """The share is 1 less the form factor of the ball."""
    ground = plane(side=60.0, cells=60)
    both = [
        Renderer(lit(SKY, mesh=ground, material=WHITE, extra=extra), make_method("lambert"), (41, 41), gpu)
        .frame(aovs=["specular"])
        .aovs["specular"][20, [34, 37, 40], 1]
        for extra in ((Object(ball(12.0), MATTE),), ())
    ]
    d2 = np.square((np.array([34, 37, 40]) + 0.5) / 41 * 20 - 10) + 12.0**2
    assert both[1].min() > 0.0
    np.testing.assert_allclose(both[0] / both[1], 1 - 25.0 / d2 * 12.0 / np.sqrt(d2), rtol=0.01)


def test_objects_of_one_mesh_have_their_own_skies(gpu: Gpu) -> None:
    flat = plane(side=10.0, cells=4)
    scene = lit(SKY, mesh=flat, extra=(Object(flat, MATTE, translate=(0, 1, 0)),))
    stage = Stage(gpu, scene)
    lower, upper = stage.bodies
    assert lower.sky.min() < 0.1 and upper.sky.min() == 1.0
