from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from wgsss.errors import InputError
from wgsss.optics import Dipole, diffuse_fresnel


def test_total_is_the_published_closed_form(measured):
    np.testing.assert_allclose(measured.dipole.total, measured.total, rtol=0, atol=2e-10)


def test_total_is_the_integral_over_the_plane(measured):
    dipole = measured.dipole
    for channel in range(3):

        def ring(log_r, channel=channel):  # 2 pi R r dr, in log r
            r = np.exp(log_r)
            return 2 * np.pi * dipole.reflectance(r)[channel] * r * r

        # Without absorption a share (z_r + z_v) / 2r lies beyond r, here 1e-10: as far as the bar reaches.
        pieces = np.linspace(np.log(1e-7), np.log(1e10), 12)
        total = sum(quad(ring, a, b, epsabs=1e-12, epsrel=1e-11)[0] for a, b in pairwise(pieces))
        assert total == pytest.approx(dipole.total[channel], abs=1e-9)


def test_reflectance_is_the_flux_of_two_sources_through_the_surface(skin):
    """004 eq. 29 and 26: R = D dphi/dn, here from the fluence by central differences."""
    diffusion = 1 / (3 * skin.sigma_t_prime)
    z_r = 1 / skin.sigma_t_prime
    z_b = 2 * skin.boundary * diffusion

    def fluence(r, depth):
        d_r, d_v = np.hypot(r, depth - z_r), np.hypot(r, depth + z_r + 2 * z_b)
        return (
            skin.albedo
            / (4 * np.pi * diffusion)
            * (np.exp(-skin.sigma_tr * d_r) / d_r - np.exp(-skin.sigma_tr * d_v) / d_v)
        )

    for r in (0.01, 0.3, 1.0, 5.0):
        np.testing.assert_allclose(fluence(r, -z_b), 0, atol=1e-12)  # dark on the extrapolated boundary
        slope = (fluence(r, 1e-5) - fluence(r, -1e-5)) / 2e-5
        np.testing.assert_allclose(skin.reflectance(r), diffusion * slope, rtol=1e-6)


def test_halving_lengths_scales_reflectance_by_four(skin):
    r = np.array([0.0, 0.1, 1.0, 4.0])
    half = Dipole(2 * skin.sigma_a, 2 * skin.sigma_s_prime, skin.eta)
    np.testing.assert_allclose(half.reflectance(r / 2), 4 * skin.reflectance(r), rtol=1e-12)
    np.testing.assert_allclose(half.total, skin.total, rtol=1e-12)


def test_channels_are_independent(skin):
    turned = Dipole(skin.sigma_a[[2, 0, 1]], skin.sigma_s_prime[[2, 0, 1]], skin.eta)
    np.testing.assert_array_equal(turned.reflectance([0.2, 2.0]), skin.reflectance([0.2, 2.0])[:, [2, 0, 1]])


def test_without_absorption_everything_returns():
    assert np.all(Dipole((0, 0, 0), (11.6, 20.4, 14.9)).total == 1.0)


def test_without_scattering_nothing_returns():
    black = Dipole((1, 1, 1), (0, 0, 0))
    assert np.all(black.total == 0.0)
    assert np.all(black.reflectance([0.0, 1.0]) == 0.0)


@pytest.mark.parametrize(
    ("eta", "exact"),
    [(1 / 1.5, 0.091778), (1 / 1.3, 0.061132), (1.0, 0.0), (1.2, 0.336306), (1.3, 0.444457), (1.5, 0.596346)],
)
def test_diffuse_fresnel_is_the_average_of_fresnel(eta, exact):
    assert diffuse_fresnel(eta) == pytest.approx(exact, abs=0.002)


@pytest.mark.parametrize(
    ("sigma_a", "sigma_s_prime", "eta", "says"),
    [
        ((0, 0), (1, 1, 1), 1.3, "sigma_a must be three numbers"),
        ((0, 0, -1), (1, 1, 1), 1.3, "sigma_a must be three numbers"),
        ((0, 0, 0), (1, np.nan, 1), 1.3, "sigma_s_prime must be three numbers"),
        ((0, 1, 1), (0, 1, 1), 1.3, "both 0"),
        ((1, 1, 1), (1, 1, 1), 0.9, "eta"),
        ((1, 1, 1), (1, 1, 1), np.nan, "eta"),
    ],
)
def test_bad_input_is_told(sigma_a, sigma_s_prime, eta, says):
    with pytest.raises(InputError, match=says):
        Dipole(sigma_a, sigma_s_prime, eta)
