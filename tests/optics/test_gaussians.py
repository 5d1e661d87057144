from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from wgsss.errors import InputError
from wgsss.optics import SKIN_GAUSSIANS, SumOfGaussians


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


def test_step_response_is_the_convolution_with_a_half_plane():
    """A ring of radius r about x lies within the lit side by a share arccos(-x / r) / pi."""
    for x in (-2.0, -0.3, -0.02, 0.0, 0.1, 1.5):
        for channel in range(3):

            def lit(r, x=x, channel=channel):
                return 2 * r * SKIN_GAUSSIANS.reflectance(r)[channel] * np.arccos(np.clip(-x / r, -1, 1))

            response, _ = quad(lit, 0, 40, points=[max(abs(x), 0.01), 0.2, 1.0, 5.0], epsabs=1e-10, limit=400)
            assert SKIN_GAUSSIANS.step_response(x)[channel] == pytest.approx(response, abs=1e-8)


def test_halving_lengths_scales_reflectance_by_four():
    half = SumOfGaussians(SKIN_GAUSSIANS.variances / 4, SKIN_GAUSSIANS.weights)
    r = np.array([[0.0, 0.1], [1.0, 5.0]])
    assert half.reflectance(r).shape == (2, 2, 3)
    np.testing.assert_allclose(half.reflectance(r / 2), 4 * SKIN_GAUSSIANS.reflectance(r), rtol=1e-12)


@pytest.mark.parametrize(
    ("variances", "weights", "says"),
    [
        ([], np.zeros((0, 3)), "k variances"),
        ([1.0], [[1.0, 1.0]], "k variances"),
        ([1.0, 1.0], np.ones((2, 3)), "ascending"),
        ([0.0, 1.0], np.ones((2, 3)), "positive"),
        ([np.nan], np.ones((1, 3)), "positive"),
        ([1.0], [[1.0, -0.1, 1.0]], "not negative"),
        ([1.0], [[1.0, np.inf, 1.0]], "finite"),
    ],
)
def test_bad_input_is_told(variances, weights, says):
    with pytest.raises(InputError, match=says):
        SumOfGaussians(np.array(variances), np.array(weights))


def test_profiles_cannot_be_changed_in_place():
    with pytest.raises(ValueError, match="read-only"):
        SKIN_GAUSSIANS.weights[0, 0] = 0.0
