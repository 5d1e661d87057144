from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from wgsss.errors import InputError
from wgsss.optics import Dipole, NormalizedDiffusion, Profile

A, D = np.array([0.9, 0.44, 0.05]), np.array([2.0, 0.5, 0.01])


@pytest.fixture
def profile():
    return NormalizedDiffusion(A, D)


def test_the_share_within_sixteen_d_is_that_of_cycles(profile):
    np.testing.assert_allclose(profile.enclosed(16 * D).diagonal(), 0.9963790093708328, rtol=1e-14)


def test_reflectance_is_the_published_profile(profile):
    """At r = d: (exp(-1) + exp(-1/3)) / 8 pi of the albedo per d^2."""
    np.testing.assert_allclose(profile.reflectance(D).diagonal(), 0.0431473329 * A / D**2, rtol=1e-9)
    assert np.all(profile.reflectance(0.0) == np.inf)


def test_total_is_the_integral_over_the_plane(profile):
    for c in range(3):
        ring = [
            quad(lambda r, c=c: 2 * np.pi * r * profile.reflectance(r)[c], a * D[c], b * D[c], epsabs=1e-13)[0]
            for a, b in ((1e-13, 1), (1, 10), (10, 100))
        ]
        assert sum(ring) == pytest.approx(profile.total[c], rel=1e-9)


def test_closed_forms_are_the_integrals_of_reflectance(profile):
    r = np.array([1e-3, 0.1, 1.0, 10.0])
    np.testing.assert_allclose(profile.beyond(r), Profile.beyond(profile, r), atol=2e-8)
    np.testing.assert_allclose(profile.line_spread(-r), Profile.line_spread(profile, r), rtol=5e-7, atol=1e-60)
    np.testing.assert_allclose(profile.beyond(profile.range(0.02)).diagonal(), 0.02, rtol=1e-12)


@pytest.mark.parametrize(
    ("fit", "s"),
    [  # computed by hand for the albedos 0.8, 0.5 and 0.33
        (NormalizedDiffusion.searchlight, (1.05, 1.539, 2.246761)),
        (NormalizedDiffusion.diffuse, (1.1, 1.715, 2.34315)),
        (NormalizedDiffusion.from_diffuse_mean_free_path, (8.37968100, 3.58352100, 3.5)),
    ],
)
def test_d_is_the_length_over_the_fitted_s(fit, s):
    found = fit((0.8, 0.5, 0.33), (1.0, 2.0, 3.0))
    np.testing.assert_allclose(np.array([1.0, 2.0, 3.0]) / found.d, s, rtol=1e-9)
    np.testing.assert_array_equal(found.total, [0.8, 0.5, 0.33])


@pytest.mark.parametrize("fit", ["searchlight", "diffuse", "from_diffuse_mean_free_path"])
def test_range_is_near_that_of_the_dipole(fit):
    """Both model a half space without internal reflection, but the dipole leaves out single scattering."""
    dipole = Dipole.from_reflectance((0.4, 0.6, 0.8), eta=1.0, mean_free_path=(1.0, 0.3, 0.1))
    length = 1 / dipole.sigma_tr if fit == "from_diffuse_mean_free_path" else dipole.mean_free_path
    ratio = getattr(NormalizedDiffusion, fit)(dipole.total, length).range(0.1) / dipole.range(0.1)
    assert np.all((ratio > 0.7) & (ratio < 1.05))


def test_halving_lengths_scales_reflectance_by_four(profile):
    r = np.array([0.01, 0.3, 4.0])
    np.testing.assert_allclose(NormalizedDiffusion(A, D / 2).reflectance(r / 2), 4 * profile.reflectance(r), rtol=1e-12)


def test_channels_are_independent(profile):
    turned = NormalizedDiffusion.searchlight(A[[2, 0, 1]], D[[2, 0, 1]])
    straight = NormalizedDiffusion.searchlight(A, D)
    r = np.array([[0.01, 0.3], [4.0, 0.0]])
    for name in ("reflectance", "beyond", "line_spread"):
        np.testing.assert_array_equal(getattr(turned, name)(r), getattr(straight, name)(r)[..., [2, 0, 1]])


def test_black_reflects_nothing():
    black = NormalizedDiffusion((0, 0, 0.5), (1, 1, 1))
    r = np.array([0.0, 1.0])
    for name in ("reflectance", "beyond", "line_spread"):
        assert np.all(getattr(black, name)(r)[:, :2] == 0.0)
    assert black.range()[0] == 0.0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (((0.5, 1.1, 0.5), (1, 1, 1)), "albedo of green must be from 0 to 1, not 1.1"),
        (((0.5, -0.1, 0.5), (1, 1, 1)), "albedo of green must be from 0 to 1, not -0.1"),
        (((0.5, np.nan, 0.5), (1, 1, 1)), "albedo of green"),
        ((0.5, (1, 1, 1)), "albedo must be three numbers"),
        (((0.5, 0.5, 0.5), (1, 1, 0)), r"of blue must be above 0 and at most 1e\+12 \(mm\), not 0"),
        (((0.5, 0.5, 0.5), (1, np.inf, 1)), "of green must be above 0"),
    ],
)
@pytest.mark.parametrize("name", ["", "searchlight", "diffuse", "from_diffuse_mean_free_path"])
def test_bad_input_raises_an_error(name, arguments, says):
    with pytest.raises(InputError, match=says):
        (getattr(NormalizedDiffusion, name) if name else NormalizedDiffusion)(*arguments)


def test_bad_distances_raise_an_error(profile):
    for name in ("reflectance", "beyond"):
        with pytest.raises(InputError, match="distances must be at least 0"):
            getattr(profile, name)(-1.0)
