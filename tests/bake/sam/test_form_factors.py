"""Form factors between fans, compared with Monte Carlo integration and closed forms, for near and distant pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wgsss.bake.sam import form_factors as module
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.form_factors import FormFactors, form_factors
from wgsss.gpu import Gpu
from wgsss.optics import Profile, SumOfGaussians
from wgsss.scene import Mesh, material
from wgsss.scene.shapes import ear, slab

# Cells 1 mm wide on both sides of a plate 0.5 mm thick.
PLATES = slab(size=(10.0, 10.0, 0.5), vertices=300)


def monte_carlo(mesh: Mesh, profile: Profile, o: int, i: int, count: int = 100_000) -> tuple[np.ndarray, np.ndarray]:
    """Estimate K_oi from random points of both fans; return it and its standard error."""
    random = np.random.default_rng(o + 1000 * i)

    def points(v: int) -> np.ndarray:
        faces = np.flatnonzero((mesh.faces == v).any(axis=1))
        size = np.linalg.norm(mesh.face_normals[faces], axis=1)
        face = random.choice(faces, count, p=size / size.sum())
        share = -np.sort(-random.dirichlet((1, 1, 1), count), axis=1)  # the largest coordinate first
        corner = np.argmax(mesh.faces[face] == v, axis=1)
        other = np.where(random.random(count) < 0.5, 1, 2)  # and the others either way round
        turned = np.stack([corner, (corner + other) % 3, (corner + 3 - other) % 3], axis=1)
        return np.einsum("nk,nkd->nd", share, mesh.positions[mesh.faces[face[:, None], turned]].astype(np.float64))

    R = profile.reflectance(np.linalg.norm(points(o) - points(i), axis=1))
    area = fan_areas(mesh)[i]
    return area * R.mean(axis=0), area * R.std(axis=0) / math.sqrt(count)


def opposite(mesh: Mesh, count: int, rank: int = 0) -> np.ndarray:
    """Return pairs (count, 2) of a vertex and one on its back side: the nearest for rank 0, the next for 1, ..."""
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    o = np.random.default_rng(3).choice(len(x), count, replace=False)
    away = x - x[o, None]
    back = (np.einsum("oid,od->oi", away, n[o]) < 0) & (n[o] @ n.T < 0)
    distance = np.where(back, np.linalg.norm(away, axis=2), np.inf)
    return np.stack([o, np.argsort(distance, axis=1)[:, rank]], axis=1)


@pytest.mark.parametrize("name", ["skin1", "marble"])
@pytest.mark.parametrize(("mesh", "rank"), [(PLATES, 0), (PLATES, 5), (ear(1000), 0), (ear(1000), 30)])
def test_form_factors_are_within_a_percent_of_monte_carlo(gpu: Gpu, mesh: Mesh, rank: int, name: str) -> None:
    profile, pairs = material(name).profile, opposite(mesh, 4, rank)
    for K, (o, i) in zip(form_factors(gpu, mesh, profile, pairs), pairs, strict=True):
        mean, error = monte_carlo(mesh, profile, int(o), int(i))
        lit = mean > 0.01 * mean.max()
        assert (np.abs(K - mean)[lit] < 0.01 * mean[lit] + 4.0 * error[lit]).all()


def test_near_form_factors_differ_from_area_times_reflectance(gpu: Gpu) -> None:
    """The ratio K' (Maisch & Ropinski 2017, eq. 15): R_d varies over fans that are as wide as they are far apart."""
    pairs = np.concatenate([opposite(PLATES, 60, rank) for rank in range(12)])
    pairs = pairs[(np.abs(PLATES.positions[pairs, :2]) < 4.0).all(axis=(1, 2))]  # away from the rim
    profile = material("skin1").profile
    distance = np.linalg.norm(PLATES.positions[pairs[:, 0]] - PLATES.positions[pairs[:, 1]], axis=1)
    flat = fan_areas(PLATES)[pairs[:, 1], None] * profile.reflectance(distance)
    ratio = form_factors(gpu, PLATES, profile, pairs) / flat
    assert 0.55 < ratio.min() < 0.65 and 1.2 < ratio.max() < 2.2


def test_form_factors_of_a_whole_plate_sum_to_the_integral_of_a_gaussian(gpu: Gpu) -> None:
    profile = SumOfGaussians(np.array([0.2, 1.0]), np.array([[0.1, 0.2, 0.3], [0.4, 0.3, 0.2]]))
    x = PLATES.positions
    middle = int(np.argmin(np.abs(x[:, :2]).sum(axis=1) + (x[:, 2] < 0)))
    below = np.flatnonzero(np.isclose(x[:, 2], x[:, 2].min()))
    total = form_factors(gpu, PLATES, profile, np.stack([np.full(len(below), middle), below], axis=1)).sum(axis=0)
    through = profile.weights * np.exp(-(0.5**2) / (2.0 * profile.variances))[:, None]
    np.testing.assert_allclose(total, through.sum(axis=0), rtol=2e-3)


def test_form_factors_times_areas_are_symmetric(gpu: Gpu) -> None:
    mesh, pairs = ear(1000), opposite(ear(1000), 50)
    there, back = (
        form_factors(gpu, mesh, material("marble").profile, p).astype(np.float64) for p in (pairs, pairs[:, ::-1])
    )
    area = fan_areas(mesh)
    np.testing.assert_allclose(there * area[pairs[:, :1]], back * area[pairs[:, 1:]], rtol=1e-4)


def test_distant_form_factors_are_nearly_area_times_reflectance(gpu: Gpu) -> None:
    """Pairs of order 0: K differs from A_i R_d at the distance of the centroids by no more than the error limit."""
    mesh, profile = ear(4000), material("marble").profile
    factors = FormFactors(gpu, mesh, profile)
    random = np.random.default_rng(0)
    pairs = random.integers(0, len(mesh.positions), (20_000, 2))
    far = pairs[factors._orders(pairs) == 0][:300]
    assert len(far) == 300
    distance = np.linalg.norm(factors.fans.centre[far[:, 0]] - factors.fans.centre[far[:, 1]], axis=1)
    flat = fan_areas(mesh)[far[:, 1], None] * profile.reflectance(distance)
    K, finest = factors.of(far), factors._integrate(far, 4)
    np.testing.assert_allclose(K.sum(axis=1), flat.sum(axis=1), rtol=2.0 * module._FLAT_LIMITS[0])
    np.testing.assert_allclose(K.sum(axis=1), finest.sum(axis=1), rtol=0.005)


def test_the_extents_of_points_correct_their_distance(gpu: Gpu) -> None:
    """For fans straight opposite each other, R_d at the root mean square distance is right to second order."""
    mesh, profile = slab(size=(20.0, 20.0, 4.0), vertices=1200), material("marble").profile
    pairs = opposite(mesh, 60)
    straight = (np.abs(mesh.positions[pairs[:, 0]] - mesh.positions[pairs[:, 1]])[:, :2] < 1e-3).all(axis=1)
    inner = (np.abs(mesh.positions[pairs[:, 0], :2]) < 9.0).all(axis=1)
    pairs = pairs[straight & inner]
    factors = FormFactors(gpu, mesh, profile)
    distance = np.linalg.norm(mesh.positions[pairs[:, 0]] - mesh.positions[pairs[:, 1]], axis=1)
    flat = (fan_areas(mesh)[pairs[:, 1], None] * profile.reflectance(distance)).sum(axis=1)
    one, many = (factors._integrate(pairs, order).sum(axis=1) for order in (0, 3))
    assert len(pairs) > 10 and (flat / many > 1.02).all()
    np.testing.assert_allclose(one, many, rtol=0.003)


def test_large_fans_with_a_short_range_profile_get_points_of_high_order(gpu: Gpu) -> None:
    mesh, profile = slab(size=(40.0, 40.0, 1.0), vertices=100), material("skin1").profile
    pairs = opposite(mesh, 4)
    factors = FormFactors(gpu, mesh, profile)
    assert factors._orders(pairs).min() >= 4
    for K, (o, i) in zip(factors.of(pairs), pairs, strict=True):
        mean, error = monte_carlo(mesh, profile, int(o), int(i), 300_000)
        assert (np.abs(K - mean) < 0.01 * mean + 4.0 * error).all()


def test_fans_with_many_points_are_summed_in_parts(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    profile, pairs = material("skin1").profile, opposite(PLATES, 10)
    whole = form_factors(gpu, PLATES, profile, pairs)
    monkeypatch.setattr(module, "_MAX_TURNS", 300)
    np.testing.assert_allclose(form_factors(gpu, PLATES, profile, pairs), whole, rtol=1e-5)


def test_form_factors_of_vertices_without_faces_are_zero_and_no_pairs_give_none(gpu: Gpu) -> None:
    mesh = Mesh(np.concatenate([PLATES.positions, [[0, 0, 5]]]), PLATES.faces)
    profile, lone = material("skin1").profile, len(PLATES.positions)
    K = form_factors(gpu, mesh, profile, np.array([[lone, 0], [0, lone], [0, 1]]))
    assert (K[:2] == 0).all() and (K[2] > 0).all()
    assert form_factors(gpu, mesh, profile, np.zeros((0, 2), int)).shape == (0, 3)
