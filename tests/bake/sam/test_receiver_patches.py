"""The senders that reach patches from behind, compared with sums over all vertices."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.form_factors import form_factors
from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.receiver_patches import reaching_senders
from wgsss.bake.sam.sender_tree import sender_tree
from wgsss.scene import MATERIALS
from wgsss.scene.shapes import ear, gyroid

PROFILE = MATERIALS["marble"].profile


def behind(mesh, o: int) -> np.ndarray:
    """Return the vertices on the back side of vertex o (Maisch & Ropinski 2017, eq. 13, 14)."""
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    return np.flatnonzero(((x - x[o]) @ n[o] < 0) & (n @ n[o] < 0))


@pytest.mark.parametrize("mesh", [ear(1500), gyroid(vertices=2000)], ids=["ear", "gyroid"])
def test_patch_sums_agree_with_integrated_form_factors(gpu, mesh):
    """Under light from one side, M_back is within 2 % RMS of the sum over all form factors, and within 1 % in total."""
    V = len(mesh.positions)
    senders = sender_tree(mesh, 10.0)
    tree, K = senders.tree, PatchFormFactors(gpu, mesh, PROFILE, senders)
    light = np.maximum(mesh.normals @ np.array([0.6, 0.0, 0.8], np.float32), 0.0)
    irradiance = np.concatenate([light, tree.sums(light * senders.area[:V]) / senders.area[V:]])
    patches = np.arange(tree.levels[1], tree.levels[2])
    patch, sender = reaching_senders(K, V + patches)
    chosen = np.random.default_rng(0).choice(len(patches), 12, replace=False)
    M_back, exact = [], []
    for p in chosen:
        node = patches[p]
        receivers, reaching = tree.order[tree.first[node] :][: tree.count[node]], sender[patch == p]
        M_back += list((K(receivers[None], reaching[None])[0] @ irradiance[reaching]).T)
        for o in receivers:
            i = behind(mesh, o)
            exact.append(light[i] @ form_factors(gpu, mesh, PROFILE, np.stack([np.full(len(i), o), i], axis=1)))
    M_back, exact = np.array(M_back), np.array(exact)
    assert np.sqrt(np.square(M_back - exact).sum() / np.square(exact).sum()) < 0.02
    assert M_back.sum() == pytest.approx(exact.sum(), rel=0.015)


def test_reaching_senders_cover_every_vertex_behind_exactly_once(gpu):
    mesh = ear(600)
    V = len(mesh.positions)
    senders = sender_tree(mesh, 10.0)
    tree, K = senders.tree, PatchFormFactors(gpu, mesh, PROFILE, senders)
    patches = np.arange(tree.levels[1], tree.levels[2])
    patch, sender = reaching_senders(K, V + patches)
    assert np.all(np.diff(patch) >= 0)
    for p in range(0, len(patches), 3):
        times = np.zeros(V, int)
        for node in sender[patch == p]:
            times[[node] if node < V else tree.order[tree.first[node - V] :][: tree.count[node - V]]] += 1
        assert times.max() <= 1
        for o in tree.order[tree.first[patches[p]] :][: tree.count[patches[p]]]:
            back = behind(mesh, o)
            near = back[np.linalg.norm(mesh.positions[back] - mesh.positions[o], axis=1) < K.farthest]
            assert times[near].all()
