from __future__ import annotations

import numpy as np
import pytest
from scipy.special import k0, k1

from wgsss.optics import hankel

R = np.geomspace(1e-3, 300.0, 60)
DEPTHS = np.array([0.7, 1.0, 4.5])  # mm, one for each channel


def depth_spectrum(sigma_tr):
    """Return twice the transform of the flux of a source through a plane at DEPTHS from it."""
    return lambda k: np.exp(-DEPTHS * np.sqrt(sigma_tr**2 + np.square(np.asarray(k))[..., None]))


def test_sources_without_absorption():
    """exp(-z k) is the transform of z / (2 pi d^3): all three integrals are algebraic."""
    spectrum, r = depth_spectrum(0.0), R[:, None]
    d = np.hypot(r, DEPTHS)
    np.testing.assert_allclose(hankel.plane(spectrum, R), DEPTHS / (2 * np.pi * d**3), rtol=1e-10)
    np.testing.assert_allclose(hankel.outside(spectrum, R), DEPTHS / d, rtol=1e-11)
    np.testing.assert_allclose(hankel.line(spectrum, R), DEPTHS / (np.pi * d**2), rtol=1e-10)


@pytest.mark.parametrize("sigma_tr", [0.01, 0.3, 1.7])
def test_sources_with_absorption(sigma_tr):
    """The error is 1e-13 of the total, spread over the circle: rounding dominates where exp(-sigma_tr r) is smaller."""
    spectrum, r = depth_spectrum(sigma_tr), R[:, None]
    d = np.hypot(r, DEPTHS)
    total = np.exp(-sigma_tr * DEPTHS)
    decay = np.exp(-sigma_tr * d)
    plane = DEPTHS * (1 + sigma_tr * d) * decay / (2 * np.pi * d**3)
    line = DEPTHS * sigma_tr * k1(sigma_tr * d) / (np.pi * d)
    for found, wanted, size in (
        (hankel.plane(spectrum, R), plane, total / (2 * np.pi * r**2)),
        (hankel.outside(spectrum, R), DEPTHS * decay / d, total),
        (hankel.line(spectrum, R), line, total / (np.pi * r)),
    ):
        assert np.all(np.abs(found - wanted) < 1e-10 * wanted + 1e-13 * size)


def test_modes_of_slabs():
    """The transform 1 / (k^2 + s^2) has its pole on the imaginary axis, and falls off slowly."""
    s = np.array([0.05, 1.0, 20.0])
    r = np.geomspace(1e-2, 10.0, 20)[:, None]

    def spectrum(k):
        return 1 / (s**2 + np.square(np.asarray(k))[..., None])

    for found, wanted, size in (
        (hankel.plane(spectrum, r[:, 0]), k0(s * r) / (2 * np.pi), 1 / (2 * np.pi * r**2)),
        (hankel.outside(spectrum, r[:, 0]), r * k1(s * r) / s, 1.0),
        (hankel.line(spectrum, r[:, 0]), np.exp(-s * r) / (2 * s), 1 / (np.pi * r)),
    ):
        assert np.all(np.abs(found - wanted) < 1e-10 * wanted + 1e-13 * size / s**2)


def test_thick_absorbing_slabs():
    """The light that passes has a transform that is nearly a Gaussian: exp(-z q) with sigma_tr z = 90."""
    z, sigma_tr = 60.0, 1.5
    r = np.geomspace(1e-3, 60.0, 40)

    def spectrum(k):  # without the constant factor
        return np.exp(-z * (np.sqrt(sigma_tr**2 + np.square(np.asarray(k))[..., None]) - sigma_tr)) * np.ones(3)

    d = np.hypot(r, z)[:, None]
    wanted = z * (1 + sigma_tr * d) * np.exp(-sigma_tr * (d - z)) / (2 * np.pi * d**3)
    np.testing.assert_allclose(hankel.plane(spectrum, r), wanted * np.ones(3), rtol=1e-7, atol=1e-13 * wanted.max())


def test_shapes():
    spectrum = depth_spectrum(0.1)
    assert hankel.plane(spectrum, np.array(1.0)).shape == (3,)
    many = np.linspace(0.1, 1.0, 1200).reshape(300, 4)
    found = hankel.plane(spectrum, many)
    assert found.shape == (300, 4, 3)
    np.testing.assert_allclose(found[200, 3], hankel.plane(spectrum, many[200, 3]), rtol=1e-14)
