from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j0

from wgsss.errors import InputError
from wgsss.optics import Profile, hankel
from wgsss.optics.fresnel import boundary
from wgsss.optics.multipole import Multipole


def slab(measured, mean_free_paths, eta_below=1.0):
    """Return a slab of a measured material. Its thickness is in units of its largest mean free path."""
    thickness = mean_free_paths / (np.array(measured.sigma_a) + measured.sigma_s_prime).min()
    return Multipole(measured.sigma_a, measured.sigma_s_prime, measured.eta, thickness=thickness, eta_below=eta_below)


def literal(medium, r, n):
    """Return R and T (3,) by Mikkelsen 2009, eq. 31 and 32, as plain sums over 2n + 1 dipoles at signed heights."""
    a, b = (4 / 3 * boundary(medium.eta / eta) * medium.mean_free_path for eta in (1.0, medium.eta_below))  # 4 A D
    s, sigma_tr = medium.thickness, medium.sigma_tr
    i = np.arange(-n, n + 1)[:, None]
    z_r = -medium.mean_free_path + i * 2 * (a / 2 + s + b / 2)
    z_v = medium.mean_free_path + a + i * 2 * (a / 2 + s + b / 2)

    def term(z):
        d = np.hypot(r, z)
        return (sigma_tr * d + 1) * z * np.exp(-sigma_tr * d) / d**3

    scale = medium.albedo / (4 * np.pi)
    return (scale * (term(z_v) - term(z_r))).sum(axis=0), (scale * (term(z_r + s) - term(z_v + s))).sum(axis=0)


def panels(length):
    """Return nodes and weights for integrals over all distances, of functions that vary over `length`."""
    x, w = np.polynomial.legendre.leggauss(12)
    edges = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 30), np.arange(1.25, 60.0, 0.25)]) * length
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()


@pytest.mark.parametrize("sigma_a", [(0.032, 0.17, 0.48), (0, 0, 0), (1e-7, 1e-4, 9.0)])
@pytest.mark.parametrize("eta_below", [1.0, 1.33, 1.6])
def test_images_are_those_of_equations_31_and_32(sigma_a, eta_below):
    medium = Multipole(sigma_a, (0.74, 0.88, 1.01), 1.5, thickness=3.0, eta_below=eta_below)
    for r in (0.0, 0.01, 0.5, 2.0, 4.0, 5.0, 7.0):
        R, T = literal(medium, r, 50000)
        np.testing.assert_allclose(medium.reflectance(r), R, rtol=1e-8)
        np.testing.assert_allclose(medium.transmittance(r), T, rtol=1e-8)


@pytest.mark.parametrize("mean_free_paths", [1.05, 2.0, 10.0])
def test_sums_are_the_inverse_of_their_transforms(measured, mean_free_paths):
    """The error is 1e-8 of R and T where they are above 1e-6 of their peaks, and of the peaks elsewhere."""
    for eta_below in (1.0, measured.eta):
        try:
            medium = slab(measured, mean_free_paths, eta_below)
        except InputError:
            assert eta_below > 1.0 and mean_free_paths < 2.0  # R would be negative far out
            continue
        r = np.geomspace(1e-3, 300.0, 25) * medium.mean_free_path.min()
        for summed, spectrum in (
            (medium.reflectance(r), medium.spectrum),
            (medium.transmittance(r), medium.transmitted_spectrum),
        ):
            # In a channel whose transmittance is below 1e-20, the transform has fewer correct digits.
            bright = spectrum(0.0) > 1e-20
            error = np.abs(hankel.plane(spectrum, r) - summed)[:, bright]
            peak = summed.max(axis=0)[bright]
            assert np.all(error < 1e-8 * np.where(summed[:, bright] > 1e-6 * peak, summed[:, bright], peak))


@pytest.mark.parametrize("mean_free_paths", [1.05, 2.0, 10.0])
def test_transforms_are_those_of_the_sums(measured, mean_free_paths):
    """Transform by quadrature over r. The error is 1e-8 of the transform at k = 0, the integral over the plane."""
    medium = slab(measured, mean_free_paths)
    r, w = panels(medium.thickness)
    for profile, spectrum, total in (
        (medium.reflectance, medium.spectrum, medium.total),
        (medium.transmittance, medium.transmitted_spectrum, medium.total_transmittance),
    ):
        ring = (2 * np.pi * r * w)[:, None] * profile(r)
        for k in np.array([0.0, 0.05, 0.3, 1.0, 2.0]) / medium.mean_free_path.max():
            assert np.all(np.abs(j0(k * r) @ ring - spectrum(k)) < 1e-8 * total)


def test_without_absorption_all_light_leaves():
    medium = Multipole((0, 0, 1e-3), (1, 20, 20), 1.4, thickness=1.2, eta_below=1.1)
    sent = medium.total + medium.total_transmittance
    np.testing.assert_allclose(sent[:2], 1.0, rtol=1e-14)
    assert 0.9 < sent[2] < 0.9999


@pytest.mark.parametrize("sigma_a", [(0.032, 0.17, 0.48), (0, 0, 0), (1e-8, 1e-6, 1e-4)])
def test_closed_forms_are_the_integrals_of_reflectance(sigma_a):
    medium = Multipole(sigma_a, (0.74, 0.88, 1.01), 1.3, thickness=2.5, eta_below=1.1)
    r = np.array([0.0, 1e-3, 0.1, 1.0, 3.0, 8.0, 30.0])
    np.testing.assert_allclose(medium.beyond(r), Profile.beyond(medium, r), atol=2e-9)
    np.testing.assert_allclose(medium.line_spread(-r), Profile.line_spread(medium, r), rtol=2e-7, atol=1e-300)
    np.testing.assert_allclose(medium.enclosed(medium.range(0.02)).diagonal(), 0.98, rtol=1e-9)


def test_the_sum_over_far_images_is_accurate():
    """With weak absorption, leaving out the images after the last one would lose digits."""
    medium = Multipole((0, 1e-6, 1e-4), (1, 1, 1), thickness=1.2, eta_below=1.1)
    r = np.array([0.5, 2.5, 3.0])
    np.testing.assert_allclose(medium.reflectance(r), hankel.plane(medium.spectrum, r), rtol=1e-11)
    np.testing.assert_allclose(medium.transmittance(r), hankel.plane(medium.transmitted_spectrum, r), rtol=1e-11)
    np.testing.assert_allclose(medium.line_spread(r), hankel.line(medium.spectrum, r), rtol=1e-10)
    np.testing.assert_allclose(medium.beyond(r) * medium.total, hankel.outside(medium.spectrum, r), rtol=1e-8)


def test_a_thick_slab_is_a_half_space(skin):
    medium = Multipole(skin.sigma_a, skin.sigma_s_prime, skin.eta, thickness=80.0)
    r = np.array([0.0, 0.3, 2.0, 10.0])
    np.testing.assert_allclose(medium.reflectance(r), skin.reflectance(r), rtol=1e-11)
    np.testing.assert_allclose(medium.total, skin.total, rtol=1e-12)


def test_the_source_close_to_the_bottom_is_a_spike():
    """Marble of 0.5 mm, red: 41 per mm^2 leave straight below a source that is 0.456 mm deep."""
    marble = Multipole((0.0021, 0.0041, 0.0071), (2.19, 2.62, 3.0), 1.5, thickness=0.5)
    assert marble.transmittance(0.0)[0] == pytest.approx(41.0, abs=0.5)


def test_light_falls_off_as_between_two_black_planes():
    """Far away R and T fall off as exp(-r sqrt(sigma_tr^2 + (pi / H)^2)) / sqrt(r), and are never negative."""
    medium = Multipole((0.001, 0, 0.1), (1, 1, 1), 1.3, thickness=2.0)
    H = medium.thickness + 4 / 3 * boundary(1.3) * medium.mean_free_path
    rate = np.sqrt(medium.sigma_tr**2 + (np.pi / H) ** 2)
    near, far = 90.0, 100.0
    for profile in (medium.reflectance, medium.transmittance):
        fall = np.log(profile(near) / profile(far))
        np.testing.assert_allclose(fall, rate * 10.0 + 0.5 * np.log(far / near), rtol=1e-4)
        sent = profile(np.geomspace(1e-9, 1e9, 100))
        assert np.all(np.isfinite(sent)) and np.all(sent >= 0.0)


def test_transforms_are_finite_from_zero_to_huge_frequencies(skin):
    for sigma_a in (skin.sigma_a, (0, 0, 0)):
        medium = Multipole(sigma_a, skin.sigma_s_prime, skin.eta, thickness=5.0)
        k = np.array([0.0, 1e-200, 1e-9, 1e-3, 1.0, 30.0, 1e4, 1e100])
        for spectrum in (medium.spectrum, medium.transmitted_spectrum):
            found = spectrum(k)
            assert found.dtype == np.float64
            assert np.all(np.isfinite(found)) and np.all(np.diff(found, axis=0) <= 1e-15) and np.all(found >= 0.0)
            np.testing.assert_allclose(found[2], found[0], rtol=1e-7)
            np.testing.assert_allclose(spectrum(k[2:6] + 0j), found[2:6], rtol=1e-12)


def test_halving_lengths_scales_profiles_by_four(skin):
    r = np.array([0.0, 0.1, 1.0, 9.0])
    whole = Multipole(skin.sigma_a, skin.sigma_s_prime, skin.eta, thickness=3.0, eta_below=1.1)
    half = Multipole(2 * skin.sigma_a, 2 * skin.sigma_s_prime, skin.eta, thickness=1.5, eta_below=1.1)
    np.testing.assert_allclose(half.reflectance(r / 2), 4 * whole.reflectance(r), rtol=1e-12)
    np.testing.assert_allclose(half.transmittance(r / 2), 4 * whole.transmittance(r), rtol=1e-12)


def test_channels_are_independent(skin):
    order = [2, 0, 1]
    medium = Multipole(skin.sigma_a, skin.sigma_s_prime, thickness=2.0)
    turned = Multipole(skin.sigma_a[order], skin.sigma_s_prime[order], thickness=2.0)
    r = np.array([[0.2, 2.0], [4.0, 11.0]])
    assert medium.reflectance(r).shape == (2, 2, 3)
    np.testing.assert_array_equal(turned.reflectance(r), medium.reflectance(r)[..., order])
    np.testing.assert_array_equal(turned.transmittance(r), medium.transmittance(r)[..., order])
    np.testing.assert_array_equal(turned.total_transmittance, medium.total_transmittance[order])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"thickness": 0.5}, "thickness must be above the mean free path of red, 1.295 mm, not 0.5"),
        ({"thickness": 0.95, "sigma_s_prime": (2, 0.88, 1)}, "mean free path of green, 0.9524 mm"),
        ({"thickness": 1 / 1.49, "sigma_s_prime": (2, 2, 1.01)}, "mean free path of blue, 0.6711 mm, not 0.671"),
        ({"thickness": np.nan}, "thickness must be a finite number"),
        ({"thickness": np.inf}, "thickness must be a finite number"),
        ({"thickness": "3"}, "thickness must be a finite number"),
        ({"thickness": -1.0}, "thickness must be above the mean free path of red"),
        ({"thickness": 5.0, "eta_below": 0.9}, "eta_below must be a number from 1 to 3, not 0.9"),
        ({"thickness": 5.0, "eta_below": np.nan}, "eta_below must be a number from 1 to 3"),
        ({"thickness": 5.0, "eta": 0.5}, "eta must be a number from 1 to 3"),
        ({"thickness": 1.36, "eta": 1.5, "eta_below": 1.5}, r"at least 2\.55\d mm in red.* 1.295 mm.* not 1.36"),
    ],
)
def test_bad_slabs_raise_an_error(arguments, says):
    whole = {"sigma_a": (0.032, 0.17, 0.48), "sigma_s_prime": (0.74, 0.88, 1.01)} | arguments
    with pytest.raises(InputError, match=says):
        Multipole(**whole)


def test_a_slab_just_thicker_than_a_mean_free_path_is_accepted():
    medium = Multipole((0, 0, 0), (1, 1, 1), thickness=1.0 + 1e-9)
    assert np.all(np.isfinite(medium.transmittance([0.0, 1.0]))) and np.all(medium.total > 0.0)


def test_bad_distances_raise_an_error():
    medium = Multipole((0, 0, 0), (1, 1, 1), thickness=3.0)
    for profile in (medium.reflectance, medium.transmittance, medium.beyond):
        with pytest.raises(InputError, match="distances must be at least 0"):
            profile([1.0, -1.0])
