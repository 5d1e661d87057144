"""The selection `coarse`: senders are the vertices of a simplified mesh, each with a larger fan.

On a fine mesh, the few vertices of largest form factor cover only a small part of the surface that light comes from,
and M_back is far too small. The paper's appendix therefore chooses the senders on a mesh of lower tessellation
(Maisch & Ropinski 2017, section 5.2). Here the mesh is simplified until n senders cover that part.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.published.top import largest_form_factors
from wgsss.bake.sam.sender_map import SenderMap
from wgsss.bake.samples import Samples, vertex_samples
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

UNCOVERED = 0.26
"""share of the light that leaves a plane outside the disc that n senders cover, times the square root of n: 0.15 for 3.
With twice this share, the senders miss much of the light; with a third of it, they are too far apart to resolve how the
irradiance varies over the disc"""
_ROUGHNESS = 0.01  # of the spacing. Without it, flat regions would keep few vertices, irregularly placed
_MIN_FACES = 100  # of a simplified mesh
_NEAR = 16  # vertices of the mesh among which the one for a sender is chosen


def select_coarse(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
    """Choose, for each vertex, the n vertices of a simplified mesh that have the largest form factors (eq. 11).

    A sender's irradiance is evaluated at a vertex of the full mesh next to it that faces the same way. The form factors
    are scaled by the ratio of the two meshes' areas, since simplification changes the area.
    """
    simple = simplified(mesh, profile, n)
    V = len(mesh.positions)
    faces = np.concatenate([mesh.faces, simple.faces + V])
    both = Mesh(np.concatenate([mesh.positions, simple.positions]), faces, name=mesh.name)
    sender, K = largest_form_factors(gpu, both, profile, n, sending=np.arange(len(both.positions)) >= V)
    sender, K = sender[:V], K[:V] * np.float32(mesh.area / simple.area)
    sender = np.where(sender >= 0, sender - V, -1).astype(np.int32)
    return SenderMap(sender, K, len(simple.positions), _sender_samples(mesh, simple))


def spacing(profile: Profile, n: int) -> float:
    """Return the distance between senders, mm, at which n of them cover the disc that most of the light leaves from.

    Outside the disc leaves the share UNCOVERED / sqrt(n) of the light.
    """
    return float(profile.range(UNCOVERED / np.sqrt(n)).max()) * float(np.sqrt(np.pi / n))


def simplified(mesh: Mesh, profile: Profile, n: int) -> Mesh:
    """Return the mesh simplified to vertices about `spacing` apart; the mesh itself if it is as coarse already."""
    vertices = mesh.area / spacing(profile, n) ** 2
    faces = max(int(2.0 * vertices), _MIN_FACES)
    if faces >= len(mesh.faces):
        return mesh
    from fast_simplification import simplify

    offset = _ROUGHNESS * spacing(profile, n) * np.random.default_rng(0).uniform(-1.0, 1.0, (len(mesh.positions), 1))
    rough = (mesh.positions + offset * mesh.normals).astype(np.float32)
    positions, triangles = simplify(rough, mesh.faces.copy(), target_count=faces)
    used, triangles = np.unique(triangles, return_inverse=True)
    return Mesh(positions[used], triangles.reshape(-1, 3), name=mesh.name)


def _sender_samples(mesh: Mesh, simple: Mesh) -> Samples:
    """Return, for each vertex of the simplified mesh, a vertex of the mesh that is near and faces the same way."""
    from scipy.spatial import KDTree

    used = np.unique(mesh.faces)
    near = min(_NEAR, len(used))
    distance, index = KDTree(mesh.positions[used]).query(simple.positions, k=[*range(1, near + 1)])
    turned = 1.0 - np.einsum("sk,sjk->sj", simple.normals, mesh.normals[used[index]])
    width = np.sqrt(simple.area / len(simple.positions))
    chosen = np.argmin(np.square(distance) + np.square(width) * turned, axis=1)
    return vertex_samples(mesh, used[index[np.arange(len(index)), chosen]])
