from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from wgsss.errors import InputError
from wgsss.optics import BorshukovLewis, NormalizedDiffusion, Profile, SumOfGaussians, fit_error

T, K, C = np.array([0.9, 0.5, 0.1]), np.array([3.2, 4.0, 60.0]), np.array([0.5, 2.0, 30.0])
TURN = [2, 0, 1]


@pytest.fixture
def profile():
    return BorshukovLewis(T, K, C)


def test_reflectance_is_the_power_of_equation_45(profile):
    for r in (0.0, 0.3, 8.0):
        np.testing.assert_allclose(profile.reflectance(r) / profile.reflectance(1.0), ((C + 1) / (C + r)) ** K)


def test_reflectance_at_the_entry_by_hand():
    """For k = 4 the integral of (1 + r)^-4 over the plane is pi / 3."""
    np.testing.assert_allclose(BorshukovLewis((1, 1, 1), (4, 4, 4), (1, 2, 3)).reflectance(0.0) * [1, 4, 9], 3 / np.pi)


def test_closed_forms_are_the_integrals_of_reflectance(profile):
    r = np.array([0.0, 1e-3, 0.1, 1.0, 10.0, 100.0])
    np.testing.assert_allclose(profile.beyond(r), Profile.beyond(profile, r), atol=2e-8)
    np.testing.assert_array_equal(profile.total, T)
    np.testing.assert_allclose(profile.beyond(profile.range(0.02)).diagonal(), 0.02, rtol=1e-10)


def test_the_integral_of_the_line_spread_is_the_total():
    x = np.geomspace(1e-5, 1e4, 400)
    along = x[:, None] * BorshukovLewis((0.9, 0.5, 0.1), (5, 6, 7), (1, 1, 1)).line_spread(x)
    np.testing.assert_allclose(2 * along.sum(axis=0) * np.log(x[1] / x[0]), [0.9, 0.5, 0.1], rtol=1e-4)


def test_fit_to_each_measured_material(measured):
    dipole = measured.dipole
    fit = BorshukovLewis.fit(dipole)
    assert np.all(fit_error(dipole, fit) < 0.131)
    np.testing.assert_array_equal(fit.total, dipole.total)


def test_no_other_fit_is_better(skin):
    """Minimise by a simplex from another start, with the integrals of eq. 2 as plain sums over r."""
    r = np.arange(0.0005, 60, 0.001)
    wanted = skin.reflectance(r)[:, 0]
    total = skin.total[0]

    def error(x):
        k, c = np.exp(x)
        if k <= 2.0:
            return 1.0
        R = total * (k - 1) * (k - 2) / (2 * np.pi * c * c) * (1 + r / c) ** -k
        return (r * (R - wanted) ** 2).sum() / (r * wanted**2).sum()

    best = minimize(error, np.log([3.0, 1.0]), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-12})
    fit = BorshukovLewis.fit(skin)
    np.testing.assert_allclose([fit.k[0], fit.c[0]], np.exp(best.x), rtol=1e-3)
    assert fit_error(skin, fit)[0] == pytest.approx(np.sqrt(best.fun), rel=1e-5)


def test_the_fit_of_such_a_profile_is_that_profile(profile):
    fit = BorshukovLewis.fit(profile)
    np.testing.assert_allclose(fit.k, K, rtol=1e-4)
    np.testing.assert_allclose(fit.c, C, rtol=1e-4)


def test_fit_to_other_profiles():
    """Fit profiles that are infinite at r = 0, without a tail, tiny, or black."""
    burley = NormalizedDiffusion((0.9, 0.4, 0.1), (2, 0.5, 1e-4))
    assert np.all(fit_error(burley, BorshukovLewis.fit(burley)) < 0.25)
    narrow = SumOfGaussians([1e-12], [[0.5, 0.0, 2.0]])
    fit = BorshukovLewis.fit(narrow)
    np.testing.assert_array_equal(fit.total, [0.5, 0.0, 2.0])
    assert np.all(fit_error(narrow, fit) < 0.25)
    assert fit.c[1] == 1.0 and fit.k[1] == 4.0


def test_halving_lengths_scales_reflectance_by_four(profile):
    r = np.array([0.0, 0.1, 1.0, 40.0])
    np.testing.assert_allclose(BorshukovLewis(T, K, C / 2).reflectance(r / 2), 4 * profile.reflectance(r), rtol=1e-12)


def test_channels_are_independent(profile, skin):
    turned = BorshukovLewis(T[TURN], K[TURN], C[TURN])
    r = np.array([[0.0, 0.1], [1.0, 40.0]])
    for name in ("reflectance", "beyond", "line_spread"):
        np.testing.assert_array_equal(getattr(turned, name)(r), getattr(profile, name)(r)[..., TURN])
    fit = BorshukovLewis.fit(skin)
    turned = BorshukovLewis.fit(type(skin)(skin.sigma_a[TURN], skin.sigma_s_prime[TURN], skin.eta))
    np.testing.assert_array_equal([turned.k, turned.c], [fit.k[TURN], fit.c[TURN]])


@pytest.mark.parametrize(
    ("albedo", "k", "c", "says"),
    [
        ((0.5, -1, 0.5), K, C, "albedo of green must be from 0 to 100, not -1"),
        (T, (3, 3, 2), C, "k of blue must be above 2 and at most 10000, not 2"),
        (T, (np.nan, 3, 3), C, "k of red must be above 2 .*, not nan"),
        (T, K, (0, 1, 1), r"c of red must be above 0 and at most 1e\+12 \(mm\), not 0"),
        (T, K, (1, np.inf, 1), "c of green must be above 0"),
        (T, 3.0, C, "k must be three numbers"),
    ],
)
def test_bad_input_raises_an_error(albedo, k, c, says):
    with pytest.raises(InputError, match=says):
        BorshukovLewis(albedo, k, c)


def test_bad_distances_raise_an_error(profile):
    for name in ("reflectance", "beyond"):
        with pytest.raises(InputError, match="distances must be at least 0"):
            getattr(profile, name)(-1.0)
