"""Who receives anything, against all form factors."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.fit.select import FAINTEST
from wgsss.bake.sam.form_factors import form_factors
from wgsss.bake.sam.full_tree import full_tree
from wgsss.scene import MATERIALS, Mesh
from wgsss.scene.shapes import slab

PROFILE = MATERIALS["wholemilk"].profile


def test_a_wedge_is_received_through_where_it_is_thin(gpu):
    """As nearly as nodes tell that are as large as it is thick."""
    block = slab((60, 40, 40), 900)
    thickness = 0.02 + 0.98 * (block.positions[:, :1] + 30.0) / 60.0
    mesh = Mesh(block.positions * np.concatenate([np.ones_like(thickness), thickness, thickness], axis=1), block.faces)
    x, n = mesh.positions.astype(np.float64), mesh.normals
    below = np.einsum("oid,od->oi", x - x[:, None], n) < 0
    receiver, sender = np.nonzero(below & (n @ n.T < 0))
    K = form_factors(gpu, mesh, PROFILE, np.stack([receiver, sender], axis=1))
    total = np.stack([np.bincount(receiver, K[:, c], len(x)) for c in range(3)], axis=1)

    found = full_tree(gpu, mesh, PROFILE)
    share = (total / PROFILE.total).max(axis=1)
    received = (found.sender >= 0).all(axis=1)
    assert received[share > 1.2 * FAINTEST].all() and not received[share < 0.8 * FAINTEST].any()
    assert 0.1 < received.mean() < 0.9
    assert np.all(found.sender[received] == len(x) + len(found.tree.first) - 1), "the root"
    error = found.weight[:, 0] - total
    assert np.sqrt(np.square(error).sum() / np.square(total).sum()) < 0.06
