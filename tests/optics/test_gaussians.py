from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from wgsss.errors import InputError
from wgsss.optics import SKIN_GAUSSIANS, Profile, SumOfGaussians

OWN = SumOfGaussians(
    [[0.01, 0.2, 0.3], [1.0, 0.2, 5.0]],  # green needs one Gaussian only
    [[0.2, 0.5, 0.0], [0.3, 0.0, 0.4]],
)
EACH = pytest.mark.parametrize("profile", [SKIN_GAUSSIANS, OWN], ids=["shared", "own"])


def test_skin_is_table_4_of_deon_and_luebke():
    np.testing.assert_array_equal(SKIN_GAUSSIANS.variances, [0.0064, 0.0484, 0.187, 0.567, 1.99, 7.41])
    np.testing.assert_array_equal(SKIN_GAUSSIANS.weights[:, 0], [0.233, 0.1, 0.118, 0.113, 0.358, 0.078])
    np.testing.assert_array_equal(SKIN_GAUSSIANS.weights[:, 1], [0.455, 0.336, 0.198, 0.007, 0.004, 0.0])
    np.testing.assert_array_equal(SKIN_GAUSSIANS.weights[:, 2], [0.649, 0.344, 0.0, 0.007, 0.0, 0.0])
    np.testing.assert_allclose(SKIN_GAUSSIANS.total, 1.0, rtol=1e-15)


def test_total_is_the_integral_over_the_plane():
    for channel in range(3):
        total, _ = quad(
            lambda r, c=channel: 2 * np.pi * r * SKIN_GAUSSIANS.reflectance(r)[c],
            0,
            40,
            points=[0.1, 1, 5],
            epsabs=1e-11,
            limit=200,
        )
        assert total == pytest.approx(1.0, abs=1e-9)


def test_variances_per_channel_give_a_sum_for_each_channel():
    r, x = np.array([[0.0, 0.1], [1.0, 5.0]]), np.array([-2.0, 0.0, 0.3])
    for c in range(3):
        alone = SumOfGaussians(OWN.variances[:, c] * [1, 1 + 1e-15], np.repeat(OWN.weights[:, [c]], 3, axis=1))
        for name, at in (("reflectance", r), ("beyond", r), ("line_spread", x), ("step_response", x)):
            found = getattr(OWN, name)(at)
            assert found.shape == (*at.shape, 3)
            np.testing.assert_allclose(found[..., c], getattr(alone, name)(at)[..., c], rtol=1e-13)
    np.testing.assert_array_equal(OWN.total, [0.5, 0.5, 0.4])


@EACH
def test_closed_forms_are_the_integrals_of_reflectance(profile):
    r = np.array([0.0, 1e-3, 0.1, 1.0, 5.0])
    np.testing.assert_allclose(profile.beyond(r), Profile.beyond(profile, r), atol=2e-8)
    np.testing.assert_allclose(profile.line_spread(-r), Profile.line_spread(profile, r), rtol=5e-8, atol=1e-20)
    np.testing.assert_allclose(profile.beyond(profile.range(0.02)).diagonal(), 0.02, rtol=1e-10)


@EACH
def test_line_spread_is_the_slope_of_the_step_response(profile):
    x = np.array([0.0, 0.05, 0.4, 2.0])
    slope = (profile.step_response(x + 1e-6) - profile.step_response(x - 1e-6)) / 2e-6
    np.testing.assert_allclose(profile.line_spread(x), slope, rtol=1e-6, atol=1e-9)


@EACH
def test_channels_are_independent(profile):
    turned = SumOfGaussians(
        profile.variances[..., [2, 0, 1]] if profile is OWN else profile.variances, profile.weights[:, [2, 0, 1]]
    )
    r = np.geomspace(1e-3, 10, 57)
    for name in ("reflectance", "beyond", "line_spread", "step_response"):
        np.testing.assert_array_equal(getattr(turned, name)(r), getattr(profile, name)(r)[:, [2, 0, 1]])
    np.testing.assert_array_equal(turned.range(), profile.range()[[2, 0, 1]])


def test_step_response_is_the_convolution_with_a_half_plane():
    """A share arccos(-x / r) / pi of a ring of radius r about x is on the lit side."""
    for x in (-2.0, -0.3, -0.02, 0.0, 0.1, 1.5):
        for channel in range(3):

            def lit(r, x=x, channel=channel):
                return 2 * r * SKIN_GAUSSIANS.reflectance(r)[channel] * np.arccos(np.clip(-x / r, -1, 1))

            response, _ = quad(lit, 0, 40, points=[max(abs(x), 0.01), 0.2, 1.0, 5.0], epsabs=1e-10, limit=400)
            assert SKIN_GAUSSIANS.step_response(x)[channel] == pytest.approx(response, abs=1e-8)


@EACH
def test_halving_lengths_scales_reflectance_by_four(profile):
    half = SumOfGaussians(profile.variances / 4, profile.weights)
    r = np.array([[0.0, 0.1], [1.0, 5.0]])
    assert half.reflectance(r).shape == (2, 2, 3)
    np.testing.assert_allclose(half.reflectance(r / 2), 4 * profile.reflectance(r), rtol=1e-12)


def test_bad_distances_raise_an_error():
    for name in ("reflectance", "beyond"):
        with pytest.raises(InputError, match="distances must be at least 0"):
            getattr(OWN, name)(-1.0)


@pytest.mark.parametrize(
    ("variances", "weights", "says"),
    [
        ([], np.zeros((0, 3)), "k variances"),
        ([1.0], [[1.0, 1.0]], "k variances"),
        ([1.0, 1.0], np.ones((2, 3)), "ascending"),
        (1.0, np.ones((1, 3)), "k variances"),
        (1.0, 1.0, "k variances"),
        (np.ones((2, 2)), np.ones((2, 3)), "k rows of 3"),
        (np.ones((3, 3)), np.ones((2, 3)), "k rows of 3"),
        ([[1.0, 1.0, 2.0], [1.0, 1.0, 1.0]], np.ones((2, 3)), "ascending"),
        ([[1.0, 1.0, 0.0]], np.ones((1, 3)), "positive"),
        ([0.0, 1.0], np.ones((2, 3)), "positive"),
        ([np.nan], np.ones((1, 3)), "positive"),
        ([1.0], [[1.0, -0.1, 1.0]], "must not be negative"),
        ([1.0], [[1.0, np.inf, 1.0]], "sum to 100 at most"),
    ],
)
def test_bad_input_raises_an_error(variances, weights, says):
    with pytest.raises(InputError, match=says):
        SumOfGaussians(np.array(variances), np.array(weights))


def test_profiles_cannot_be_changed_in_place():
    with pytest.raises(ValueError, match="read-only"):
        SKIN_GAUSSIANS.weights[0, 0] = 0.0
