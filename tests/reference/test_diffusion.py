"""Diffusion models against photons: how accurate they are, and where they are known to fail."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.photons import trace
from wgsss.optics import BetterDipole, Dipole, Layer, Layers, Multipole, Photons, Profile

SKIN1 = ((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.3)
# Mikkelsen 2009, table 3, after Donner & Jensen 2006
TWO_LAYERS = [Layer((0.005,) * 3, (1.3,) * 3, 1.4, thickness=6.0), Layer((0.01,) * 3, (1.0,) * 3, 1.4)]


@pytest.fixture(scope="module")
def skin() -> Photons:
    return trace([Layer(*SKIN1)], 300_000, seed=1)


def rings(profile: Profile, edges: np.ndarray) -> np.ndarray:
    """Return the light that leaves between successive radii (n, 3)."""
    return -np.diff(profile.beyond(edges), axis=0) * profile.total


def test_two_layers_within_12_percent_and_2_5_in_total():
    photons, layers = trace(TWO_LAYERS, 200_000, seed=1), Layers(TWO_LAYERS)
    edges = np.geomspace(1.6, 25.0, 13)
    ratio = rings(layers, edges)[:, 0] / rings(photons, edges).mean(axis=1)  # three runs of the same medium
    assert np.all(np.abs(ratio - 1) < 0.12), ratio
    assert layers.total[0] == pytest.approx(photons.total.mean(), rel=0.025)


def test_dipole_of_skin1_in_red_within_10_percent_from_2_5_mm_and_not_nearer(skin):
    """Close to the light, diffusion lacks single scattering. Around one mean free path, 1.3 mm, it is too bright."""
    dipole = Dipole(*SKIN1)
    edges = np.array([0.0, 0.25, 1.0, 1.6, 2.5, 4.0, 6.0, 9.0, 13.0])
    ratio = (rings(dipole, edges) / rings(skin, edges))[:, 0]
    assert ratio[0] < 0.3 and ratio[2] > 1.2
    np.testing.assert_allclose(ratio[4:], 1.0, atol=0.1)


def test_better_dipole_misses_single_scattering(skin):
    """Its total for Skin1 is 7.8, 24 and 39 % below that of photons. For milk it is within 1 %."""
    np.testing.assert_allclose(1 - BetterDipole(*SKIN1).total / skin.total, [0.078, 0.24, 0.39], atol=0.015)
    milk = ((0.0011, 0.0024, 0.014), (2.55, 3.21, 3.77), 1.3)
    np.testing.assert_allclose(BetterDipole(*milk).total, trace([Layer(*milk)], 30_000).total, rtol=0.02)


def test_thick_white_slabs_within_2_percent():
    """For slabs thicker than four mean free paths with a high albedo, R is within 1 % and T within 2 %, plus noise."""
    medium = ((0.0021, 0.0041, 0.0071), (2.19, 2.62, 3.0), 1.5)
    slab, photons = Multipole(*medium, thickness=4.0), trace([Layer(*medium, thickness=4.0)], 60_000, seed=2)
    np.testing.assert_allclose(slab.total, photons.total, rtol=0.02)
    np.testing.assert_allclose(slab.total_transmittance, photons.total_transmittance, rtol=0.05)
