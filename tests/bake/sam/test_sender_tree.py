"""The tree of senders: parents and children."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.sender_tree import sender_tree
from wgsss.scene.shapes import ear


def test_parents_and_children_agree():
    senders = sender_tree(ear(500), 5.0)
    V = len(senders.tree.order)
    nodes = np.arange(V, len(senders.area))
    child, owner = senders.children(nodes)
    np.testing.assert_array_equal(senders.parent[child], nodes[owner])
    assert len(child) == len(np.unique(child)) == len(senders.area) - 1 and senders.parent[-1] == -1
