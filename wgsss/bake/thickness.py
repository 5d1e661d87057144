"""Local thickness: the share of even light on the back of an object that leaves at each vertex.

As in Barré-Brisebois & Bouchard 2011, it is ambient occlusion computed with inverted normals. Unlike there, the weight
of a distance follows from the material. White means thin.

The result is a share and no length. At a vertex on a plate it is the share that passes through the plate. Elsewhere,
compare it with a plate whose chords have the same mean length as those at the vertex: the plate with the same share has
chords that are longer by a median factor of 1.3 on the built-in ear and of 1.8 on the Stanford bunny (rank correlations
0.84 and 0.86), since short chords along the surface are not counted.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake import rays
from wgsss.cache import cached
from wgsss.optics import Profile
from wgsss.optics.lookup import geometric
from wgsss.scene.geometry import GOLDEN_ANGLE, cosine_directions
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

RAYS = 128
"""The number of rays into the object from each vertex."""
BEYOND = 1e-3
"""The share of the light that leaves beyond the largest distance that counts."""
_ENTRIES = 512  # of the table of falloffs
_NEAREST = 1e-4  # the first distance of the table over the largest one
_LIFT = 1e-5  # of the extent of the mesh: the depth below the surface at which rays start
_BLOCK = 4096  # vertices whose rays are cast together
_SMOOTHINGS = 2  # with one, ridges that are one triangle wide would look like zigzags


def local_thickness(mesh: Mesh, profile: Profile) -> Array:
    """Return the local thickness at the vertices of a mesh: float32 (V, 3), 0 (no light passes) to 1 (infinitely thin).

    It is the mean of `falloff` over rays into the object, with a cosine density. For a plate of h mm it is the share of
    the profile beyond h, like the diffusion integral there (Maisch & Ropinski 2017, eq. 7).

    Rays count if they end where the surface faces away from the vertex. Points that they meet elsewhere belong to
    M_front (eq. 13). Rays that meet nothing, as behind a sheet or through a hole, have no far side and count as 0.
    Variations finer than the triangles are smoothed away. Cached.
    """
    distances, falls = falloff_table(profile)

    def make() -> dict[str, Array]:
        caster = rays.Caster(mesh.positions, mesh.faces)
        shares = np.zeros((len(mesh.positions), 3), np.float32)
        for first in range(0, len(shares), _BLOCK):
            block = np.arange(first, min(first + _BLOCK, len(shares)))
            lengths = far_side(caster, mesh, block)
            for channel in range(3):
                weights = np.interp(lengths, distances, falls[:, channel], right=0.0)
                shares[block, channel] = weights.mean(axis=1)
        return {"thickness": smoothed(mesh, shares)}

    label = f"measuring the thickness at {len(mesh.positions)} vertices"
    return cached("thickness", [mesh, profile], make, label=label)["thickness"]


def falloff(profile: Profile, d: Array) -> Array:
    """Return the weight of a ray of length `d` (...) mm: (..., 3), 1 to 0; 0 in a black channel.

    Let eps(d) be the share of the profile beyond d (Mikkelsen 2009, eq. 40). The rays through a plate of h mm, which
    are h / cos long, must have the mean weight eps(h). The solution of this integral equation is eps - d/2 d eps/dd. It
    falls with d if the profile does.
    """
    total = np.where(profile.total > 0.0, profile.total, 1.0)
    return profile.beyond(d) + np.pi * np.square(d)[..., None] * profile.reflectance(d) / total


def falloff_table(profile: Profile) -> tuple[Array, Array]:
    """Return distances (n,), mm, and the falloff (n, 3) there.

    Beyond the last distance, at most the share BEYOND of the light leaves.
    """
    farthest = max(float(profile.range(BEYOND).max()), 1e-6)
    distances = geometric(_NEAREST * farthest, farthest, _ENTRIES)
    return distances, falloff(profile, distances)


def far_side(caster: rays.Caster, mesh: Mesh, vertices: Array) -> Array:
    """Return the length of each ray from `vertices` (N,) to the far side: (N, RAYS), mm.

    It is infinite for rays that meet nothing, or a face that does not face away from the vertex.
    """
    n = mesh.normals[vertices].astype(np.float64)
    turn = GOLDEN_ANGLE * RAYS * vertices
    w = cosine_directions(-n, GOLDEN_ANGLE * np.arange(RAYS) + turn[:, None])
    x = mesh.positions[vertices] - _LIFT * float(np.ptp(mesh.bounds, axis=0).max()) * n
    hit = caster.first(np.repeat(x, RAYS, axis=0), w.reshape(-1, 3)).reshape(len(x), RAYS)
    normal, corner = mesh.face_normals[hit], mesh.positions[mesh.faces[hit, 0]]
    opposed = (hit >= 0) & (np.einsum("nrk,nk->nr", normal, n) < 0.0)
    height = np.einsum("nrk,nrk->nr", normal, corner - x[:, None])
    slope = np.einsum("nrk,nrk->nr", normal, w)
    return np.divide(height, slope, out=np.full(hit.shape, np.inf), where=opposed & (slope > 0.0))


def smoothed(mesh: Mesh, values: Array) -> Array:
    """Smooth `values` (V, 3) at the vertices twice: float32 (V, 3).

    Each time a value is replaced by the mean of the linearly interpolated values on the adjacent faces, weighted by the
    barycentric coordinate of its vertex.
    """
    from scipy.sparse import coo_matrix

    area = np.linalg.norm(mesh.face_normals, axis=1)
    row, column = np.meshgrid(range(3), range(3))
    weight = np.where(row == column, 2.0, 1.0).ravel() * area[:, None]
    ends = mesh.faces[:, row.ravel()].ravel(), mesh.faces[:, column.ravel()].ravel()
    weights = coo_matrix((weight.ravel(), ends), shape=(len(values), len(values))).tocsr()
    sums = np.maximum(np.asarray(weights.sum(axis=1)), 1e-300)
    for _ in range(_SMOOTHINGS):
        values = weights @ values / sums
    return values.astype(np.float32)
