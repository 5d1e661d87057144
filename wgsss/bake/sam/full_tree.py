"""The map of a mesh that deforms: a tree over all its vertices instead of a few chosen senders.

While a mesh deforms, the method sums over this tree in every frame (wgsss/methods/sam/barnes_hut.py). What remains to
be baked is the tree itself and which vertices receive light from behind.
"""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.patch_form_factors import PatchFormFactors
from wgsss.bake.sam.receiver_patches import ReceiverPatches
from wgsss.bake.sam.sender_map import SenderMap, clear_faint_rows, empty_entries
from wgsss.bake.sam.sender_tree import sender_tree, side_separation
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh


def full_tree(gpu: Gpu, mesh: Mesh, profile: Profile) -> SenderMap:
    """Build the map that has the tree over all vertices of a mesh, and one entry for each receiver.

    The sender of the entry is the root, the mean over the whole mesh; its weight is the sum of the receiver's form
    factors at rest (Maisch & Ropinski 2017, eq. 10), which is M_back under uniform light. Vertices that receive next to
    nothing (FAINTEST) have no entry.
    """
    senders = sender_tree(mesh, side_separation(profile))
    K = PatchFormFactors(gpu, mesh, profile, senders)
    V = len(mesh.positions)
    sender, weight = empty_entries(V, 1)

    def add_form_factors(patches: ReceiverPatches) -> None:
        for receivers, reaching in patches.batches(K, 0):
            is_receiver = receivers >= 0
            weight[receivers[is_receiver], 0] = K(receivers, reaching).sum(axis=3).transpose(0, 2, 1)[is_receiver]

    ReceiverPatches.of(senders, np.arange(V)).each(add_form_factors, "summing form factors")
    clear_faint_rows(weight, profile)
    sender[weight.any(axis=2)] = len(senders.area) - 1
    return SenderMap(sender, weight, V, tree=senders.tree)
