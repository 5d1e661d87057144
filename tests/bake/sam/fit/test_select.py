"""The selection `fit`, compared with sums over all form factors, under lights that are not training lights."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.fit import select as fit
from wgsss.bake.sam.fit.select import select_fit
from wgsss.bake.sam.form_factors import form_factors
from wgsss.bake.sam.patch_form_factors import near_pairs
from wgsss.bake.sam.published.top import select_top
from wgsss.bake.sam.sender_map import SenderMap
from wgsss.scene import MATERIALS
from wgsss.scene.shapes import ear, gyroid, sphere

PROFILE = MATERIALS["marble"].profile


def all_form_factors(gpu, mesh) -> np.ndarray:
    """Return the form factors (V, V, 3) of all pairs of vertices; 0 on the front side."""
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    below = np.einsum("oid,od->oi", x - x[:, None], n) < 0
    pairs = np.argwhere(below & (n @ n.T < 0))
    K = np.zeros((len(x), len(x), 3), np.float32)
    K[tuple(pairs.T)] = form_factors(gpu, mesh, PROFILE, pairs)
    return K


def M_back(sender_map: SenderMap, light: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return M_back (V, 3) by a map, for an irradiance (V,), as the method computes it."""
    irradiance = light
    if sender_map.tree is not None:
        means = sender_map.tree.sums(light * area) / sender_map.tree.sums(area)
        irradiance = np.concatenate([light, sender_map.smoothed_means.apply(means)])
    received = np.where(sender_map.sender < 0, 0.0, irradiance[sender_map.sender])
    gathered = np.einsum("vn,vnc->vc", received, sender_map.weight)
    return gathered if sender_map.neighbour_mixture is None else sender_map.neighbour_mixture.apply(gathered)


@pytest.fixture(scope="module")
def thin(gpu):
    mesh = ear(900)
    return mesh, all_form_factors(gpu, mesh)


@pytest.mark.parametrize(("n", "most"), [(1, 0.3), (3, 0.12), (8, 0.06)])
def test_the_error_of_an_ear_is_small_under_suns_that_were_not_trained(gpu, thin, n, most):
    mesh, K = thin
    sender_map = select_fit(gpu, mesh, PROFILE, n)
    assert sender_map.sender.shape[1] == n and sender_map.weight.min() >= 0.0
    rng = np.random.default_rng(7)
    errors = []
    for w in rng.normal(size=(4, 3)):
        light = np.maximum(mesh.normals @ (w / np.linalg.norm(w)), 0.0)
        exact = np.einsum("oic,i->oc", K, light)
        off = M_back(sender_map, light, fan_areas(mesh)) - exact
        errors.append(np.sqrt(np.square(off).sum() / np.square(exact).sum()))
    assert np.mean(errors) < most, errors
    top = select_top(gpu, mesh, PROFILE, n)
    assert np.abs(M_back(top, light, fan_areas(mesh)) - exact).sum() > 3.0 * np.abs(off).sum()


@pytest.mark.parametrize(("constant", "off"), [("RECEIVERS_PER_SECOND_ROW", 10**9), ("REFITS", 0)])
def test_second_rows_and_refits_lessen_the_error(gpu, thin, monkeypatch, constant, off):
    mesh, K = thin
    lights = np.maximum(np.random.default_rng(5).normal(size=(8, 3)) @ mesh.normals.T, 0.0)
    exact = np.einsum("oic,li->loc", K, lights)

    def error():
        sender_map = select_fit(gpu, mesh, PROFILE, 3)
        receivers = sender_map.weight[: len(K)].any(axis=(1, 2)).sum()
        assert len(sender_map.sender) == len(K) + -(-receivers // fit.RECEIVERS_PER_SECOND_ROW)
        received = [M_back(sender_map, light, fan_areas(mesh)) for light in lights]
        return np.square(np.array(received) - exact).sum()

    whole = error()
    monkeypatch.setattr(fit, constant, off)
    assert whole < 0.9 * error()


def test_uniform_light_gives_the_sum_of_all_form_factors(gpu, thin):
    mesh, K = thin
    sender_map = select_fit(gpu, mesh, PROFILE, 3)
    total = M_back(sender_map, np.ones(len(mesh.positions)), fan_areas(mesh))
    exact = K.sum(axis=1)
    assert np.sqrt(np.square(total - exact).sum() / np.square(exact).sum()) < 0.03
    assert total.sum() == pytest.approx(exact.sum(), rel=0.02)


def test_senders_beyond_the_range_of_the_profile_are_ignored(gpu):
    thick = sphere(60.0, 300)
    sender_map = select_fit(gpu, thick, MATERIALS["skin1"].profile, 3)
    assert np.all(sender_map.sender == -1) and not sender_map.weight.any() and len(sender_map.smoothed_means.node) == 0


def test_the_map_does_not_depend_on_the_order_of_threads(gpu):
    mesh = gyroid(vertices=2000)
    assert len(near_pairs(mesh))
    one, two = (select_fit(gpu, mesh, PROFILE, 3) for _ in range(2))
    np.testing.assert_array_equal(one.sender, two.sender)
    np.testing.assert_array_equal(one.weight, two.weight)


def test_a_mesh_without_near_pairs(gpu):
    """No form factor is integrated, and the patches are not full."""
    thick = sphere(8.0, 400)
    assert not len(near_pairs(thick))
    sender_map = select_fit(gpu, thick, PROFILE, 2)
    K = all_form_factors(gpu, thick).sum(axis=1)
    np.testing.assert_allclose(M_back(sender_map, np.ones(len(K)), fan_areas(thick)), K, rtol=0.1)


def test_the_error_of_nodes_is_corrected_in_the_total(gpu):
    """Nodes count as points at their centroids: a small ball would receive one percent too much without correction."""
    mesh, profile = sphere(6.0, 3000), MATERIALS["wholemilk"].profile
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    receivers = np.arange(0, len(x), 97)
    is_below = np.einsum("oid,od->oi", x - x[receivers, None], n[receivers]) < 0
    receiver, sender = np.nonzero(is_below & (n[receivers] @ n.T < 0))
    exact = form_factors(gpu, mesh, profile, np.stack([receivers[receiver], sender], axis=1)).sum(axis=0)
    total = M_back(select_fit(gpu, mesh, profile, 3), np.ones(len(x)), fan_areas(mesh))[receivers].sum(axis=0)
    np.testing.assert_allclose(total, exact, rtol=0.006)
