"""Moves of cameras and lights, compared with closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from wgsss.scene import (
    Camera,
    DirectionalLight,
    EnvironmentLight,
    Light,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RectLight,
    load_scene,
)
from wgsss.viewer import manipulation

FRONT = PerspectiveCamera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), fov=30.0)
FLAT = OrthographicCamera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), height=50.0)
OBLIQUE = manipulation.orbit(FRONT, 0.1, 0.15)
ORIGIN = 0.0, 0.0, 0.0
CENTRE = 1.0, 2.0, 3.0


def screen_position(camera: Camera, point: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the position of a point relative to the middle of the picture, in heights of the picture."""
    clip = camera.projection(1.0, 1.0, 1e4) @ camera.view() @ np.append(point, 1.0)
    return clip[:2] / clip[3] / 2.0


def test_orbit_to_the_right_shows_more_of_the_left_side() -> None:
    turned = manipulation.orbit(FRONT, 0.25, 0.0)
    np.testing.assert_allclose(turned.eye, (-100 / math.sqrt(2), 0.0, 100 / math.sqrt(2)), atol=1e-12)
    assert screen_position(turned, (0.0, 0.0, 10.0))[0] > 0.0, "points in front of the target follow the pointer"


def test_orbit_up_moves_the_camera_down_and_stops_before_the_pole() -> None:
    eye = manipulation.orbit(FRONT, 0.0, 1 / 6).eye
    np.testing.assert_allclose(eye, (0.0, -50.0, 50.0 * math.sqrt(3)), atol=1e-9)
    eye = manipulation.orbit(FRONT, 0.0, 2.0).eye
    assert eye[1] == pytest.approx(-100.0 * math.sin(math.radians(manipulation.MAX_ELEVATION)))
    assert np.linalg.norm(eye) == pytest.approx(100.0)


@pytest.mark.parametrize("camera", [FRONT, FLAT, OBLIQUE])
def test_pan_moves_the_target_with_the_pointer(camera: Camera) -> None:
    moved = manipulation.pan(camera, 0.2, -0.1)
    np.testing.assert_allclose(screen_position(moved, camera.target), (0.2, -0.1), atol=1e-12)
    np.testing.assert_allclose(np.subtract(moved.eye, moved.target), np.subtract(camera.eye, camera.target))


@pytest.mark.parametrize("camera", [FRONT, FLAT])
def test_zoom_scales_the_picture_at_the_target(camera: Camera) -> None:
    point = (3.0, -2.0, 0.0)
    zoomed = manipulation.zoom(camera, 2.0)
    np.testing.assert_allclose(screen_position(zoomed, point), 2.0 * screen_position(camera, point))


def test_focus_puts_a_point_in_the_middle_at_the_same_distance() -> None:
    camera = manipulation.focus(FRONT, CENTRE)
    np.testing.assert_allclose(screen_position(camera, CENTRE), 0.0, atol=1e-12)
    assert camera.eye == (1.0, 2.0, 103.0)


def test_light_in_front_follows_the_pointer() -> None:
    sun = DirectionalLight((0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
    for right, up, direction in ((0.5, 0.0, (-1, 0, 0)), (0.0, 0.5, (0, -1, 0))):
        turned = manipulation.turn_light(sun, FRONT, right, up, ORIGIN)
        assert isinstance(turned, DirectionalLight)
        np.testing.assert_allclose(turned.direction, direction, atol=1e-12)
    lamp = PointLight((1.0, 0.0, 50.0), (1.0, 1.0, 1.0))
    moved = manipulation.turn_light(lamp, FRONT, 0.5, 0.0, (1.0, 0.0, 0.0))
    assert isinstance(moved, PointLight)
    np.testing.assert_allclose(moved.position, (51.0, 0.0, 0.0), atol=1e-12)


def test_rectangle_that_is_turned_keeps_facing_the_centre() -> None:
    light = RectLight((0.0, 0.0, 50.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 10.0, 20.0, (1.0, 1.0, 1.0))
    moved = manipulation.turn_light(light, FRONT, 0.3, 0.2, ORIGIN)
    assert isinstance(moved, RectLight)
    np.testing.assert_allclose(np.multiply(moved.direction, -50.0), moved.position, atol=1e-12)
    assert abs(np.dot(moved.direction, moved.up)) < 1e-12


def test_environment_turns_about_the_vertical_axis() -> None:
    turned = manipulation.turn_light(EnvironmentLight(rotation=350.0), FRONT, 0.5, 0.7, ORIGIN)
    assert isinstance(turned, EnvironmentLight)
    assert turned.rotation == pytest.approx(80.0)


@pytest.mark.parametrize("camera", [FRONT, FLAT, OBLIQUE])
def test_picked_point_is_projected_back_to_the_pointer(camera: Camera) -> None:
    scene = replace(load_scene("sphere", vertices=2000), camera=camera)
    right, up = 0.1, -0.05
    point = manipulation.pick(scene, 1.5, right, up)
    assert point is not None
    np.testing.assert_allclose(manipulation.project(camera, 1.5, point), (right, up), atol=1e-6)
    radius = np.ptp(scene.bounds, axis=0)[0] / 2
    assert np.linalg.norm(point) == pytest.approx(radius, rel=0.01)
    assert np.subtract(camera.eye, point) @ point > 0.0, "the point is on the near side"
    assert manipulation.pick(scene, 1.5, 0.99, 0.99) is None


LIGHTS = [
    DirectionalLight((0.3, -0.5, -1.0), (1.0, 1.0, 1.0)),
    PointLight((10.0, 20.0, 30.0), (1.0, 1.0, 1.0)),
    RectLight((0.0, 0.0, 50.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 10.0, 20.0, (1.0, 1.0, 1.0)),
]


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(("azimuth", "elevation"), [(30.0, -20.0), (-135.0, 60.0), (90.0, 0.0), (0.0, 90.0)])
def test_aimed_light_is_where_a_camera_that_orbits_to_these_angles_is(
    light: Light, azimuth: float, elevation: float
) -> None:
    aimed = manipulation.aim_light(light, CENTRE, azimuth, elevation)
    eye = PerspectiveCamera.orbit(CENTRE, 1.0, azimuth, min(elevation, 89.999)).eye
    if isinstance(light, DirectionalLight):
        assert isinstance(aimed, DirectionalLight)
        arm, length = np.negative(aimed.direction), np.linalg.norm(light.direction)
    else:
        assert isinstance(light, PointLight | RectLight) and isinstance(aimed, PointLight | RectLight)
        arm, length = np.subtract(aimed.position, CENTRE), np.linalg.norm(np.subtract(light.position, CENTRE))
    np.testing.assert_allclose(arm / length, np.subtract(eye, CENTRE), atol=1e-4)
    if elevation < 90.0:
        assert manipulation.light_angles(aimed, CENTRE) == pytest.approx((azimuth, elevation), abs=1e-9)
    if isinstance(light, RectLight) and isinstance(aimed, RectLight):  # it turns as a rigid body
        for name in ("direction", "up"):
            before = np.dot(getattr(light, name), np.subtract(light.position, CENTRE))
            assert np.dot(getattr(aimed, name), np.subtract(aimed.position, CENTRE)) == pytest.approx(before)


def test_light_straight_above_can_be_aimed() -> None:
    above = DirectionalLight((0.0, -1.0, 0.0), (1.0, 1.0, 1.0))
    assert manipulation.light_angles(above, CENTRE)[1] == 90.0
    aimed = manipulation.aim_light(above, CENTRE, 0.0, 30.0)
    assert isinstance(aimed, DirectionalLight)
    np.testing.assert_allclose(aimed.direction, (0.0, -0.5, -math.sqrt(0.75)), atol=1e-12)
