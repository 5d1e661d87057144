"""The profile of layers with maps: diffusion theory where it has one, else a table of photons."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.layer_profile import diffusion_profile, photon_table
from wgsss.bake.photons import trace
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.optics import Dipole, Layer, Layers
from wgsss.scene import Maps, Material
from wgsss.scene.layermaps import LayerMaps

THIN = (
    Layer(np.full(3, 0.01), np.array([0.5, 0.6, 0.7]), 1.4, thickness=0.5),
    Layer(np.array([0.01, 0.05, 0.2]), np.full(3, 1.0), 1.4),
)
MAPS = Maps(layers=(LayerMaps(np.full((1, 1), 255, np.uint8)), LayerMaps()))


def test_thin_layers_with_maps_have_the_total_and_the_spread_of_photons(gpu: Gpu) -> None:
    profile = diffusion_profile(gpu, Material("thin", layers=THIN, maps=MAPS))
    photons = trace(THIN, 100_000, seed=5, gpu=gpu)
    assert profile.total == pytest.approx(photons.total, rel=0.01)
    r = np.geomspace(0.1, 10.0, 9)
    assert profile.beyond(r) == pytest.approx(photons.beyond(r), abs=0.01)
    inside = r[r < 5]
    assert profile.reflectance(inside) == pytest.approx(photons.reflectance(inside), rel=0.15)


def test_the_table_is_cached_and_the_same_each_time(gpu: Gpu) -> None:
    first, second = photon_table(gpu, THIN), photon_table(gpu, THIN)
    assert np.array_equal(first.R, second.R) and np.array_equal(first.r, second.r)


def test_thick_layers_with_maps_and_other_materials_have_their_own_profile(gpu: Gpu) -> None:
    thick = (Layer(np.full(3, 0.1), np.full(3, 2.0), 1.4, thickness=4.0), THIN[1])
    assert isinstance(diffusion_profile(gpu, Material("thick", layers=thick, maps=MAPS)), Layers)
    assert isinstance(diffusion_profile(gpu, Material("m", sigma_a=(0.1,) * 3, sigma_s_prime=(1.0,) * 3)), Dipole)


def test_thin_layers_without_maps_are_refused_as_before(gpu: Gpu) -> None:
    with pytest.raises(InputError, match="must be above the mean free path"):
        diffusion_profile(gpu, Material("thin", layers=THIN))
