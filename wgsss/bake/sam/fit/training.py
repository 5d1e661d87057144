"""The training lights: irradiance distributions over a mesh on which senders are fitted.

They are suns from many directions with shadows, half skies without shadows, and uniform light. Senders that reproduce
M_back under all of these also do so under most other lights, which are nearly mixtures of these.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake import rays
from wgsss.scene.geometry import fibonacci_sphere
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

SUNS = 160
"""number of directional lights, with shadows"""
SKIES = 24
"""number of half skies, without shadows, so that places that no sun reaches are lit, too"""
SKY_WEIGHT, UNIFORM_WEIGHT = 1.0, 3.5
"""weights of the errors under a sky and under uniform light, relative to a sun; uniform light sets the total energy"""
COMPONENTS = 128
"""number of components that the lights are compressed to"""
_AT_ONCE = 1 << 16  # vertices
_LIFT = 1e-4  # height above the surface where shadow rays start, as a share of the mesh's extent


def training_lights(mesh: Mesh) -> Array:
    """Return the irradiance of each training light at the vertices, float32 (SUNS + SKIES + 1, V), without unit.

    A light that falls perpendicularly has an irradiance of 1. Each light is multiplied by the weight of its error.
    """
    n = mesh.normals.astype(np.float64)
    x = mesh.positions + _LIFT * float(np.ptp(mesh.bounds, axis=0).max()) * n
    caster = rays.Caster(mesh.positions, mesh.faces)
    lights = np.zeros((SUNS + SKIES + 1, len(n)), np.float32)
    for light, w in zip(lights, fibonacci_sphere(SUNS), strict=False):
        cosine = n @ w
        lit = np.flatnonzero(cosine > 0.0)
        is_visible = ~caster.blocked(x[lit], np.broadcast_to(w, (len(lit), 3)))
        light[lit] = cosine[lit] * is_visible
    lights[SUNS:-1] = SKY_WEIGHT * 0.5 * (1.0 + fibonacci_sphere(SKIES) @ n.T)
    lights[-1] = UNIFORM_WEIGHT
    return lights


def compressed(lights: Array, area: Array) -> Array:
    """Return the principal components of irradiances, float32 (V, COMPONENTS).

    Dot products over the components approximate dot products over all lights, for anything that is linear in the
    irradiance, and cost less.

    Args:
        lights: float32 (T, V), the irradiance of T lights at the vertices.
        area: (V,), the weights of the vertices in the principal component analysis.
    """
    gram = np.zeros((len(lights), len(lights)))
    for first in range(0, len(area), _AT_ONCE):
        chunk = slice(first, first + _AT_ONCE)
        gram += (lights[:, chunk] * area[chunk]) @ lights[:, chunk].T
    _, directions = np.linalg.eigh(gram)
    basis = directions[:, ::-1][:, :COMPONENTS].astype(np.float32)
    return lights.T @ basis
