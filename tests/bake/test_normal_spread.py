"""The largest angle between normals within a distance, compared with closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.normal_spread import normal_spread
from wgsss.scene.shapes import sphere


@pytest.mark.parametrize("distance", [5.0, 15.0, 45.0])
def test_the_normal_spread_on_a_sphere_is_the_angle_of_the_chord(distance):
    ball = sphere(20.0, 4000)
    found = normal_spread(ball.positions, ball.normals, distance)
    exact = 2 * np.arcsin(min(distance / 40.0, 1.0))
    assert exact * 0.7 <= found.min() and found.max() <= exact * 1.25 + 0.02  # near points are averaged


def test_the_normal_spread_at_an_edge_is_its_angle_and_0_elsewhere():
    """Two planes that meet at 90 degrees, on a grid of 1 mm."""
    t, s = (a.ravel() for a in np.meshgrid(np.arange(20.0), np.arange(20.0)))
    nothing = np.zeros_like(t)
    positions = np.concatenate([np.stack([t, s, nothing], 1), np.stack([nothing, s, -t], 1)])
    normals = np.repeat([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]], len(t), axis=0)
    found = normal_spread(positions.astype(np.float32), normals.astype(np.float32), 6.0)
    away = np.concatenate([t, t])
    np.testing.assert_allclose(found[away <= 4.0], np.pi / 2, atol=1e-6)
    np.testing.assert_allclose(found[away >= 8.0], 0.0, atol=1e-3)
