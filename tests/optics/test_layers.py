from __future__ import annotations

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.optics import Dipole, Layer, Profile
from wgsss.optics.layers import Layers
from wgsss.optics.multipole import Multipole

# Mikkelsen 2009, table 3, after Donner and Jensen 2006.
UPPER = Layer((0.005,) * 3, (1.3,) * 3, 1.4, thickness=6.0)
LOWER = Layer((0.01,) * 3, (1.0,) * 3, 1.4)
TABLE_3 = Layers((UPPER, LOWER))

SKIN = Layer((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.4, thickness=1.6)
FAT = Layer((0.01, 0.02, 0.05), (1.2, 1.3, 1.4), 1.44, thickness=3.0)
MUSCLE = Layer((0.1, 0.3, 0.4), (0.8, 0.9, 1.0), 1.37)


def images(sigma_a, sigma_s_prime, thickness, A_lit, A_other, r):
    """Return R and T of a slab lit on one side, by the sums of Mikkelsen 2009, eq. 31 and 32."""
    sigma_t_prime = sigma_a + sigma_s_prime
    mfp, sigma_tr = 1 / sigma_t_prime, np.sqrt(3 * sigma_a * sigma_t_prime)
    R, T = np.zeros_like(r), np.zeros_like(r)

    def term(z):
        d = np.hypot(r, z)
        return (sigma_tr * d + 1) * z * np.exp(-sigma_tr * d) / d**3

    for i in range(-20, 21):
        shift = i * 2 * (thickness + 2 / 3 * mfp * (A_lit + A_other))
        real, virtual = -mfp + shift, mfp + 4 / 3 * A_lit * mfp + shift
        R += term(virtual) - term(real)
        T += term(real + thickness) - term(virtual + thickness)
    scale = sigma_s_prime / sigma_t_prime / (4 * np.pi)
    return scale * R, scale * T


@pytest.fixture(scope="module")
def by_fft():
    """Return R and T of table 3 as in Mikkelsen 2009, 2.7.3: by Fourier transforms of profiles on a plane of 128 mm."""
    n, step = 512, 0.25
    x = np.fft.fftfreq(n, 1 / (n * step))
    r = np.hypot(x[:, None], x)
    at, inverse = np.unique(r.round(9), return_inverse=True)
    out, inside = 3.25070, 1.0  # A for an index of 1.4 under air (polynomial), and for equal indices
    over = np.hypot(at, 1e-12)
    top_R, top_T = images(0.005, 1.3, 6.0, out, inside, over)
    bottom_R, bottom_T = images(0.005, 1.3, 6.0, inside, out, over)
    half_space = images(0.01, 1.0, 1e4, inside, 1.0, over)[0]
    R1, T1, R1_below, T1_up, R2 = (
        np.fft.fft2(profile[inverse.reshape(r.shape)]) * step**2
        for profile in (top_R, top_T, bottom_R, bottom_T, half_space)
    )
    joined = R1 + T1_up * R2 * T1 / (1 - R2 * R1_below)
    # 0.5943: equal indices are no boundary, A = 1.
    assert (R2 * R1_below)[0, 0].real == pytest.approx(0.5943, abs=5e-5)
    return r, np.fft.ifft2(joined).real / step**2


def test_table_3_is_that_of_a_plane_transform(by_fft):
    r, R = by_fft
    for low, high, bar in ((0.0, 1.6, 5e-7), (1.6, 25.0, 1e-6)):
        ring = (r >= low) & (r <= high)
        at, where = np.unique(r[ring].round(9), return_index=True)
        some = slice(None, None, 1 + len(at) // 300)
        np.testing.assert_allclose(TABLE_3.reflectance(at[some])[:, 0], R[ring][where][some], rtol=bar)
    assert TABLE_3.total[0] == pytest.approx(R.sum() * 0.25**2, rel=2e-6)


def test_no_light_leaves_an_infinitely_thick_stack_below():
    np.testing.assert_array_equal(TABLE_3.total_transmittance, 0.0)
    np.testing.assert_array_equal(TABLE_3.transmittance([0.0, 1.0]), 0.0)


@pytest.mark.parametrize(
    ("layers", "eta_below"),
    [
        ([SKIN, FAT, MUSCLE], 1.0),
        ([SKIN, FAT], 1.3),
        ([FAT, SKIN, FAT, SKIN], 1.0),
        ([Layer((0, 0, 0), (1, 2, 9), 1.5, thickness=1.01), Layer((0, 0, 0), (1, 2, 9), 1.0, thickness=40.0)], 1.6),
    ],
)
def test_energy_is_conserved(layers, eta_below):
    """R and T together are at most 1, and 1 without absorption."""
    stack = Layers(layers, eta_below)
    assert np.all(stack.total + stack.total_transmittance < 1.0 + 1e-14)
    clear = Layers([Layer((0, 0, 0), layer.sigma_s_prime, layer.eta, layer.thickness) for layer in layers], eta_below)
    np.testing.assert_allclose(clear.total + clear.total_transmittance, 1.0, rtol=1e-13)


def test_one_layer_is_a_slab():
    """The relative error is 1e-8 where R and T are above 1e-6 of their peaks."""
    one = Layers([SKIN], 1.2)
    slab = Multipole(SKIN.sigma_a, SKIN.sigma_s_prime, SKIN.eta, thickness=SKIN.thickness, eta_below=1.2)
    r = np.array([0.0, 1e-9, 1e-3, 0.1, 1.0, 4.0])
    np.testing.assert_allclose(one.reflectance(r), slab.reflectance(r), rtol=1e-8)
    np.testing.assert_allclose(one.transmittance(r), slab.transmittance(r), rtol=1e-8)
    np.testing.assert_allclose(one.line_spread(-r[2:]), slab.line_spread(r[2:]), rtol=1e-8)
    np.testing.assert_allclose(one.beyond(r), slab.beyond(r), rtol=1e-8)
    np.testing.assert_array_equal(one.total, slab.total)
    np.testing.assert_array_equal(one.total_transmittance, slab.total_transmittance)


def test_one_infinitely_thick_layer_is_a_dipole():
    for sigma_a in (MUSCLE.sigma_a, (0, 0, 0)):
        one = Layers([Layer(sigma_a, MUSCLE.sigma_s_prime, 1.37)])
        dipole = Dipole(sigma_a, MUSCLE.sigma_s_prime, 1.37)
        r = np.array([0.0, 1e-3, 0.1, 1.0, 10.0])
        np.testing.assert_allclose(one.total, dipole.total, rtol=1e-14)
        np.testing.assert_allclose(one.reflectance(r), dipole.reflectance(r), rtol=2e-9)
        np.testing.assert_allclose(one.beyond(r), dipole.beyond(r), rtol=1e-9, atol=1e-13)
        np.testing.assert_allclose(one.line_spread(r[1:]), dipole.line_spread(r[1:]), rtol=2e-9)


def test_deep_layers_do_not_change_the_reflectance():
    thick = Layer(SKIN.sigma_a, SKIN.sigma_s_prime, SKIN.eta, thickness=60.0)
    buried = Layers([thick, FAT, Layer(MUSCLE.sigma_a, MUSCLE.sigma_s_prime, SKIN.eta)])
    bare = Dipole(SKIN.sigma_a, SKIN.sigma_s_prime, SKIN.eta)
    np.testing.assert_allclose(buried.reflectance([0.1, 2.0, 5.0]), bare.reflectance([0.1, 2.0, 5.0]), rtol=1e-8)


def test_a_stack_turned_over_has_another_transmittance():
    """The source is one mean free path below the lit face, so T+ and T- differ in this model."""
    stack, turned = Layers([SKIN, FAT]), Layers([FAT, SKIN])
    ratio = turned.total_transmittance / stack.total_transmittance
    assert np.all(np.abs(ratio - 1.0) > 0.05)


def test_three_layers_are_a_layer_on_a_stack_of_two():
    """Light goes back and forth between the first layer and the stack below it: explicit bounces, at some frequencies.

    All of index 1, so that each layer's R and T are those it has alone, lit on either side.
    """
    first, second, third = (
        Layer(layer.sigma_a, layer.sigma_s_prime, 1.0, layer.thickness) for layer in (SKIN, FAT, MUSCLE)
    )
    alone, below, whole = Layers([first]), Layers([second, third]), Layers([first, second, third])
    for k in (0.0, 0.3, 2.0):
        light = alone.transmitted_spectrum(k)
        found = alone.spectrum(k)
        for _ in range(200):
            light = light * below.spectrum(k)
            found = found + light * alone.transmitted_spectrum(k)
            light = light * alone.spectrum(k)
        np.testing.assert_allclose(whole.spectrum(k), found, rtol=1e-12)


def test_integrals_are_those_of_reflectance():
    for stack in (TABLE_3, Layers([SKIN, FAT])):
        r = np.array([0.5])
        np.testing.assert_allclose(stack.beyond(r), Profile.beyond(stack, r), atol=1e-9)
        np.testing.assert_allclose(stack.line_spread(-r), Profile.line_spread(stack, r), rtol=1e-6)
    assert TABLE_3.beyond(TABLE_3.range(0.01))[0, 0] == pytest.approx(0.01, rel=1e-9)


def test_total_transmittance_is_the_integral_over_the_plane():
    stack = Layers([SKIN, FAT, SKIN], 1.2)
    log_r = np.linspace(np.log(1e-4), np.log(200.0), 400)  # 2 pi T r dr by the trapezoid rule in log r
    r = np.exp(log_r)
    ring = 2 * np.pi * (r * r)[:, None] * stack.transmittance(r)
    np.testing.assert_allclose(ring.sum(axis=0) * (log_r[1] - log_r[0]), stack.total_transmittance, rtol=1e-7)


def test_profiles_are_finite_and_not_negative_at_any_distance():
    """Fits and quadratures sample over these distances."""
    r = np.array([0.0, 1e-300, 1e-9, 1e-5, 1e5, 1e9, 1e150, np.inf])
    for stack in (TABLE_3, Layers([SKIN, FAT]), Layers([Layer((0, 0, 0), (1, 5, 50), 1.3)])):
        for profile in (stack.reflectance, stack.transmittance, stack.beyond, stack.line_spread):
            found = profile(r)
            assert found.shape == (8, 3)
            assert np.all(np.isfinite(found)) and np.all(found >= 0.0)
        np.testing.assert_allclose(stack.beyond(r)[[0, -1]], [[1.0] * 3, [0.0] * 3], atol=1e-9)


def test_halving_lengths_scales_profiles_by_four():
    half = [Layer(2 * layer.sigma_a, 2 * layer.sigma_s_prime, layer.eta, layer.thickness / 2) for layer in (SKIN, FAT)]
    r = np.array([0.0, 0.1, 1.0, 4.0])
    whole, halved = Layers([SKIN, FAT]), Layers(half)
    np.testing.assert_allclose(halved.reflectance(r / 2), 4 * whole.reflectance(r), rtol=1e-12)
    np.testing.assert_allclose(halved.transmittance(r / 2), 4 * whole.transmittance(r), rtol=1e-12)


def test_channels_are_independent():
    order = [2, 0, 1]
    turned = [
        Layer(layer.sigma_a[order], layer.sigma_s_prime[order], layer.eta, layer.thickness) for layer in (SKIN, FAT)
    ]
    r = np.array([[0.2, 2.0], [4.0, 11.0]])
    found = Layers([SKIN, FAT]).reflectance(r)
    assert found.shape == (2, 2, 3)
    np.testing.assert_allclose(Layers(turned).reflectance(r), found[..., order], rtol=1e-11)


@pytest.mark.parametrize(
    ("layers", "eta_below", "says"),
    [
        ([], 1.0, "a stack needs at least one layer"),
        ([LOWER, UPPER], 1.0, "layer 1 is infinitely thick"),
        (
            [UPPER, Layer((0, 0, 0.5), (3, 3, 1), thickness=0.5), LOWER],
            1.0,
            "thickness of layer 2 must be above the mean free path of blue, 0.6667 mm, not 0.5",
        ),
        ([Layer((0, 0, 0), (0.9, 3, 1), thickness=1.1)], 1.0, "thickness of layer 1 .* red, 1.111 mm, not 1.1"),
        ([Layer((0, 0, 0), (1, 1, 1), 1.5, thickness=1.1)], 1.5, r"at least 1\.97\d mm in red"),
        ([SKIN], 0.9, "eta_below must be a number from 1 to 3, not 0.9"),
    ],
)
def test_bad_stacks_raise_an_error(layers, eta_below, says):
    with pytest.raises(InputError, match=says):
        Layers(layers, eta_below)
