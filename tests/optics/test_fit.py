from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import nnls

from wgsss.errors import InputError
from wgsss.optics import SKIN_GAUSSIANS, Dipole, SumOfGaussians, fit_error, fit_shared_gaussians


class Opaque:
    """A profile that does not say that it is a sum of Gaussians."""

    def __init__(self, profile):
        self.total, self.reflectance = profile.total, profile.reflectance


def test_six_gaussians_fit_each_measured_material_within_a_percent(measured):
    profile = measured.dipole
    fit = fit_shared_gaussians(profile)
    assert fit.variances.size == 6
    assert np.all(fit_error(profile, fit) < 0.0093)
    np.testing.assert_allclose(fit.total, profile.total, rtol=1e-12)


def test_error_falls_with_the_number_of_gaussians(measured):
    errors = [
        np.linalg.norm(fit_error(measured.dipole, fit_shared_gaussians(measured.dipole, k))) for k in (1, 2, 3, 4, 6, 8)
    ]
    assert np.all(np.diff(errors) < 0)


def test_error_is_the_root_of_the_energy_ratio(skin):
    fit = fit_shared_gaussians(skin, 4)

    def energy(f):
        return sum(quad(lambda r: r * f(r) ** 2, a, b, epsrel=1e-10)[0] for a, b in [(0, 0.5), (0.5, 3), (3, 60)])

    red = [energy(lambda r: (skin.reflectance(r) - fit.reflectance(r))[0]), energy(lambda r: skin.reflectance(r)[0])]
    assert fit_error(skin, fit)[0] == pytest.approx(np.sqrt(red[0] / red[1]), rel=1e-6)


def test_no_other_weights_are_better(measured):
    """At the variances found, against Lawson and Hanson's solver with the total as one heavy row."""
    profile = measured.dipole
    fit = fit_shared_gaussians(profile)
    r = np.geomspace(1e-4, 1e4, 1500)
    root = r * np.sqrt(np.log(r[1] / r[0]))
    columns = [SumOfGaussians([v], [[1, 1, 1]]).reflectance(r)[:, 0] * root for v in fit.variances]
    for channel in range(3):
        wanted = profile.reflectance(r)[:, channel] * root
        norm = np.linalg.norm(wanted)
        rows = np.vstack([np.stack(columns, axis=1) / norm, np.full(6, 1e4 / profile.total[channel])])
        weights, _ = nnls(rows, np.append(wanted / norm, 1e4))
        np.testing.assert_allclose(fit.weights[:, channel], weights, atol=2e-4 * profile.total[channel])


def test_no_near_variances_are_better(skin):
    """A push of any variance by 1 %, with the weights as they are, brings nothing to first order."""
    fit = fit_shared_gaussians(skin)
    best = np.square(fit_error(skin, fit)).sum()
    for k in range(6):
        for push in (0.99, 1.01):
            variances = fit.variances.copy()
            variances[k] *= push
            assert np.square(fit_error(skin, SumOfGaussians(variances, fit.weights))).sum() > best * 0.999


def test_a_sum_of_gaussians_is_found_again():
    assert fit_shared_gaussians(SKIN_GAUSSIANS) is SKIN_GAUSSIANS
    two = SumOfGaussians([0.2, 3.0], [[0.5, 0.2, 0.0], [0.1, 0.2, 0.3]])
    fit = fit_shared_gaussians(Opaque(two), 2)
    np.testing.assert_allclose(fit.variances, two.variances, rtol=1e-6)
    np.testing.assert_allclose(fit.weights, two.weights, atol=1e-6)


def test_same_bits_each_time(skin):
    first, second = fit_shared_gaussians(skin), fit_shared_gaussians(skin)
    assert first.variances.tobytes() == second.variances.tobytes()
    assert first.weights.tobytes() == second.weights.tobytes()


def test_halving_lengths_quarters_variances(skin):
    fit = fit_shared_gaussians(skin)
    half = fit_shared_gaussians(Dipole(2 * skin.sigma_a, 2 * skin.sigma_s_prime, skin.eta))
    np.testing.assert_allclose(half.variances, fit.variances / 4, rtol=1e-3)


def test_permuting_channels_permutes_weights(skin):
    fit = fit_shared_gaussians(skin)
    turned = fit_shared_gaussians(Dipole(skin.sigma_a[[2, 0, 1]], skin.sigma_s_prime[[2, 0, 1]], skin.eta))
    np.testing.assert_allclose(turned.variances, fit.variances, rtol=1e-6)
    np.testing.assert_allclose(turned.weights, fit.weights[:, [2, 0, 1]], atol=1e-6)


def test_black_channels_stay_black():
    two = SumOfGaussians([0.2, 3.0], [[0.5, 0.0, 0.1], [0.1, 0.0, 0.3]])
    half_black = fit_shared_gaussians(Opaque(two), 3)
    assert np.all(half_black.weights[:, 1] == 0.0)
    assert np.all(half_black.total[[0, 2]] > 0.0)
    assert np.all(fit_shared_gaussians(Opaque(SumOfGaussians([1.0], np.zeros((1, 3))))).total == 0.0)


def test_no_gaussians_is_told(skin):
    with pytest.raises(InputError, match="at least one"):
        fit_shared_gaussians(skin, 0)
