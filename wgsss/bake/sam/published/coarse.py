"""Back sides from a simplified mesh, as in the paper's appendix (000 §5.2): fewer senders, each with a larger fan."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.published.top import largest_form_factors
from wgsss.bake.sam.sender_map import SenderMap
from wgsss.bake.samples import Samples
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

LEFT = 0.26
"""over the root of n: share of the light that leaves a plane outside the disc that n senders cover, 0.15 for 3. With
twice as much they miss much of what arrives, with a third they are too few to tell how light changes over the disc"""
_ROUGHNESS = 0.01  # of the spacing. Where a mesh is flat, simplifying it would leave few vertices, and those anywhere
_FEWEST = 100  # faces of a simplified mesh
_NEAR = 16  # vertices of the mesh that are looked at for one that lies where a sender does


def select_coarse(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
    """The n vertices of largest K_oi on the back side among those of a simplified mesh, whose fans cover as much.

    They receive light where the mesh has a vertex next to them that faces the same way. The areas of their fans are
    scaled so that they sum to the mesh's.
    """
    simple = simplified(mesh, profile, n)
    V = len(mesh.positions)
    faces = np.concatenate([mesh.faces, simple.faces + V])
    both = Mesh(np.concatenate([mesh.positions, simple.positions]), faces, name=mesh.name)
    sender, K = largest_form_factors(gpu, both, profile, n, sending=np.arange(len(both.positions)) >= V)
    found = sender[:V]
    scale = np.float32(mesh.area / simple.area)
    return SenderMap(
        np.where(found >= 0, found - V, -1).astype(np.int32), K[:V] * scale, len(simple.positions), _on(mesh, simple)
    )


def spacing(profile: Profile, n: int) -> float:
    """How far apart senders are, in mm, so that n of them cover the disc within which all light leaves but LEFT."""
    return float(profile.range(LEFT / np.sqrt(n)).max()) * float(np.sqrt(np.pi / n))


def simplified(mesh: Mesh, profile: Profile, n: int) -> Mesh:
    """The mesh with vertices about `spacing` apart; as it is where they are not nearer already."""
    vertices = mesh.area / spacing(profile, n) ** 2
    faces = max(int(2.0 * vertices), _FEWEST)
    if faces >= len(mesh.faces):
        return mesh
    from fast_simplification import simplify

    off = _ROUGHNESS * spacing(profile, n) * np.random.default_rng(0).uniform(-1.0, 1.0, (len(mesh.positions), 1))
    rough = (mesh.positions + off * mesh.normals).astype(np.float32)
    positions, kept = simplify(rough, mesh.faces.copy(), target_count=faces)
    used, kept = np.unique(kept, return_inverse=True)
    return Mesh(positions[used], kept.reshape(-1, 3), name=mesh.name)


def _on(mesh: Mesh, simple: Mesh) -> Samples:
    """For each vertex of the simplified mesh, one of the mesh that is near and faces the same way."""
    from scipy.spatial import KDTree

    used, first = np.unique(mesh.faces, return_index=True)
    near = min(_NEAR, len(used))
    distance, index = KDTree(mesh.positions[used]).query(simple.positions, k=[*range(1, near + 1)])
    turned = 1.0 - np.einsum("sk,sjk->sj", simple.normals, mesh.normals[used[index]])
    apart = np.sqrt(simple.area / len(simple.positions))
    chosen = np.argmin(np.square(distance) + np.square(apart) * turned, axis=1)
    corner = first[index[np.arange(len(index)), chosen]]
    return Samples((corner // 3).astype(np.int32), np.eye(3)[corner % 3], np.zeros(len(corner)))
