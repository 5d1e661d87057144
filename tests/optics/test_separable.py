"""Separable kernels against closed forms: line spreads, masses of Gaussians, edges at angles."""

from __future__ import annotations

from math import erf

import numpy as np
import pytest

from wgsss.optics import SKIN_GAUSSIANS, Dipole, SumOfGaussians
from wgsss.optics.burley import NormalizedDiffusion
from wgsss.optics.separable import BEYOND, line_spread, radial, svd

WAX = Dipole(np.array([0.002, 0.008, 0.03]), np.array([0.9, 1.0, 1.1]), 1.44)
WITHOUT_THE_NARROWEST = SumOfGaussians(SKIN_GAUSSIANS.variances[1:], SKIN_GAUSSIANS.weights[1:])


def edge_error(profile, terms, degrees, channel=0):
    """Largest difference, of the profile's total, from its response to an edge at an angle: each cell of the product
    of the terms' cells is a point, and edges pass between many of them."""
    every = max(len(terms[0].x) // 200, 1)
    x = terms[0].x[::every]
    middle = 0.5 * (x[1:] + x[:-1])
    place = np.concatenate([-middle[::-1], middle])
    product = np.zeros((place.size, place.size))
    for term in terms:
        mass = np.diff(term.within[::every, channel]) / 2
        mass = np.concatenate([mass[::-1], mass])
        product += term.scale[channel] * np.outer(mass, mass)
    a = np.radians(degrees)
    along = (place[:, None] * np.cos(a) + place * np.sin(a)).ravel()
    order = np.argsort(along)
    edges = np.linspace(-4, 4, 200)
    # The mean over edges within 0.02 mm to either side, since a cell is a point: it lies on one side or the other.
    near = edges[:, None] + np.linspace(-0.02, 0.02, 9)
    reached = np.concatenate([[0.0], np.cumsum(product.ravel()[order])])[np.searchsorted(along[order], near)].mean(1)
    return np.abs(reached - profile.step_response(near)[..., channel].mean(1)).max() / profile.total[channel]


@pytest.mark.parametrize(("degrees", "error"), [(22.5, 0.062), (45, 0.074)])
def test_the_error_of_the_product_of_line_spreads_at_angles(degrees, error):
    """The expected figures, for all six Gaussians and for five, were computed from the closed form."""
    assert edge_error(SKIN_GAUSSIANS, line_spread(SKIN_GAUSSIANS), degrees) == pytest.approx(error, abs=0.004)
    left = edge_error(WITHOUT_THE_NARROWEST, line_spread(WITHOUT_THE_NARROWEST), degrees)
    assert left * WITHOUT_THE_NARROWEST.total[0] == pytest.approx({22.5: 0.024, 45: 0.034}[degrees], abs=0.002)


@pytest.mark.parametrize("degrees", [10, 22.5, 35, 45])
def test_the_error_with_a_second_product_is_small_at_every_angle(degrees):
    assert edge_error(SKIN_GAUSSIANS, svd(SKIN_GAUSSIANS), degrees) < 0.02
    assert edge_error(WITHOUT_THE_NARROWEST, svd(WITHOUT_THE_NARROWEST), degrees) < 0.008


def test_line_spread_of_gaussians():
    (term,) = line_spread(SKIN_GAUSSIANS)
    v, w = SKIN_GAUSSIANS.variances, SKIN_GAUSSIANS.weights
    x = term.x[::100]
    expected = np.array([[erf(d / np.sqrt(2 * k)) for k in v] for d in x]) @ w
    np.testing.assert_allclose(term.within[::100], expected / expected[-1], atol=2e-5)
    np.testing.assert_allclose(term.scale, w.sum(axis=0))


@pytest.mark.parametrize(
    "profile",
    [WAX, NormalizedDiffusion(np.array([0.8, 0.5, 0.2]), np.array([1.0, 0.5, 0.25]))],
    ids=["dipole", "burley"],
)
def test_line_spread_of_other_profiles_by_quadrature(profile):
    (term,) = line_spread(profile)
    x = np.geomspace(1e-9, term.x[-1], 4000)
    spread = profile.line_spread(x) * x[:, None]
    within = (
        2
        * np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (spread[1:] + spread[:-1]), axis=0)])
        * np.log(x[1] / x[0])
    )
    expected = [np.interp(term.x[100::200], x, column) for column in within.T]
    np.testing.assert_allclose(term.within[100::200], np.stack(expected, 1) / within[-1], atol=2e-4)
    assert np.all(profile.beyond(term.x[-1]) <= BEYOND * 1.001)


def test_the_second_product_adds_no_light():
    """It sums to 0 in all and in each row: it changes neither uniform light nor edges along the passes."""
    first, second = svd(SKIN_GAUSSIANS)
    (line,) = line_spread(SKIN_GAUSSIANS)
    np.testing.assert_allclose(second.within[-1], 0, atol=1e-9)
    expected = [np.interp(first.x, line.x, column) for column in line.within.T]
    np.testing.assert_allclose(first.within, np.stack(expected, 1), atol=3e-3)  # in a square, not in a strip


def test_one_gaussian_is_separable():
    one = SumOfGaussians(np.array([0.5]), np.array([[0.9, 0.5, 0.0]]))
    first, second = svd(one)
    assert np.abs(second.scale).max() < 1e-4
    # Where light leaves in a square, by the product of the strips.
    np.testing.assert_allclose(first.within[:, 0], [erf(x) for x in first.x], atol=3e-3)


def test_the_radial_kernel_is_the_profile_along_a_line():
    (term,) = radial(SKIN_GAUSSIANS)
    v, w = SKIN_GAUSSIANS.variances, SKIN_GAUSSIANS.weights
    x = term.x[::100]
    along = np.array([[erf(d / np.sqrt(2 * k)) / np.sqrt(2 * np.pi * k) for k in v] for d in x]) @ w
    np.testing.assert_allclose(term.within[::100], along / along[-1], atol=1e-3)
    assert 0.15 < edge_error(SKIN_GAUSSIANS, (term,), 0) < 0.25


@pytest.mark.parametrize("kernel", [line_spread, svd, radial])
def test_black_channels_and_black_profiles(kernel):
    for weights in ([0.5, 0.0, 0.1], [0.0, 0.0, 0.0]):
        for term in kernel(SumOfGaussians(np.array([0.5]), np.array([weights]))):
            assert np.isfinite(term.within).all() and np.isfinite(term.x).all()
            assert (term.scale[np.equal(weights, 0.0)] == 0).all()
