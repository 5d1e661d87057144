"""Fitted senders against all form factors, under light that they were not chosen by."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.fit import select as fit
from wgsss.bake.sam.fit.select import select_fit
from wgsss.bake.sam.form_factors import form_factors
from wgsss.bake.sam.patch_form_factors import near_pairs
from wgsss.bake.sam.published.top import select_top
from wgsss.scene import MATERIALS
from wgsss.scene.shapes import ear, gyroid, sphere

PROFILE = MATERIALS["marble"].profile


def all_form_factors(gpu, mesh) -> np.ndarray:
    """K (V, V, 3) of the back side."""
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    below = np.einsum("oid,od->oi", x - x[:, None], n) < 0
    pairs = np.argwhere(below & (n @ n.T < 0))
    K = np.zeros((len(x), len(x), 3), np.float32)
    K[tuple(pairs.T)] = form_factors(gpu, mesh, PROFILE, pairs)
    return K


def received(entries, light: np.ndarray, area: np.ndarray) -> np.ndarray:
    """M_back (V, 3) of an irradiance (V,), as frames have it."""
    at = light
    if entries.tree is not None:
        means = entries.tree.sums(light * area) / entries.tree.sums(area)
        at = np.concatenate([light, entries.smoothed_means.apply(means)])
    gathered = np.einsum("vn,vnc->vc", np.where(entries.sender < 0, 0.0, at[entries.sender]), entries.weight)
    return gathered if entries.neighbour_mixture is None else entries.neighbour_mixture.apply(gathered)


@pytest.fixture(scope="module")
def thin(gpu):
    mesh = ear(900)
    return mesh, all_form_factors(gpu, mesh)


@pytest.mark.parametrize(("n", "most"), [(1, 0.3), (3, 0.12), (8, 0.06)])
def test_ear_under_suns_between_those_of_the_choice(gpu, thin, n, most):
    mesh, K = thin
    entries = select_fit(gpu, mesh, PROFILE, n)
    assert entries.sender.shape[1] == n and entries.weight.min() >= 0.0
    rng = np.random.default_rng(7)
    errors = []
    for w in rng.normal(size=(4, 3)):
        light = np.maximum(mesh.normals @ (w / np.linalg.norm(w)), 0.0)
        wanted = np.einsum("oic,i->oc", K, light)
        off = received(entries, light, fan_areas(mesh)) - wanted
        errors.append(np.sqrt(np.square(off).sum() / np.square(wanted).sum()))
    assert np.mean(errors) < most, errors
    top = select_top(gpu, mesh, PROFILE, n)
    assert np.abs(received(top, light, fan_areas(mesh)) - wanted).sum() > 3.0 * np.abs(off).sum()


@pytest.mark.parametrize(("part", "none"), [("SECOND", 10**9), ("REFITS", 0)])
def test_second_rows_and_refitting_lessen_the_error(gpu, thin, monkeypatch, part, none):
    mesh, K = thin
    lights = np.maximum(np.random.default_rng(5).normal(size=(8, 3)) @ mesh.normals.T, 0.0)
    wanted = np.einsum("oic,li->loc", K, lights)

    def error():
        entries = select_fit(gpu, mesh, PROFILE, 3)
        receivers = entries.weight[: len(K)].any(axis=(1, 2)).sum()
        assert len(entries.sender) == len(K) + -(-receivers // fit.SECOND)
        found = [received(entries, light, fan_areas(mesh)) for light in lights]
        return np.square(np.array(found) - wanted).sum()

    whole = error()
    monkeypatch.setattr(fit, part, none)
    assert whole < 0.9 * error()


def test_even_light_gives_all_form_factors(gpu, thin):
    mesh, K = thin
    entries = select_fit(gpu, mesh, PROFILE, 3)
    found = received(entries, np.ones(len(mesh.positions)), fan_areas(mesh))
    wanted = K.sum(axis=1)
    assert np.sqrt(np.square(found - wanted).sum() / np.square(wanted).sum()) < 0.03
    assert found.sum() == pytest.approx(wanted.sum(), rel=0.02)


def test_nothing_from_beyond_the_range(gpu):
    thick = sphere(60.0, 300)
    entries = select_fit(gpu, thick, MATERIALS["skin1"].profile, 3)
    assert np.all(entries.sender == -1) and not entries.weight.any() and len(entries.smoothed_means.node) == 0


def test_same_bits_whoever_was_first(gpu):
    mesh = gyroid(vertices=2000)
    assert len(near_pairs(mesh))
    one, two = (select_fit(gpu, mesh, PROFILE, 3) for _ in range(2))
    np.testing.assert_array_equal(one.sender, two.sender)
    np.testing.assert_array_equal(one.weight, two.weight)


def test_meshes_whose_fans_are_never_near(gpu):
    """Nothing to integrate, and patches that are not full."""
    thick = sphere(8.0, 400)
    assert not len(near_pairs(thick))
    entries = select_fit(gpu, thick, PROFILE, 2)
    K = all_form_factors(gpu, thick).sum(axis=1)
    np.testing.assert_allclose(received(entries, np.ones(len(K)), fan_areas(thick)), K, rtol=0.1)


def test_what_the_tree_misses_is_made_up_for(gpu):
    """Nodes are points at their middles: a ball of a few mean free paths would receive a hundredth too much."""
    mesh, profile = sphere(6.0, 3000), MATERIALS["wholemilk"].profile
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    some = np.arange(0, len(x), 97)
    receiver, sender = np.nonzero((np.einsum("oid,od->oi", x - x[some, None], n[some]) < 0) & (n[some] @ n.T < 0))
    wanted = form_factors(gpu, mesh, profile, np.stack([some[receiver], sender], axis=1)).sum(axis=0)
    found = received(select_fit(gpu, mesh, profile, 3), np.ones(len(x)), fan_areas(mesh))[some].sum(axis=0)
    np.testing.assert_allclose(found, wanted, rtol=0.006)
