"""Directions, rotation, connected pieces and closedness."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.scene.geometry import (
    GOLDEN_ANGLE,
    components,
    cosine_directions,
    face_components,
    fibonacci_sphere,
    golden_azimuths,
    is_closed,
    rotate_about,
    signed_volume,
)
from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes import sphere


def test_the_directions_of_a_sphere_are_spread_evenly():
    w = fibonacci_sphere(160)
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0)
    np.testing.assert_allclose(w.T @ w / len(w), np.eye(3) / 3, atol=0.01)
    np.testing.assert_allclose(w.mean(axis=0), 0.0, atol=0.01)


def test_the_directions_of_a_half_sphere_have_equal_areas():
    w = fibonacci_sphere(1000, lowest=0.0)
    assert w[:, 1].min() > 0.0
    np.testing.assert_allclose(np.diff(w[:, 1]), -1e-3)  # a zone's area goes by its height
    np.testing.assert_allclose(w.mean(axis=0), [0.0, 0.5, 0.0], atol=2e-3)


def test_golden_azimuths_of_large_numbers_are_evenly_spread():
    azimuth = np.sort(golden_azimuths(1_000_000 + np.arange(144)))
    assert 0.0 <= azimuth[0] and azimuth[-1] < 2 * np.pi
    steps = np.diff(np.append(azimuth, azimuth[0] + 2 * np.pi))
    assert steps.max() < 2 * steps.mean()


def test_directions_with_a_cosine_density_receive_equal_shares():
    n = fibonacci_sphere(7)
    w = cosine_directions(n, GOLDEN_ANGLE * np.arange(500) + np.zeros((7, 1)))
    assert w.shape == (7, 500, 3)
    np.testing.assert_allclose(np.linalg.norm(w, axis=2), 1.0)
    cosine = np.einsum("nkd,nd->nk", w, n)
    np.testing.assert_allclose(np.square(cosine).mean(axis=1), 0.5, atol=1e-3)  # the share above cosine c is 1 - c^2
    np.testing.assert_allclose(w.mean(axis=1), 2 / 3 * n, atol=5e-3)


def test_a_rotation_is_counter_clockwise_seen_from_the_tip_of_its_axis():
    x, y, z = np.eye(3)
    np.testing.assert_allclose(rotate_about(x, y, 90.0), -z, atol=1e-15)
    np.testing.assert_allclose(rotate_about(y, y, 12.0), y, atol=1e-15)
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    thrice = x
    for _ in range(3):
        thrice = rotate_about(thrice, axis, 120.0)
    np.testing.assert_allclose(thrice, x, atol=1e-15)


def test_components_are_numbered_by_their_first_node():
    labels = components(6, np.array([5, 2, 4]), np.array([0, 3, 2]))
    np.testing.assert_array_equal(labels, [0, 1, 2, 2, 2, 0])


def test_faces_that_share_a_vertex_are_in_one_piece():
    ball = sphere(1.0, 100)
    faces = np.concatenate([ball.faces + 3, ball.faces + 3 + len(ball.positions)])  # vertices 0 to 2 have no face
    np.testing.assert_array_equal(face_components(faces), np.repeat([0, 1], len(ball.faces)))
    np.testing.assert_array_equal(face_components(np.array([[0, 1, 2], [2, 3, 4], [5, 6, 7]])), [0, 0, 1])


def test_the_volume_of_a_mesh_has_the_sign_of_its_winding():
    ball = sphere(3.0, 5000)
    assert signed_volume(ball) == pytest.approx(4 / 3 * np.pi * 27, rel=2e-3)
    assert signed_volume(Mesh(ball.positions, ball.faces[:, ::-1])) == pytest.approx(-signed_volume(ball))


def test_a_closed_mesh_has_no_open_edge_and_faces_outwards():
    ball = sphere(10.0, 300)
    assert is_closed(ball)
    assert not is_closed(Mesh(ball.positions, ball.faces[:-1]))
    assert not is_closed(Mesh(ball.positions, ball.faces[:, ::-1].copy()))
    one_flipped = ball.faces.copy()
    one_flipped[0] = one_flipped[0, ::-1]
    assert not is_closed(Mesh(ball.positions, one_flipped))
