"""The map of a mesh that deforms: its receivers and weights, compared with sums over all form factors."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.form_factors import form_factors
from wgsss.bake.sam.full_tree import full_tree
from wgsss.bake.sam.sender_map import FAINTEST
from wgsss.scene import MATERIALS, Mesh
from wgsss.scene.shapes import slab

PROFILE = MATERIALS["wholemilk"].profile


def test_the_thin_part_of_a_wedge_receives_and_the_thick_part_does_not(gpu):
    """The limit is FAINTEST, within the error of nodes that are as large as the wedge is thick."""
    block = slab((60, 40, 40), 900)
    thickness = 0.02 + 0.98 * (block.positions[:, :1] + 30.0) / 60.0
    mesh = Mesh(block.positions * np.concatenate([np.ones_like(thickness), thickness, thickness], axis=1), block.faces)
    x, n = mesh.positions.astype(np.float64), mesh.normals
    below = np.einsum("oid,od->oi", x - x[:, None], n) < 0
    receiver, sender = np.nonzero(below & (n @ n.T < 0))
    K = form_factors(gpu, mesh, PROFILE, np.stack([receiver, sender], axis=1))
    total = np.stack([np.bincount(receiver, K[:, c], len(x)) for c in range(3)], axis=1)

    sender_map = full_tree(gpu, mesh, PROFILE)
    share = (total / PROFILE.total).max(axis=1)
    receives = (sender_map.sender >= 0).all(axis=1)
    assert receives[share > 1.2 * FAINTEST].all() and not receives[share < 0.8 * FAINTEST].any()
    assert 0.1 < receives.mean() < 0.9
    assert np.all(sender_map.sender[receives] == len(x) + len(sender_map.tree.first) - 1), "the root is the sender"
    error = sender_map.weight[:, 0] - total
    assert np.sqrt(np.square(error).sum() / np.square(total).sum()) < 0.06
