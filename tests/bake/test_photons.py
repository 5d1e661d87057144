"""Photons in flat layers against exact results of transport theory, and the properties of the result."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, trapezoid

from wgsss.bake.photons import trace
from wgsss.errors import InputError
from wgsss.optics import Dipole, Layer, Photons, Profile

SLAB = Layer((1, 1, 1), (2.25, 2.25, 2.25), 1.0, thickness=0.2, g=0.75)
SKIN = Layer((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.3)


@pytest.fixture(scope="module")
def slab(gpu) -> Photons:
    return trace([SLAB], 300_000, gpu=gpu)


@pytest.fixture(scope="module")
def skin(gpu) -> Photons:
    return trace([SKIN], 100_000, gpu=gpu)


def within(found, error, wanted, errors=3.0, least=0.0):
    """Whether a value is within its standard error of the target, with an additional rounding error of `least`."""
    assert np.all(error < 0.03 * np.abs(found) + 1e-9), "too few photons to tell"
    np.testing.assert_array_less(np.abs(found - wanted), errors * error + least)


def fresnel(mu, eta):
    """Return the reflectance at a cosine `mu` from inside, for an index of `eta` relative to the outside."""
    inside = np.sqrt(np.maximum(1 - eta**2 * (1 - mu**2), 0))
    s = (eta * mu - inside) / (eta * mu + inside)
    t = (mu - eta * inside) / (mu + eta * inside)
    return 0.5 * (s**2 + t**2)


def half_space(albedo: float, boundary=lambda mu: 0 * mu, critical: float = 0.5, sky: bool = False) -> float:
    """Return the reflectance of an isotropically scattering half space whose boundary reflects `boundary(mu)` inside.

    By Chandrasekhar's H function: of a beam that enters at `nu`, albedo / 2 H(mu) H(nu) mu / (mu + nu) leaves per mu,
    and the part that the boundary reflects enters again. `critical` is a cosine at which the boundary is not smooth. A
    uniform sky has the same radiance below the boundary, except for the reflected part.
    """
    x, w = np.polynomial.legendre.leggauss(100)
    x, w = 0.5 * (x + 1), 0.5 * w
    mu = np.concatenate([critical * x, critical + (1 - critical) * x**2, [1.0]])
    w = np.concatenate([critical * w, (1 - critical) * 2 * x * w, [0.0]])
    H = np.ones_like(mu)
    kernel = 0.5 * albedo * w * mu / (mu[:, None] + mu)
    for _ in range(400):
        H = 0.5 * (H + 1 / (np.sqrt(1 - albedo) + kernel @ H))
    leaving = 0.5 * albedo * (H * mu)[:, None] * H / (mu[:, None] + mu)
    reflected = boundary(mu)
    entering = mu * (1 - reflected) * w if sky else np.eye(len(mu))[-1]
    first = leaving @ entering / entering.sum()
    total = np.linalg.solve(np.eye(len(mu)) - leaving * (reflected * w), first)
    return float(np.sum((1 - reflected) * total * w))


def test_slab_of_van_de_hulst(slab):
    """Wang, Jacques & Zheng 1995, table 1: R 0.09739 and T 0.66096."""
    within(slab.total, slab.total_error, 0.09739, least=5e-6)
    within(slab.total_transmittance, slab.total_transmittance_error, 0.66096, least=5e-6)


@pytest.mark.parametrize(("eta", "sky", "of_incident"), [(1.3, False, None), (1.5, True, None), (1.5, False, 0.2600)])
def test_half_space_of_giovanelli(gpu, eta, sky, of_incident):
    """Wang, Jacques & Zheng 1995, table 2: 0.2600 including surface reflection. Here to more digits."""
    photons = trace([Layer((1, 1, 1), (9, 9, 9), eta)], 200_000, sky=sky, gpu=gpu)
    exact = half_space(0.9, lambda mu: fresnel(mu, eta), np.sqrt(1 - eta**-2), sky)
    within(photons.total, photons.total_error, exact)
    if of_incident:
        specular = photons.specular
        assert specular + (1 - specular) * exact == pytest.approx(of_incident, abs=1e-4)


def test_half_space_under_glass(gpu):
    """Rays are refracted by a clear layer whose index lies between that of the half space and that of air."""
    inner, outer = 1.5, 1.25

    def boundary(mu):
        lower = fresnel(mu, inner / outer)
        mu_outer = np.sqrt(np.maximum(1 - (inner / outer) ** 2 * (1 - mu**2), 1e-12))
        upper = fresnel(mu_outer, outer)
        there_and_back = np.where(lower < 1, (1 - lower) ** 2 / np.maximum(1 - lower * upper, 1e-9), 0)
        return lower + there_and_back * upper

    glass = Layer((0, 0, 0), (1e-6, 1e-6, 1e-6), outer, thickness=0.1)
    photons = trace([glass, Layer((1, 1, 1), (9, 9, 9), inner)], 100_000, gpu=gpu)
    lower, upper = fresnel(1.0, inner / outer), fresnel(1.0, outer)
    entered = (1 - lower) / (1 - lower * upper)
    at_once = lower * (1 - upper) / (1 - lower * upper)
    exact = half_space(0.9, boundary, np.sqrt(1 - inner**-2))
    within(photons.total, photons.total_error, at_once + entered * exact)


def test_gap_above_a_half_space_is_air(gpu):
    """A layer of air that hardly interacts. Photons then meet the surface of the half space from above."""
    gap = Layer((0, 0, 0), (1e-6, 1e-6, 1e-6), 1.0, thickness=0.5)
    photons = trace([gap, Layer((1, 1, 1), (9, 9, 9), 1.5)], 100_000, gpu=gpu)
    assert photons.specular == 0
    within(photons.total, photons.total_error, 0.2600, least=5e-5)
    bounced = 0.04  # at the boundary, straight back
    within(photons.R[0] * photons.areas[0], photons.R_error[0] * photons.areas[0], bounced)


def test_refraction_sets_where_light_leaves(gpu):
    """From a dark half space with short paths through 1 mm of clear glass: the radius in mm is the tangent of the
    angle."""
    inner, outer, albedo = 1.5, 1.2, np.full(3, 0.2)
    glass = Layer((0, 0, 0), (1e-6, 1e-6, 1e-6), outer, thickness=1.0)
    photons = trace([glass, Layer(1e4 * (1 - albedo), 1e4 * albedo, inner)], 200_000, gpu=gpu)

    def leaving(r):  # scattered once: albedo / 2 * mu / (1 + mu) leaves per mu within
        sine = r / np.hypot(r, 1) * outer / inner
        mu = np.sqrt(1 - sine**2)
        slope = (outer / inner) ** 2 * r / (mu * np.hypot(r, 1) ** 4)  # of mu by r
        through = (1 - fresnel(mu, inner / outer)) * (1 - fresnel(1 / np.hypot(r, 1), outer))
        return mu / (1 + mu) * slope * through

    steps = [quad(leaving, a, b)[0] for a, b in pairwise((0.1, 0.5, 0.9, 1.2, 1.5))]  # mm
    total = (photons.beyond(0.1) - photons.beyond(1.5)).mean()
    found = [(photons.beyond(a) - photons.beyond(b)).mean() / total for a, b in pairwise((0.1, 0.5, 0.9, 1.2, 1.5))]
    np.testing.assert_allclose(found, np.divide(steps, sum(steps)), rtol=0.06)


@pytest.mark.parametrize("albedo", [(0.3, 0.6, 0.9), (0.99, 0.9999, 0.99999)])
def test_half_spaces_of_chandrasekhar(gpu, albedo):
    """In the last two, photons leap."""
    sigma_t = np.array([1.0, 2.0, 5.0])
    layer = Layer(sigma_t * (1 - np.array(albedo)), sigma_t * albedo, 1.0)
    for sky in (False, True):
        photons = trace([layer], 100_000, sky=sky, gpu=gpu)
        within(photons.total, photons.total_error, [half_space(a, sky=sky) for a in albedo])


def test_light_far_away_without_absorption(gpu):
    """The light that diffuses there comes from a depth of H(1) / sqrt(3) mean free paths beyond the extrapolated
    boundary."""
    photons = trace([Layer((0, 0, 0), (1, 2, 5), 1.0)], 50_000, gpu=gpu)
    np.testing.assert_allclose(photons.total, 1, rtol=1e-12)
    small = 1e-8
    depth = (1 - half_space(1 - small)) / np.sqrt(small) / np.sqrt(3)
    for paths in (30, 100):
        beyond = photons.beyond(paths / np.array([1, 2, 5])).diagonal()
        assert beyond.mean() == pytest.approx(depth / paths, abs=3 * np.sqrt(depth / paths / 150_000))


def test_photons_leap_through_a_thick_slab(gpu):
    """The transmitted share of a slab without absorption is that depth over the thickness between extrapolated
    boundaries."""
    small, thickness = 1e-8, 56.0
    depth = (1 - half_space(1 - small)) / np.sqrt(small) / np.sqrt(3)
    photons = trace([Layer((0, 0, 0), (1, 1, 1), 1.0, thickness=thickness)], 200_000, gpu=gpu)
    error = np.sqrt(np.sum(np.square(photons.total_transmittance_error))) / 3
    within(photons.total_transmittance.mean(), error, depth / (thickness + 2 * 0.710446))


@pytest.mark.parametrize("side", ["R", "T"])
def test_single_scattering_by_distance(gpu, side):
    """Single isotropic scattering at a depth z: an integral over z."""
    albedo, sigma_t, thickness = 0.01, 2.0, 0.6
    photons = trace(
        [Layer(sigma_t * (1 - albedo) * np.ones(3), sigma_t * albedo * np.ones(3), 1.0, thickness)], 400_000, gpu=gpu
    )

    def ring(z, inner, outer):  # out of the slab between two radii
        height = z if side == "R" else thickness - z

        def through(r):
            d = np.hypot(r, height)
            return r * np.exp(-sigma_t * (z + d)) * height / (2 * d**3)

        return albedo * sigma_t * quad(through, inner, outer)[0]

    means = getattr(photons, side).mean(axis=1) * photons.areas[:, 0]
    errors = np.sqrt(np.mean(np.square(getattr(photons, f"{side}_error")), axis=1) / 3) * photons.areas[:, 0]
    edges = [np.searchsorted(photons.edges, r) for r in (0.01, 0.03, 0.1, 0.3, 1.0)]
    for first, last in pairwise(edges):
        wanted = quad(ring, 0, thickness, args=(photons.edges[first], photons.edges[last]))[0]
        error = np.sqrt(np.sum(np.square(errors[first:last])))
        assert error < 0.05 * wanted
        assert abs(means[first:last].sum() - wanted) < 3 * error + 0.015 * wanted  # scattered twice is 0.01 as much


def test_clear_layers_absorb_by_beer_and_reflect_by_fresnel(gpu):
    """Straight down and up again through two layers of different index, any number of times."""
    eta, sigma_a, thickness = (1.0, 1.4, 1.9, 1.2), (0.5, 0.3), (0.4, 0.9)
    layers = [
        Layer((s, s, s), (1e-6, 1e-6, 1e-6), n, thickness=t)
        for n, s, t in zip(eta[1:3], sigma_a, thickness, strict=True)
    ]
    photons = trace(layers, 100_000, eta_below=eta[3], gpu=gpu)
    top, middle, bottom = (((b - a) / (b + a)) ** 2 for a, b in pairwise(eta))
    first, second = np.exp(-np.multiply(sigma_a, thickness))
    # Light within the layers, just below and above each boundary: down1 = 1 + top up1, ...
    system = np.array(
        [
            [1, -top, 0, 0],
            [-middle * first**2, 1, 0, -(1 - middle) * first * second],
            [-(1 - middle) * first, 0, 1, -middle * second],
            [0, 0, -bottom * second, 1],
        ]
    )
    down1, up1, down2, up2 = np.linalg.solve(system, [1, 0, 0, 0])
    assert down1 - up1 * top == pytest.approx(1)
    assert up2 == pytest.approx(bottom * second * down2)
    within(photons.total, photons.total_error, (1 - top) * up1)
    within(photons.total_transmittance, photons.total_transmittance_error, (1 - bottom) * second * down2)
    assert photons.specular == pytest.approx(top)
    np.testing.assert_allclose(photons.T[0] * photons.areas[0], photons.total_transmittance, rtol=1e-4)


@pytest.mark.parametrize(("eta", "specular"), [(1.0, 0.0), (1.3, 0.0170), (1.5, 0.04)])
def test_specular_reflection(gpu, eta, specular):
    layer = Layer((9, 9, 9), (1, 1, 1), eta)
    assert trace([layer], 1, gpu=gpu).specular == pytest.approx(specular, abs=5e-5)
    cosine, w = np.polynomial.legendre.leggauss(64)
    cosine = 0.5 * (cosine + 1)
    below = np.sqrt(1 - (1 - cosine**2) / eta**2)
    of_sky = np.sum(w * cosine * fresnel(below, eta))
    assert trace([layer], 1, sky=True, gpu=gpu).specular == pytest.approx(of_sky, abs=2e-3)


def test_energy_is_conserved(slab, skin):
    for photons in (slab, skin):
        np.testing.assert_allclose(photons.balance, 1, rtol=0, atol=1e-5)
    assert np.all(skin.total_transmittance == 0)


def test_results_are_reproducible(gpu, monkeypatch):
    first = trace([SLAB, SLAB], 3_000, seed=7, gpu=gpu)
    monkeypatch.setattr(gpu, "is_cpu", not gpu.is_cpu)  # changes the number of lanes and the order of execution
    monkeypatch.setattr("wgsss.bake.photons._ROUND", 10)  # batches: seven rounds instead of one
    again = trace([SLAB, SLAB], 3_000, seed=7, gpu=gpu)
    other = trace([SLAB, SLAB], 3_000, seed=8, gpu=gpu)
    for name in ("R", "T", "R_error", "total_error", "absorbed"):
        np.testing.assert_allclose(getattr(first, name), getattr(again, name), rtol=1e-12)
        assert np.any(getattr(first, name) != getattr(other, name))


def test_standard_errors_match_the_spread_of_repetitions(gpu):
    runs = [trace([SLAB], 5_000, seed=seed, gpu=gpu) for seed in range(40)]
    for name in ("total", "total_transmittance"):
        found = np.array([getattr(run, name) for run in runs])
        errors = np.array([getattr(run, f"{name}_error") for run in runs])
        assert found.std() == pytest.approx(
            np.sqrt(np.mean(np.square(errors))), rel=0.2
        )  # 120 repetitions: one standard error is 6.5 %
    rings = slice(60, 160)
    found = np.array([run.R[rings].mean(axis=1) for run in runs])
    errors = np.array([np.sqrt(np.sum(np.square(run.R_error[rings]), axis=1)) / 3 for run in runs])
    assert found.var(axis=0, ddof=1).sum() == pytest.approx(np.square(errors).mean(axis=0).sum(), rel=0.25)
    assert np.all(np.isinf(trace([SLAB], 1, gpu=gpu).total_error))


def test_a_layer_split_in_two_gives_the_same_result(gpu, slab):
    cut = [Layer(SLAB.sigma_a, SLAB.sigma_s_prime, 1.0, thickness=t, g=SLAB.g) for t in (0.07, 0.13)]
    photons = trace(cut, 100_000, seed=1, gpu=gpu)
    for name in ("total", "total_transmittance"):
        error = np.hypot(getattr(photons, f"{name}_error"), getattr(slab, f"{name}_error"))
        within(getattr(photons, name), error, getattr(slab, name))


def test_permuted_channels_permute_results(gpu, skin):
    turned = trace([Layer(SKIN.sigma_a[[2, 0, 1]], SKIN.sigma_s_prime[[2, 0, 1]], SKIN.eta)], 100_000, gpu=gpu)
    error = np.hypot(turned.total_error, skin.total_error[[2, 0, 1]])
    within(turned.total, error, skin.total[[2, 0, 1]])
    np.testing.assert_allclose(turned.range(0.1), skin.range(0.1)[[2, 0, 1]], rtol=0.05)


def test_halving_lengths_scales_reflectance_by_four(gpu):
    whole = trace([SLAB, SKIN], 2_000, gpu=gpu)
    half = trace(
        [
            Layer(2 * layer.sigma_a, 2 * layer.sigma_s_prime, layer.eta, layer.thickness / 2, layer.g)
            for layer in (SLAB, SKIN)
        ],
        2_000,
        gpu=gpu,
    )
    np.testing.assert_array_equal(2 * half.edges, whole.edges)
    np.testing.assert_allclose(half.R, 4 * whole.R, rtol=1e-12)
    np.testing.assert_array_equal(half.absorbed, whole.absorbed)


def test_channels_have_their_own_random_numbers(slab):
    assert len(set(slab.total)) == 3


@pytest.fixture
def counted(skin) -> tuple[Photons, Dipole]:
    """Return the counts that photons would have if they followed a dipole's profile, with a share outside the last
    ring, and the dipole."""
    dipole = Dipole((0, 0.001, 0.03), (1, 2, 3), 1.3)
    edges = skin.edges[skin.edges < 60]
    share = dipole.total * (dipole.beyond(edges[:-1]) - dipole.beyond(edges[1:]))
    R = share / (np.pi * np.diff(np.square(edges))[:, None])
    none, zero = np.zeros_like(R), np.zeros(3)
    outside = dipole.total * dipole.beyond(edges[-1])
    return Photons(edges, R, none, 2 * R, none, outside, 2 * outside, zero, zero, zero, 0.0, 1), dipole


def test_counts_can_be_used_as_a_profile(counted):
    photons, dipole = counted
    np.testing.assert_allclose(photons.total, dipole.total, rtol=1e-9)
    np.testing.assert_allclose(photons.total_transmittance, 2 * dipole.total, rtol=1e-9)
    r = np.geomspace(0.02, 40, 60)
    most = dipole.beyond(r) > 0.01
    np.testing.assert_allclose(photons.reflectance(r)[most], dipole.reflectance(r)[most], rtol=0.01)
    np.testing.assert_allclose(photons.transmittance(r)[most], 2 * dipole.reflectance(r)[most], rtol=0.01)
    np.testing.assert_allclose(photons.beyond(r)[most], dipole.beyond(r)[most], rtol=0.01)
    np.testing.assert_allclose(photons.line_spread(-r)[most], dipole.line_spread(r)[most], rtol=0.02)
    np.testing.assert_allclose(photons.range(0.02), dipole.range(0.02), rtol=3e-3)
    far = np.array([80.0, 500.0])  # without absorption light falls as 1/r^3
    for name in ("reflectance", "beyond", "line_spread"):
        np.testing.assert_allclose(getattr(photons, name)(far)[:, 0], getattr(dipole, name)(far)[:, 0], rtol=0.02)
    for r in (0.0, photons.edges[-1], 1e9):
        for found in (photons.reflectance(r), photons.beyond(r), photons.line_spread(r), photons.transmittance(r)):
            assert np.all(np.isfinite(found)) and np.all(found >= 0)


def test_counts_are_exact_at_edges(skin):
    beyond = skin.beyond(skin.edges)
    np.testing.assert_allclose(beyond[0], 1, rtol=1e-14)
    np.testing.assert_allclose(beyond[:-1] - beyond[1:], skin.R * skin.areas / skin.total, atol=1e-12)
    half = np.sqrt(0.5 * (skin.edges[100] ** 2 + skin.edges[101] ** 2))  # half of the ring's area
    np.testing.assert_allclose(skin.beyond(half), 0.5 * (beyond[100] + beyond[101]), rtol=1e-12)
    x = np.concatenate([[0.0], np.geomspace(1e-4, 60, 2000)])
    np.testing.assert_allclose(2 * trapezoid(skin.line_spread(x), x, axis=0), skin.total, rtol=2e-3)
    np.testing.assert_allclose(Profile.beyond(skin, 0.5), skin.beyond(0.5), rtol=0.01)


def test_invalid_input_is_an_error(gpu):
    for arguments, says in (
        ({"photons": 0}, "photons must be a whole number from 1"),
        ({"photons": 1.5}, "photons must be a whole number"),
        ({"photons": 2**31}, "photons must be a whole number"),
        ({"seed": -1}, "seed must be a whole number of at least 0, not -1"),
        ({"eta_below": 0.9}, "eta_below must be a number from 1 to 3"),
        ({"eta_below": np.nan}, "eta_below must be a number from 1 to 3"),
        ({"layers": []}, "at least one layer"),
        ({"layers": [SKIN, SLAB, SKIN]}, "layer 1 is infinitely thick"),
    ):
        with pytest.raises(InputError, match=says):
            trace(**{"layers": [SKIN], "gpu": gpu, **arguments})
