"""What a mesh that deforms is summed over (wgsss/methods/sam_sum.py): a tree over all of its vertices."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.fit.select import FAINTEST
from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.receiver_patches import ReceiverPatches
from wgsss.bake.sam.sender_map import SenderMap, empty_entries
from wgsss.bake.sam.sender_tree import sender_tree
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh


def full_tree(gpu: Gpu, mesh: Mesh, profile: Profile) -> SenderMap:
    """One entry for each vertex that something shines through to at rest: the mean over all vertices, times how much
    it receives under even light."""
    K = PatchFormFactors(gpu, mesh, profile)
    s = sender_tree(mesh, float(profile.range(0.01).max()))
    V = len(mesh.positions)
    sender, weight = empty_entries(V, 1)

    def add(patches: ReceiverPatches) -> None:
        for vertices, reached in patches.batches(s, K, 0):
            there = vertices >= 0
            weight[vertices[there], 0] = K(s, vertices, reached).sum(axis=3).transpose(0, 2, 1)[there]

    ReceiverPatches.of(s, np.arange(V)).each(add, "summing all form factors")
    weight[(weight < FAINTEST * profile.total).all(axis=2)] = 0.0
    sender[weight.any(axis=2)] = len(s.area) - 1
    return SenderMap(sender, weight, V, tree=s.tree)
