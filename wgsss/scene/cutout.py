"""Cutting a mesh along the outline of an alpha mask.

A leaf is often modelled as a few large triangles with a texture whose alpha channel holds its outline. The mesh is cut
along that outline once, when the file is read, so that methods, shadow maps and references need not handle masks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.blend import Blend

Array = npt.NDArray[Any]

STEP = 1.5
"""Edges near the outline are split until they are at most this many texels long. Stems two texels wide then keep their
width. With twice the length they lose a sixth of it."""
MOST_FACES = 400_000
"""Largest number of faces. Beyond it edges are not split, so that a large noisy mask cannot fill the memory."""
_ROUNDS = 24  # of splitting in half: more than any texture needs
_CLOSEST = 0.05  # the outline keeps at least this share of an edge away from its ends, to avoid slivers


@dataclass(frozen=True, eq=False)
class Mask:
    """An alpha mask over texture coordinates."""

    alpha: Array
    """float (H, W), 0 to 1, top row at v = 0"""
    cutoff: float
    """the surface is absent where alpha is below this value"""
    wrap: tuple[str, str]
    """how the mask continues beyond 0 to 1 along u and v: "repeat", "clamp" or "mirror" """

    def height(self, uvs: Array) -> Array:
        """Return alpha minus the cutoff at texture coordinates (N, 2), interpolated between texels: (N,)."""
        texels = [self._fold(uvs[:, i], self.alpha.shape[1 - i], self.wrap[i]) for i in range(2)]
        (left, right, across), (upper, lower, down) = texels
        top = self.alpha[upper, left] * (1 - across) + self.alpha[upper, right] * across
        bottom = self.alpha[lower, left] * (1 - across) + self.alpha[lower, right] * across
        difference: Array = top * (1 - down) + bottom * down - self.cutoff
        return difference

    @staticmethod
    def _fold(u: Array, size: int, wrap: str) -> tuple[Array, Array, Array]:
        """Return the two texels around each coordinate, and the interpolation weight of the second."""
        first = np.floor(u * size - 0.5)
        share = u * size - 0.5 - first
        ends = []
        for at in (first, first + 1):
            if wrap == "clamp":
                at = np.clip(at, 0, size - 1)
            elif wrap == "mirror":
                at = np.mod(at, 2 * size)
                at = np.minimum(at, 2 * size - 1 - at)
            ends.append(np.mod(at, size).astype(np.int64))
        return ends[0], ends[1], share

    @cached_property
    def _counts(self) -> tuple[Array, tuple[int, int]]:
        """A summed-area table of texels at or above the cutoff over two by two periods, and the size of a period."""
        inside = self.alpha >= self.cutoff
        for axis, wrap in ((1, self.wrap[0]), (0, self.wrap[1])):
            if wrap == "mirror":
                inside = np.concatenate([inside, np.flip(inside, axis)], axis)
        height, width = inside.shape
        count = np.zeros((2 * height + 1, 2 * width + 1), np.int64)
        count[1:, 1:] = np.tile(inside, (2, 2)).cumsum(axis=0).cumsum(axis=1)
        return count, (height, width)

    def straddled(self, low: Array, high: Array) -> Array:
        """Whether boxes of texture coordinates, with corners (N, 2), have texels on both sides of the cutoff."""
        count, (height, width) = self._counts
        spans = []
        for i, period in ((0, width), (1, height)):
            size = self.alpha.shape[1 - i]
            start = np.floor(low[:, i] * size - 0.5)
            stop = np.floor(high[:, i] * size - 0.5) + 2
            if self.wrap[i] == "clamp":
                start, stop = np.clip(start, 0, size - 1), np.clip(stop, 1, size)
                stop = np.maximum(stop, start + 1)
            length = np.minimum(stop - start, period)
            start = np.mod(start, period)
            spans.append((start.astype(np.int64), (start + length).astype(np.int64)))
        (left, right), (upper, lower) = spans
        within = count[lower, right] - count[upper, right] - count[lower, left] + count[upper, left]
        straddles: Array = (within > 0) & (within < (right - left) * (lower - upper))
        return straddles


def cut(positions: Array, faces: Array, uvs: Array, mask: Mask) -> tuple[Blend, Array]:
    """Cut faces (F, 3) to the region where the mask is at or above its cutoff.

    Edges near the outline are split until they are STEP texels long. Faces are then clipped where alpha, interpolated
    along an edge, equals the cutoff. Edges at the same positions (V, 3) are split alike, so that seams stay closed.

    Returns the new vertices as blends of the old ones, and the faces over them.
    """
    from scipy.sparse import csr_array, identity, vstack

    size = np.array(mask.alpha.shape[::-1])
    same = np.unique(positions, axis=0, return_inverse=True)[1].reshape(-1)
    weights: Any = csr_array(identity(len(uvs), format="csr"))
    for _ in range(_ROUNDS):
        ends, of_face = _edges(faces)
        a, b = uvs[ends[:, 0]], uvs[ends[:, 1]]
        length = np.linalg.norm((b - a) * size, axis=1)
        around = np.abs(b - a).max(axis=1, keepdims=True) / 2
        near = mask.straddled(np.minimum(a, b) - around, np.maximum(a, b) + around)
        # The same edge on the other side of a seam is split with it.
        twins = _distinct(np.sort(same[ends], axis=1))[1]
        for step in (STEP, 2 * STEP, 4 * STEP):  # of too many the longest
            split = np.bincount(twins, near & (length > step))[twins] > 0
            if len(faces) + 2 * split.sum() <= MOST_FACES:
                break
        else:
            break
        if not split.any():
            break
        chosen = ends[split]
        middle = np.full(len(ends), -1)
        middle[split] = len(uvs) + np.arange(len(chosen))
        weights = vstack([weights, (weights[chosen[:, 0]] + weights[chosen[:, 1]]) * 0.5], format="csr")
        uvs = np.concatenate([uvs, (uvs[chosen[:, 0]] + uvs[chosen[:, 1]]) / 2])
        place = np.unique(twins[split], return_inverse=True)[1].reshape(-1)
        same = np.concatenate([same, same.max() + 1 + place])
        faces = _refined(faces, middle[of_face])

    height = mask.height(uvs)
    ends, of_face = _edges(faces)
    first, second = height[ends[:, 0]], height[ends[:, 1]]
    crossed = (first >= 0) != (second >= 0)
    chosen = ends[crossed]
    share = np.clip(first[crossed] / (first[crossed] - second[crossed]), _CLOSEST, 1 - _CLOSEST)
    point = np.full(len(ends), -1)
    point[crossed] = len(uvs) + np.arange(len(chosen))
    kept = (1 - share) * weights[chosen[:, 0]].T + share * weights[chosen[:, 1]].T
    weights = vstack([weights, csr_array(kept.T)], format="csr")
    faces = _clipped(faces, height >= 0, point[of_face])
    return _compact(weights, faces)


def _edges(faces: Array) -> tuple[Array, Array]:
    """Return the distinct edges (E, 2), and the edges (F, 3) of each face: first to second corner, and so on."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    distinct, index = _distinct(ends)
    return distinct, index.reshape(-1, 3)


def _distinct(pairs: Array) -> tuple[Array, Array]:
    """Return the distinct rows of pairs of integers (N, 2), and the index of each row among them."""
    stride = int(pairs.max(initial=0)) + 1
    codes, index = np.unique(pairs[:, 0] * stride + pairs[:, 1], return_inverse=True)
    return np.stack(np.divmod(codes, stride), axis=1), index.reshape(-1)


def _refined(faces: Array, middle: Array) -> Array:
    """Split faces at the midpoints (F, 3) of their edges. -1 marks an edge that is not split."""
    pieces = [faces[(middle < 0).all(axis=1)]]
    for turn in range(3):  # one pattern of each kind, turned to where its edges are
        (a, b, c), (ab, bc, ca) = np.roll(faces, -turn, axis=1).T, np.roll(middle, -turn, axis=1).T
        one = (ab >= 0) & (bc < 0) & (ca < 0)
        two = (ab >= 0) & (bc >= 0) & (ca < 0)
        for chosen, corners in (
            (one, ((a, ab, c), (ab, b, c))),
            (two, ((ab, b, bc), (a, ab, bc), (a, bc, c))),
        ):
            pieces += [np.stack(corner, axis=1)[chosen] for corner in corners]
    whole = (middle >= 0).all(axis=1)
    (a, b, c), (ab, bc, ca) = faces[whole].T, middle[whole].T
    pieces += [np.stack(corner, axis=1) for corner in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate(pieces)


def _clipped(faces: Array, inside: Array, point: Array) -> Array:
    """Clip faces to the inside, given the points (F, 3) at which their edges cross the outline."""
    corners = inside[faces]
    pieces = [faces[corners.all(axis=1)]]
    for turn in range(3):
        (a, b, c), (ab, _, ca) = np.roll(faces, -turn, axis=1).T, np.roll(point, -turn, axis=1).T
        a_in, b_in, c_in = np.roll(corners, -turn, axis=1).T
        alone = a_in & ~b_in & ~c_in
        missing = ~a_in & b_in & c_in
        pieces.append(np.stack([a, ab, ca], axis=1)[alone])
        pieces += [np.stack(corner, axis=1)[missing] for corner in ((ab, b, c), (ab, c, ca))]
    return np.concatenate(pieces)


def _compact(weights: Any, faces: Array) -> tuple[Blend, Array]:
    """Drop unused vertices. Returns the others as blends of the original vertices, and the renumbered faces."""
    used, renumbered = np.unique(faces, return_inverse=True)
    rows = weights[used]
    rows.sum_duplicates()
    count = np.diff(rows.indptr)
    place = np.arange(len(rows.indices)) - np.repeat(rows.indptr[:-1], count)
    index, weight = np.zeros((len(used), 3), np.int64), np.zeros((len(used), 3))
    row = np.repeat(np.arange(len(used)), count)
    index[row, place], weight[row, place] = rows.indices, rows.data
    return Blend(index, weight), renumbered.reshape(-1, 3)
