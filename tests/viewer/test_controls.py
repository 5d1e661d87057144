"""What a pointer does to cameras and lights, in closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RectLight,
    load_scene,
)
from wgsss.viewer import controls

FRONT = PerspectiveCamera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), fov=30.0)
FLAT = OrthographicCamera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), height=50.0)


def on_screen(camera: Any, point: Any) -> Any:
    """Where a point is, in heights from the middle."""
    clip = camera.projection(1.0, 1.0, 1e4) @ camera.view() @ np.append(point, 1.0)
    return clip[:2] / clip[3] / 2.0


def test_an_orbit_to_the_right_shows_more_of_the_left_side() -> None:
    turned = controls.orbit(FRONT, 0.25, 0.0)
    np.testing.assert_allclose(turned.eye, (-100 / math.sqrt(2), 0.0, 100 / math.sqrt(2)), atol=1e-12)
    assert on_screen(turned, (0.0, 0.0, 10.0))[0] > 0.0, "what is in front follows the pointer"


def test_an_orbit_up_goes_below_and_stops_before_the_pole() -> None:
    np.testing.assert_allclose(controls.orbit(FRONT, 0.0, 1 / 6).eye, (0.0, -50.0, 50.0 * math.sqrt(3)), atol=1e-9)
    eye = controls.orbit(FRONT, 0.0, 2.0).eye
    assert eye[1] == pytest.approx(-100.0 * math.sin(math.radians(controls.STEEPEST)))
    assert np.linalg.norm(eye) == pytest.approx(100.0)


@pytest.mark.parametrize("camera", [FRONT, FLAT, controls.orbit(FRONT, 0.1, 0.15)])
def test_a_pan_takes_the_target_along_with_the_pointer(camera: Any) -> None:
    moved = controls.pan(camera, 0.2, -0.1)
    np.testing.assert_allclose(on_screen(moved, camera.target), (0.2, -0.1), atol=1e-12)
    np.testing.assert_allclose(np.subtract(moved.eye, moved.target), np.subtract(camera.eye, camera.target))


@pytest.mark.parametrize("camera", [FRONT, FLAT])
def test_a_zoom_scales_the_picture_at_the_target(camera: Any) -> None:
    point = (3.0, -2.0, 0.0)
    np.testing.assert_allclose(on_screen(controls.zoom(camera, 2.0), point), 2.0 * on_screen(camera, point))


def test_a_focus_puts_a_point_in_the_middle_at_the_same_distance() -> None:
    camera = controls.focus(FRONT, (1.0, 2.0, 3.0))
    np.testing.assert_allclose(on_screen(camera, (1.0, 2.0, 3.0)), 0.0, atol=1e-12)
    assert camera.eye == (1.0, 2.0, 103.0)


def test_a_light_in_front_goes_where_the_pointer_goes() -> None:
    sun = DirectionalLight((0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
    np.testing.assert_allclose(controls.turn_light(sun, FRONT, 0.5, 0.0, (0, 0, 0)).direction, (-1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(controls.turn_light(sun, FRONT, 0.0, 0.5, (0, 0, 0)).direction, (0, -1, 0), atol=1e-12)
    lamp = PointLight((1.0, 0.0, 50.0), (1.0, 1.0, 1.0))
    moved = controls.turn_light(lamp, FRONT, 0.5, 0.0, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(moved.position, (51.0, 0.0, 0.0), atol=1e-12)


def test_a_rectangle_goes_on_facing_what_it_faced() -> None:
    light = RectLight((0.0, 0.0, 50.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 10.0, 20.0, (1.0, 1.0, 1.0))
    moved = controls.turn_light(light, FRONT, 0.3, 0.2, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(np.multiply(moved.direction, -50.0), moved.position, atol=1e-12)
    assert abs(np.dot(moved.direction, moved.up)) < 1e-12


def test_an_environment_turns_about_the_vertical() -> None:
    light = EnvironmentLight(rotation=350.0)
    assert controls.turn_light(light, FRONT, 0.5, 0.7, (0, 0, 0)).rotation == pytest.approx(80.0)


@pytest.mark.parametrize("camera", [FRONT, FLAT, controls.orbit(FRONT, 0.1, 0.15)])
def test_what_is_picked_is_what_is_projected_there(camera: Any) -> None:
    scene = replace(load_scene("sphere", vertices=2000), camera=camera)
    right, up = 0.1, -0.05
    point = controls.pick(scene, 1.5, right, up)
    np.testing.assert_allclose(controls.project(camera, 1.5, point), (right, up), atol=1e-6)
    radius = np.ptp(scene.bounds, axis=0)[0] / 2
    assert np.linalg.norm(point) == pytest.approx(radius, rel=0.01)
    assert np.subtract(camera.eye, point) @ point > 0.0, "the near side"
    assert controls.pick(scene, 1.5, 0.99, 0.99) is None


LAMPS = [
    DirectionalLight((0.3, -0.5, -1.0), (1.0, 1.0, 1.0)),
    PointLight((10.0, 20.0, 30.0), (1.0, 1.0, 1.0)),
    RectLight((0.0, 0.0, 50.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 10.0, 20.0, (1.0, 1.0, 1.0)),
]
CENTRE = 1.0, 2.0, 3.0


@pytest.mark.parametrize("light", LAMPS)
@pytest.mark.parametrize(("azimuth", "elevation"), [(30.0, -20.0), (-135.0, 60.0), (90.0, 0.0), (0.0, 90.0)])
def test_a_light_is_aimed_where_a_camera_at_these_angles_would_be(light: Any, azimuth: float, elevation: float) -> None:
    moved: Any = controls.aim(light, CENTRE, azimuth, elevation)
    tilt = min(elevation, 89.999)
    wanted = np.subtract(PerspectiveCamera.orbit(CENTRE, 1.0, azimuth, tilt).eye, CENTRE)
    if isinstance(light, DirectionalLight):
        arm, length = np.negative(moved.direction), np.linalg.norm(light.direction)
    else:
        arm, length = np.subtract(moved.position, CENTRE), np.linalg.norm(np.subtract(light.position, CENTRE))
    np.testing.assert_allclose(arm / length, wanted, atol=1e-4)
    if elevation < 90.0:
        assert controls.bearing(moved, CENTRE) == pytest.approx((azimuth, elevation), abs=1e-9)
    if isinstance(light, RectLight):  # it turns as a body
        for name in ("direction", "up"):
            before = np.dot(getattr(light, name), np.subtract(light.position, CENTRE))
            assert np.dot(getattr(moved, name), np.subtract(moved.position, CENTRE)) == pytest.approx(before)


def test_a_light_overhead_can_be_aimed_too() -> None:
    above = DirectionalLight((0.0, -1.0, 0.0), (1.0, 1.0, 1.0))
    assert controls.bearing(above, CENTRE)[1] == 90.0
    moved: Any = controls.aim(above, CENTRE, 0.0, 30.0)
    np.testing.assert_allclose(moved.direction, (0.0, -0.5, -math.sqrt(0.75)), atol=1e-12)
