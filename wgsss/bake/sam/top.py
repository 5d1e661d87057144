"""The vertices that contribute most to each vertex from its back side, as published (000 §3.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.entries import Entries, empty
from wgsss.bake.sam.fans import fan_areas
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

BEYOND = 1e-3
"""share of the light of a plane that comes from farther away than what is looked at"""
_BLOCK = 256


def select_top(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> Entries:
    """The n vertices of largest K_oi (000 eq. 11), all channels together, on each vertex' back side (eq. 13, 14)."""
    x, N, area = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64), fan_areas(mesh)
    sender, weight = empty(len(x), n)
    reach = float(profile.range(BEYOND).max())
    for first in range(0, len(x), _BLOCK):
        o = np.arange(first, min(first + _BLOCK, len(x)))
        away = x[None] - x[o][:, None]
        r = np.linalg.norm(away, axis=2)
        back = (np.einsum("oid,od->oi", away, N[o]) < 0) & (N[o] @ N.T < 0) & (r < reach)
        K = np.where(back[..., None], profile.reflectance(r) * area[:, None], 0.0) * (area[o] > 0)[:, None, None]
        total = K.sum(axis=2)
        best = np.argsort(-total, axis=1, kind="stable")[:, :n]
        found = np.take_along_axis(total, best, axis=1) > 0
        sender[o, : best.shape[1]] = np.where(found, best, -1)
        weight[o, : best.shape[1]] = np.where(found[..., None], np.take_along_axis(K, best[..., None], axis=1), 0.0)
    return Entries(sender, weight, len(x))
