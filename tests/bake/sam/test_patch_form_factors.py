"""The list of near pairs, compared with a brute-force search."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.patch_form_factors import near_pairs
from wgsss.scene.shapes import slab


def test_near_pairs_are_those_of_a_brute_force_search():
    mesh = slab((6, 6, 0.4), 300)
    x, n, area = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64), fan_areas(mesh)
    distance = np.linalg.norm(x[:, None] - x, axis=2)
    is_near = distance <= 4.0 * np.sqrt(np.maximum(area[:, None], area))
    is_below = np.einsum("oid,od->oi", x - x[:, None], n) < 0
    expected = np.argwhere(is_near & is_below & (n @ n.T < 0))
    np.testing.assert_array_equal(near_pairs(mesh), expected)
