"""View and projection matrices against points computed by hand, and cameras that orbit and turn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene import Camera, OrthographicCamera, PerspectiveCamera


def project(camera: Camera, point: tuple, aspect: float, near: float, far: float) -> np.ndarray:
    clip = camera.projection(aspect, near, far) @ camera.view() @ [*point, 1.0]
    return clip[:3] / clip[3]


def test_view_looks_down_minus_z_with_y_up() -> None:
    camera = PerspectiveCamera((10.0, 5.0, 0.0), (0.0, 5.0, 0.0))
    np.testing.assert_allclose(camera.view() @ [0, 5, 0, 1], [0, 0, -10, 1], atol=1e-12)
    np.testing.assert_allclose(camera.view() @ [0, 7, 0, 1], [0, 2, -10, 1], atol=1e-12)
    # Seen from +x with +y up, +z lies to the left.
    np.testing.assert_allclose(camera.view() @ [0, 5, 3, 1], [-3, 0, -10, 1], atol=1e-12)


def test_perspective_fills_the_vertical_angle_and_depth_from_0_to_1() -> None:
    camera = PerspectiveCamera((0, 0, 0), (0, 0, -1), fov=90)
    # At a distance of 4 an angle of 90 degrees spans 8 from bottom to top, and twice that from side to side.
    np.testing.assert_allclose(project(camera, (8, 4, -4), 2.0, 2, 8), [1, 1, 2 / 3], atol=1e-12)
    np.testing.assert_allclose(project(camera, (0, -1, -2), 2.0, 2, 8), [0, -0.5, 0], atol=1e-12)
    np.testing.assert_allclose(project(camera, (0, 0, -8), 2.0, 2, 8), [0, 0, 1], atol=1e-12)


def test_perspective_of_30_degrees() -> None:
    camera = PerspectiveCamera((0, 0, 10), (0, 0, 0))
    edge = 10 * math.tan(math.radians(15))
    np.testing.assert_allclose(project(camera, (0, edge, 0), 1.0, 1, 100)[1], 1, atol=1e-12)


def test_orthographic_spans_its_height_and_depth_from_0_to_1() -> None:
    camera = OrthographicCamera((0, 0, 10), (0, 0, 0), height=6)
    np.testing.assert_allclose(project(camera, (6, 3, 8), 2.0, 2, 12), [1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(project(camera, (-6, -3, -2), 2.0, 2, 12), [-1, -1, 1], atol=1e-12)
    np.testing.assert_allclose(project(camera, (0, 0, 3), 2.0, 2, 12), [0, 0, 0.5], atol=1e-12)


def test_up_need_not_be_perpendicular_to_the_view() -> None:
    tilted = PerspectiveCamera((0, 0, 10), (0, 0, 0), up=(0, 2, 5)).view()
    np.testing.assert_allclose(tilted, PerspectiveCamera((0, 0, 10), (0, 0, 0)).view(), atol=1e-12)
    np.testing.assert_allclose(tilted[:3, :3] @ tilted[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "eye"),
    [(0, 0, (1, 2, 13)), (90, 0, (11, 2, 3)), (0, 30, (1, 7, 3 + 10 * math.cos(math.pi / 6))), (180, 0, (1, 2, -7))],
)
def test_orbit_places_the_eye(azimuth: float, elevation: float, eye: tuple) -> None:
    camera = OrthographicCamera.orbit((1, 2, 3), 10, azimuth, elevation, height=20)
    np.testing.assert_allclose(camera.eye, eye, atol=1e-12)
    assert camera.target == (1, 2, 3) and camera.height == 20


@pytest.mark.parametrize("kind", [PerspectiveCamera, OrthographicCamera])
def test_a_turning_camera_rotates_about_up_through_the_target(kind: type) -> None:
    camera = kind.orbit((1, 2, 3), 10, 20, 40, turn=90)
    later = camera.at(0.5)
    np.testing.assert_allclose(later.eye, kind.orbit((1, 2, 3), 10, 65, 40).eye, atol=1e-12)
    assert later.turn == 0
    assert later.at(1.0) == later, "a camera of a still image does not change"
    assert kind((0, 0, 1), (0, 0, 0)).at(3.0) == kind((0, 0, 1), (0, 0, 0))


@pytest.mark.parametrize(
    ("kind", "fields", "message"),
    [
        (PerspectiveCamera, {"eye": (0, 0, 0), "target": (0, 0, 0)}, "eye and target must not be the same point"),
        (PerspectiveCamera, {"eye": (0, 9, 0), "target": (0, 0, 0)}, "up must not be parallel"),
        (PerspectiveCamera, {"eye": (0, 0, 1), "target": (0, 0, 0), "up": (0, 0, 0)}, "up must not be the zero vector"),
        (
            PerspectiveCamera,
            {"eye": (0, 0, math.nan), "target": (0, 0, 0)},
            "eye must be three numbers, each from -1e\\+15 to 1e\\+15 \\(mm\\), not \\(0, 0, nan\\)",
        ),
        (
            PerspectiveCamera,
            {"eye": (0, 0, 1), "target": (0, 0, 0), "fov": 0.01},
            "fov must be from 0.05 to 170 \\(degrees\\), not 0.01",
        ),
        (
            PerspectiveCamera,
            {"eye": (0, 0, 1), "target": (0, 0, 0), "turn": math.inf},
            "turn must be from -1e\\+09 to 1e\\+09 \\(degrees per second\\), not inf",
        ),
        (
            OrthographicCamera,
            {"eye": (0, 0, 1), "target": (0, 0, 0), "height": 0},
            "height must be from 1e-06 to 1e\\+13 \\(mm\\), not 0",
        ),
    ],
)
def test_invalid_cameras_are_refused(kind: type, fields: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        kind(**fields)


@pytest.mark.parametrize(("aspect", "near", "far"), [(0, 1, 2), (1, 0, 2), (1, 2, 2), (1, 1, math.inf)])
def test_invalid_projections_are_refused(aspect: float, near: float, far: float) -> None:
    with pytest.raises(InputError, match="no projection"):
        PerspectiveCamera((0, 0, 1), (0, 0, 0)).projection(aspect, near, far)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"target": (0, 0)}, r"target must be three numbers, each from .* \(mm\), not \(0, 0\)"),
        ({"distance": 0.0}, r"distance must be from 1e-06 to 1e\+15 \(mm\), not 0.0"),
        ({"distance": 10**400}, "distance must be from"),
        ({"azimuth": math.inf}, r"azimuth must be from .* \(degrees\), not inf"),
        ({"elevation": 90.0}, r"elevation must be from -89.999 to 89.999 \(degrees\), not 90.0"),
        ({"elevation": "high"}, "elevation must be from .*, not 'high'"),
    ],
)
def test_errors_of_an_orbit_name_its_values(changed: dict[str, Any], says: str) -> None:
    orbit: dict[str, Any] = {"target": (0, 0, 0), "distance": 100.0, "azimuth": 20.0, "elevation": 10.0}
    for kind in (PerspectiveCamera, OrthographicCamera):
        kind.orbit(**orbit)
        with pytest.raises(InputError, match=f"^{says}"):
            kind.orbit(**{**orbit, **changed})
