"""What a mesh that deforms is summed over (wgsss/methods/sam_sum.py): a tree over all of its vertices."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.fit.patch_form_factors import QuickFormFactors
from wgsss.bake.sam.fit.receiver_patches import Patches
from wgsss.bake.sam.fit.select import FAINTEST
from wgsss.bake.sam.sender_map import Entries, empty
from wgsss.bake.sam.sender_tree import senders
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh


def everything(gpu: Gpu, mesh: Mesh, profile: Profile) -> Entries:
    """One entry for each vertex that something shines through to at rest: the mean over all vertices, times how much
    it receives under even light."""
    K = QuickFormFactors(gpu, mesh, profile)
    s = senders(mesh, float(profile.range(0.01).max()))
    V = len(mesh.positions)
    sender, weight = empty(V, 1)

    def add(patches: Patches) -> None:
        for vertices, reached in patches.batches(s, K, 0):
            there = vertices >= 0
            weight[vertices[there], 0] = K(s, vertices, reached).sum(axis=3).transpose(0, 2, 1)[there]

    Patches.of(s, np.arange(V)).each(add, "summing all form factors")
    weight[(weight < FAINTEST * profile.total).all(axis=2)] = 0.0
    sender[weight.any(axis=2)] = len(s.area) - 1
    return Entries(sender, weight, V, tree=s.tree)
