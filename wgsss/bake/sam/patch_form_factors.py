"""Form factors of all that reaches patches of vertices: between near fans integrated over both, beyond that R_d at
their distance."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.sender_tree import SenderTree
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

NEAR = 4.0
"""roots of a fan's area within which form factors are integrated; a fan is some 1.2 across"""
ORDER = 2
"""of the points in a quad that they are integrated by"""
BEYOND = 5e-4
"""share of the light of a plane that comes from farther away than what is looked at"""
TAIL = 1e-5
"""share of it that comes from farther away than what is known at all"""
FAINT = 2e-3
"""share of what leaves a plane in all, below which a node is not looked into"""
NEAREST = 3.0
"""roots of a fan's area within which quads have points of ORDER; farther away, one that knows how far they extend"""
_AT_ONCE = 1 << 16  # vertices whose neighbours are found at a time
_SHIFT = 16  # bits of a squared distance that the table of R_d leaves out: it has 128 entries each time that it doubles
_LEAST = 1e-3  # its first distance, of what is looked at


class PatchFormFactors:
    """K (000 eq. 11) of one mesh and profile, from senders to patches of vertices."""

    def __init__(self, gpu: Gpu, mesh: Mesh, profile: Profile) -> None:
        self.farthest = float(profile.range(BEYOND).max())
        self.faint = FAINT * float(profile.total.max())
        known = np.array([_LEAST * self.farthest, profile.range(TAIL).max()], np.float32)
        ends = np.square(known).view(np.int32) >> _SHIFT
        self._first, last = int(ends[0]), int(ends[1])
        middles = (np.arange(self._first, last + 1, dtype=np.int32) << _SHIFT) + (1 << (_SHIFT - 1))
        R = profile.reflectance(np.sqrt(middles.view(np.float32).astype(np.float64))).astype(np.float32)
        self._R = np.append(R.T, np.zeros((3, 1), np.float32), axis=1)  # nothing from beyond

        pairs = near_pairs(mesh)
        factors = FormFactors(gpu, mesh, profile)
        apart = np.linalg.norm(mesh.positions[pairs[:, 0]] - mesh.positions[pairs[:, 1]], axis=1)
        width = np.sqrt(factors.fans.area[pairs].max(axis=1))
        nearest = apart < NEAREST * width
        self._near = np.zeros((len(pairs), 3), np.float32)
        for which, order in ((nearest, ORDER), (~nearest, 1)):
            self._near[which] = factors.of(pairs[which], most=order)
        self._vertices = len(mesh.positions)
        self._pairs = np.append(pairs[:, 0] * self._vertices + pairs[:, 1], np.iinfo(np.int64).max)

    def reflectance(self, squared: Array) -> Array:
        """R_d, 1/mm^2, (3, ...), at the roots of `squared` (...) mm^2, float32."""
        return self._R.take(np.clip(self._entry(squared), 0, self._R.shape[1] - 1), axis=1)

    def __call__(self, s: SenderTree, vertices: Array, senders: Array) -> Array:
        """float32 (B, 3, P, C): from senders (B, C) to vertices (B, P), 0 where they are not behind them (eq. 13, 14),
        and of those that are -1."""
        first = s.x[vertices[:, :1]]  # near them, products lose nothing

        def near(x: Array, which: Array) -> Array:
            return x[which] - first

        def product(a: Array, b: Array) -> Array:
            return a @ b.transpose(0, 2, 1)

        def own(a: Array, b: Array) -> Array:
            return np.einsum("bnd,bnd->bn", a, b)

        n, centre, far = s.n[vertices], near(s.centre, vertices), near(s.centre, senders)
        back = product(n, near(s.x, senders)) < own(n, near(s.x, vertices))[:, :, None]
        back &= product(n, s.n[senders]) < 0.0
        square = product(-2.0 * centre, far)
        square += own(centre, centre)[:, :, None]
        square += own(far, far)[:, None]
        area = np.where(senders >= 0, s.area[senders], np.float32(0.0))[:, None]
        K = np.empty((len(back), 3, *back.shape[1:]), np.float32)
        entry, counted = self._entry(square), area * back
        for channel, R in enumerate(self._R):
            np.multiply(R.take(entry, mode="clip"), counted, out=K[:, channel])

        width = np.maximum(s.area[vertices][:, :, None], area)
        back &= (square < 2.0 * NEAR**2 * width) & (senders < self._vertices)[:, None]  # those that may be among pairs
        b, p, c = np.nonzero(back)
        pair = vertices[b, p] * np.int64(self._vertices) + senders[b, c]
        at = np.searchsorted(self._pairs, pair)
        known = self._pairs[at] == pair
        K[b[known], :, p[known], c[known]] = self._near[at[known]]
        return K

    def _entry(self, square: Array) -> Array:
        return (square.view(np.int32) >> np.int32(_SHIFT)) - np.int32(self._first)


def near_pairs(mesh: Mesh) -> Array:
    """int64 (P, 2): vertices o and i, on the back side of o, whose distance is NEAR roots of the larger fan's area at
    most; in ascending order."""
    from scipy.spatial import KDTree

    x, n, V = mesh.positions.astype(np.float64), mesh.normals, len(mesh.positions)
    reach = NEAR * np.sqrt(fan_areas(mesh))
    everything = KDTree(x)
    found = []
    order = np.argsort(reach, kind="stable")  # of those of one search, which has one radius, few have a smaller one
    for some in np.split(order, _cuts(reach[order])):
        pairs = KDTree(x[some]).sparse_distance_matrix(everything, reach[some[-1]], output_type="ndarray")
        o, i = some[pairs["i"]], pairs["j"]
        kept = (pairs["v"] <= reach[o]) & (np.einsum("pd,pd->p", n[o], n[i]) < 0.0)
        found += [o[kept] * V + i[kept], i[kept] * V + o[kept]]
    o, i = np.divmod(np.unique(np.concatenate(found)), V)
    below = np.einsum("pd,pd->p", x[i] - x[o], n[o]) < 0.0
    return np.stack([o, i], axis=1)[below]


def _cuts(reach: Array) -> Array:
    """Where to cut ascending reaches, so that those of a part are alike by a factor of the root of 2."""
    octave = np.floor(2.0 * np.log2(np.maximum(reach, 1e-30)))
    return np.flatnonzero((np.diff(octave) > 0) | (np.arange(1, len(reach)) % _AT_ONCE == 0)) + 1
