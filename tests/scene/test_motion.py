"""Motions: the rest pose, bending and swelling."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene import shapes
from wgsss.scene.motion import BendAndSwell


def test_a_motion_rests_at_time_zero_and_after_each_period() -> None:
    rest = shapes.capsule(vertices=500).positions
    motion = BendAndSwell(period_s=3)
    for time_s in (0.0, 3.0, 30.0):
        assert motion.apply(rest, time_s) == pytest.approx(rest, abs=1e-4)
    assert np.abs(motion.apply(rest, 0.75) - rest).max() > 10


def test_bending_keeps_the_length_of_the_axis() -> None:
    axis = np.column_stack([np.zeros(601), np.linspace(0, 60, 601), np.zeros(601)])
    bent = BendAndSwell(bend=90, swell=0, period_s=4).apply(axis, 1.0)
    assert np.linalg.norm(np.diff(bent, axis=0), axis=1).sum() == pytest.approx(60, rel=1e-4)
    radius = 60 / (math.pi / 2)
    assert bent[-1] == pytest.approx((radius, radius, 0), rel=1e-4)
    assert bent[0] == pytest.approx((0, 0, 0))


def test_swelling_does_not_exceed_its_parameter() -> None:
    height = np.linspace(0, 60, 200)
    side = np.column_stack([np.zeros(200), height, np.full(200, 9.0)])
    radii = np.array([BendAndSwell(bend=0, swell=0.3).apply(side, t)[:, 2] for t in np.linspace(0, 4, 40)])
    assert radii.max() == pytest.approx(9 * 1.3, rel=0.01)
    assert radii.min() == pytest.approx(9 * 0.7, rel=0.01)


def test_a_moving_body_does_not_turn_inside_out() -> None:
    mesh = shapes.capsule(vertices=1000)
    for time_s in np.linspace(0, 4, 9):
        moved = mesh.deformed(BendAndSwell().apply(mesh.positions, time_s))
        corner = moved.positions.astype(np.float64)[moved.faces]
        volume = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6
        assert 9000 < volume < 18_000
        assert np.array_equal(moved.faces, mesh.faces)


@pytest.mark.parametrize(("field", "value"), [("length", 0), ("period_s", -1), ("swell", 1.5), ("bend", math.nan)])
def test_a_field_out_of_range_is_named(field: str, value: float) -> None:
    with pytest.raises(InputError, match=field):
        BendAndSwell(**{field: value})
