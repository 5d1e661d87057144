"""What reaches vertices from behind, against sums over all vertices."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.form_factors import form_factors
from wgsss.bake.sam.patch_form_factors import PatchFormFactors, near_pairs
from wgsss.bake.sam.receiver_patches import reaching_senders
from wgsss.bake.sam.sender_tree import sender_tree
from wgsss.scene import MATERIALS
from wgsss.scene.shapes import ear, gyroid, slab

PROFILE = MATERIALS["marble"].profile


def behind(mesh, o: int) -> np.ndarray:
    """The vertices on the back side of one (000 eq. 13, 14)."""
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    return np.flatnonzero(((x - x[o]) @ n[o] < 0) & (n @ n[o] < 0))


@pytest.mark.parametrize("mesh", [ear(1500), gyroid(vertices=2000)], ids=["ear", "gyroid"])
def test_they_sum_to_the_form_factors_of_all(gpu, mesh):
    """Under light from one side, within 2 % RMS of fans integrated one by one, and 1 % in all."""
    V = len(mesh.positions)
    s, K = sender_tree(mesh, 10.0), PatchFormFactors(gpu, mesh, PROFILE)
    light = np.maximum(mesh.normals @ np.array([0.6, 0.0, 0.8], np.float32), 0.0)
    means = np.concatenate([light, s.tree.sums(light * s.area[:V]) / s.area[V:]])
    patches = np.arange(s.tree.levels[1], s.tree.levels[2])
    patch, node = reaching_senders(s, K, V + patches)
    some = np.random.default_rng(0).choice(len(patches), 12, replace=False)
    found, wanted = [], []
    for p in some:
        q = patches[p]
        vertices, reached = s.tree.order[s.tree.first[q] :][: s.tree.count[q]], node[patch == p]
        found += list((K(s, vertices[None], reached[None])[0] @ means[reached]).T)
        for o in vertices:
            i = behind(mesh, o)
            wanted.append(light[i] @ form_factors(gpu, mesh, PROFILE, np.stack([np.full(len(i), o), i], axis=1)))
    found, wanted = np.array(found), np.array(wanted)
    assert np.sqrt(np.square(found - wanted).sum() / np.square(wanted).sum()) < 0.02
    assert found.sum() == pytest.approx(wanted.sum(), rel=0.015)


def test_no_vertex_counts_twice_and_none_behind_is_missed(gpu):
    mesh = ear(600)
    V = len(mesh.positions)
    s, K = sender_tree(mesh, 10.0), PatchFormFactors(gpu, mesh, PROFILE)
    patches = np.arange(s.tree.levels[1], s.tree.levels[2])
    patch, node = reaching_senders(s, K, V + patches)
    assert np.all(np.diff(patch) >= 0)
    for p in range(0, len(patches), 3):
        times = np.zeros(V, int)
        for sender in node[patch == p]:
            under = [sender] if sender < V else s.tree.order[s.tree.first[sender - V] :][: s.tree.count[sender - V]]
            times[under] += 1
        assert times.max() <= 1
        for o in s.tree.order[s.tree.first[patches[p]] :][: s.tree.count[patches[p]]]:
            back = behind(mesh, o)
            near = back[np.linalg.norm(mesh.positions[back] - mesh.positions[o], axis=1) < K.farthest]
            assert times[near].all()


def test_near_pairs_by_brute_force():
    mesh = slab((6, 6, 0.4), 300)
    x, n, area = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64), fan_areas(mesh)
    apart = np.linalg.norm(x[:, None] - x, axis=2)
    near = apart <= 4.0 * np.sqrt(np.maximum(area[:, None], area))
    below = np.einsum("oid,od->oi", x - x[:, None], n) < 0
    wanted = np.argwhere(near & below & (n @ n.T < 0))
    np.testing.assert_array_equal(near_pairs(mesh), wanted)


def test_parents_and_children_agree():
    s = sender_tree(ear(500), 5.0)
    V = len(s.tree.order)
    nodes = np.arange(V, len(s.area))
    child, owner = s.children(nodes)
    np.testing.assert_array_equal(s.parent[child], nodes[owner])
    assert len(child) == len(np.unique(child)) == len(s.area) - 1 and s.parent[-1] == -1
