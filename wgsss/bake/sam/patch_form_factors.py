"""Form factors from many senders to small patches of receivers, from a table of R_d.

Between two near vertices, the form factor (Maisch & Ropinski 2017, eq. 11) is integrated over both fans; `near_pairs`
lists these pairs. For all other pairs, and for all nodes of the sender tree, it is the sender's area times R_d at the
distance of the centroids (as in eq. 15). The work is laid out as matrix products over patches, because all vertices of
a mesh and thousands of senders of each are evaluated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.sender_tree import SenderTree
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.optics.lookup import interval_middles, leading_bits
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

NEAR_WIDTHS = 4.0
"""distance up to which form factors are integrated, in roots of the larger fan's area; a fan is about 1.2 wide"""
NEAR_ORDER = 2
"""highest order of the quadrature points of near pairs"""
_GAUSS_WIDTHS = 3.0  # the distance, in the same unit, beyond which near pairs have points of order 1 at most
IGNORED_SHARE = 5e-4
"""share of the light that leaves a plane beyond the distance at which senders are ignored"""
_TABLE_SHARE = 1e-5  # share of it that leaves beyond the end of the table, where R_d counts as 0
_OPENED_SHARE = 2e-3  # of the total of R_d: nodes that contribute more may be replaced by their children
_SHIFT = 16  # for leading_bits: 128 entries for each doubling of the squared distance, half as many as in other tables
_FIRST_DISTANCE = 1e-3  # of the table, as a share of the distance at which senders are ignored
_AT_ONCE = 1 << 16  # vertices whose neighbours are searched for together


class PatchFormFactors:
    """Computes form factors K_oi (eq. 11) from vertices and nodes of a sender tree to patches of vertices."""

    def __init__(self, gpu: Gpu, mesh: Mesh, profile: Profile, senders: SenderTree) -> None:
        self.senders = senders
        self.farthest = float(profile.range(IGNORED_SHARE).max())
        """mm: senders that are farther away are ignored"""
        self.opened = _OPENED_SHARE * float(profile.total.max())
        """nodes that contribute more than this, without unit, may be replaced by their children"""
        ends_mm = np.array([_FIRST_DISTANCE * self.farthest, profile.range(_TABLE_SHARE).max()], np.float32)
        self._first, last = leading_bits(np.square(ends_mm), _SHIFT).tolist()
        R = profile.reflectance(np.sqrt(interval_middles(self._first, last + 1, _SHIFT))).astype(np.float32)
        self._R = np.append(R.T, np.zeros((3, 1), np.float32), axis=1)  # 0 beyond the end

        pairs = near_pairs(mesh)
        factors = FormFactors(gpu, mesh, profile)
        distance = np.linalg.norm(mesh.positions[pairs[:, 0]] - mesh.positions[pairs[:, 1]], axis=1)
        width = np.sqrt(factors.fans.area[pairs].max(axis=1))
        is_nearest = distance < _GAUSS_WIDTHS * width
        self._near = np.zeros((len(pairs), 3), np.float32)
        for chosen, order in ((is_nearest, NEAR_ORDER), (~is_nearest, 1)):
            self._near[chosen] = factors.of(pairs[chosen], max_order=order)
        self._vertices = len(mesh.positions)
        self._pairs = np.append(pairs[:, 0] * self._vertices + pairs[:, 1], np.iinfo(np.int64).max)

    def reflectance(self, squared: Array) -> Array:
        """Return R_d (3, ...), 1/mm^2, from the table at squared distances `squared` (...), float32, mm^2."""
        return self._R.take(np.clip(self._entry(squared), 0, self._R.shape[1] - 1), axis=1)

    def __call__(self, receiver: Array, sender: Array) -> Array:
        """Return the form factors from all senders of a patch to all its receivers, float32 (B, 3, P, C).

        They are 0 where the sender is not on the back side of the receiver (eq. 13, 14) and where it is -1.

        Args:
            receiver: int (B, P), the vertices of B patches.
            sender: int (B, C), vertices and nodes of the tree of senders for each patch; -1 for none.
        """
        s = self.senders
        origin = s.x[receiver[:, :1]]  # products of coordinates lose no digits near it

        def local(x: Array, index: Array) -> Array:
            return x[index] - origin

        def products(a: Array, b: Array) -> Array:
            return a @ b.transpose(0, 2, 1)

        def dot(a: Array, b: Array) -> Array:
            return np.einsum("bnd,bnd->bn", a, b)

        n, centre, far = s.n[receiver], local(s.centre, receiver), local(s.centre, sender)
        is_behind = products(n, local(s.x, sender)) < dot(n, local(s.x, receiver))[:, :, None]
        is_behind &= products(n, s.n[sender]) < 0.0
        square = products(-2.0 * centre, far)
        square += dot(centre, centre)[:, :, None]
        square += dot(far, far)[:, None]
        area = np.where(sender >= 0, s.area[sender], np.float32(0.0))[:, None]
        K = np.empty((len(is_behind), 3, *is_behind.shape[1:]), np.float32)
        entry, area_behind = self._entry(square), area * is_behind
        for channel, R in enumerate(self._R):
            np.multiply(R.take(entry, mode="clip"), area_behind, out=K[:, channel])

        # Integrated form factors replace those of near pairs. First drop what is too far away to be one.
        width = np.maximum(s.area[receiver][:, :, None], area)
        is_behind &= (square < 2.0 * NEAR_WIDTHS**2 * width) & (sender < self._vertices)[:, None]
        b, p, c = np.nonzero(is_behind)
        pair = receiver[b, p] * np.int64(self._vertices) + sender[b, c]
        index = np.searchsorted(self._pairs, pair)
        is_near = self._pairs[index] == pair
        K[b[is_near], :, p[is_near], c[is_near]] = self._near[index[is_near]]
        return K

    def _entry(self, square: Array) -> Array:
        """Return the entries of the table, unclamped, for squared distances, float32, mm^2."""
        return leading_bits(square, _SHIFT) - np.int32(self._first)


def near_pairs(mesh: Mesh) -> Array:
    """Return the pairs of near vertices, int64 (P, 2), in ascending order: receiver o and sender i behind it.

    A pair is near if its distance is at most NEAR_WIDTHS square roots of the larger of the two fans' areas. The sender
    is on the back side of the receiver (eq. 13, 14).
    """
    from scipy.spatial import KDTree

    x, n, V = mesh.positions.astype(np.float64), mesh.normals, len(mesh.positions)
    reach = NEAR_WIDTHS * np.sqrt(fan_areas(mesh))
    all_vertices = KDTree(x)
    keys = []
    order = np.argsort(reach, kind="stable")
    # One search has one radius, the largest reach of its vertices, so vertices of similar reach share a search.
    for batch in np.split(order, _cuts(reach[order])):
        pairs = KDTree(x[batch]).sparse_distance_matrix(all_vertices, reach[batch[-1]], output_type="ndarray")
        o, i = batch[pairs["i"]], pairs["j"]
        is_near = (pairs["v"] <= reach[o]) & (np.einsum("pd,pd->p", n[o], n[i]) < 0.0)
        keys += [o[is_near] * V + i[is_near], i[is_near] * V + o[is_near]]
    o, i = np.divmod(np.unique(np.concatenate(keys)), V)
    is_below = np.einsum("pd,pd->p", x[i] - x[o], n[o]) < 0.0
    return np.stack([o, i], axis=1)[is_below]


def _cuts(reach: Array) -> Array:
    """Return where to split ascending values so that those of a part differ by a factor of at most sqrt(2)."""
    octave = np.floor(2.0 * np.log2(np.maximum(reach, 1e-30)))
    return np.flatnonzero((np.diff(octave) > 0) | (np.arange(1, len(reach)) % _AT_ONCE == 0)) + 1
