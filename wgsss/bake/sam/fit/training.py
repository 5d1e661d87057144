"""Irradiance that a mesh may meet: what the choice of its senders is tried on."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake import rays
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

SUNS = 160
"""directions of light, with shadows"""
SKIES = 24
"""half skies, without shadows: what suns never reach is lit by something too"""
SKY_WEIGHT, EVEN_WEIGHT = 1.0, 3.5
"""of a sky's error and of that under even light, which sets how much light there is in all, over a sun's"""
COMPONENTS = 128
"""numbers that irradiances are compressed to"""
_AT_ONCE = 1 << 16  # vertices
_LIFT = 1e-4  # of the mesh's extent: how far above the surface rays start


def training(mesh: Mesh) -> Array:
    """float32 (SUNS + SKIES + 1, V): irradiances at the vertices, each times the weight of its error."""
    n = mesh.normals.astype(np.float64)
    x = mesh.positions + _LIFT * float(np.ptp(mesh.bounds, axis=0).max()) * n
    caster = rays.Caster(mesh.positions, mesh.faces)
    found = np.zeros((SUNS + SKIES + 1, len(n)), np.float32)
    for light, w in zip(found, spiral(SUNS), strict=False):
        cosine = n @ w
        lit = np.flatnonzero(cosine > 0.0)
        free = ~caster.blocked(x[lit], np.broadcast_to(w, (len(lit), 3)))
        light[lit] = cosine[lit] * free
    found[SUNS:-1] = SKY_WEIGHT * 0.5 * (1.0 + spiral(SKIES) @ n.T)
    found[-1] = EVEN_WEIGHT
    return found


def compressed(lights: Array, area: Array) -> Array:
    """float32 (V, COMPONENTS): irradiances (T, V) over vertices of `area` (V,) in the directions, of all mixtures of
    lights, in which they differ most. Products between what is linear in them are nearly as before, and cost less."""
    gram = np.zeros((len(lights), len(lights)))
    for first in range(0, len(area), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        gram += (lights[:, some] * area[some]) @ lights[:, some].T
    _, directions = np.linalg.eigh(gram)
    basis = directions[:, ::-1][:, :COMPONENTS].astype(np.float32)
    return lights.T @ basis


def spiral(count: int) -> Array:
    """Unit vectors (count, 3), spread evenly over the sphere."""
    i = np.arange(count) + 0.5
    y, around = 1.0 - 2.0 * i / count, np.pi * (3.0 - np.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - y * y)
    return np.stack([ring * np.sin(around), y, ring * np.cos(around)], axis=1)
