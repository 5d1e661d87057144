"""The triangles of a body as the file has them, before repair."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.blend import Blend
from wgsss.scene.cutout import Mask, cut
from wgsss.scene.files.contents import Look, Part
from wgsss.scene.repair import counted
from wgsss.scene.rig import Rig
from wgsss.scene.textures import FARTHEST_UV, coordinates

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Soup:
    """V vertices and F faces of several parts, joined."""

    positions: Array
    """float64 (V, 3) at rest, in the space and unit of the file"""
    faces: Array
    """int64 (F, 3)"""
    normals: Array | None
    """float64 (V, 3); zero for parts that have none"""
    uvs: Array | None
    """float64 (V, 2), v down"""
    colors: Array | None
    """float64 (V, 3), linear, 0 to 1"""
    sources: Blend | None = None
    """the vertices as blends of those of all parts in a row; None if they are the same"""

    def cut(self, mask: Mask) -> Soup:
        """Cut the soup along the outline of a mask over its texture coordinates."""
        if self.uvs is None:
            return self if mask.alpha.flat[0] >= mask.cutoff else replace(self, faces=self.faces[:0])
        blend, faces = cut(self.positions, self.faces, self.uvs, mask)
        kept = (self.positions, self.normals, self.uvs, self.colors)
        positions, normals, uvs, colors = (None if values is None else blend.of(values) for values in kept)
        assert positions is not None
        return Soup(positions, faces, normals, uvs, colors, blend)


def placed(parts: Sequence[Part], rig: Rig | None) -> list[Array]:
    """Compute the positions of each part at rest: float64 (V, 3) each, in the space and unit of the file."""
    positions = [_transform(part.positions, part.matrix[:3, :3]) + part.matrix[:3, 3] for part in parts]
    if rig is not None:
        rest, world = rig.nodes.rest, rig.nodes.world(rig.nodes.rest)
        for number, part in enumerate(rig.parts):
            if part.is_shaped(rest):
                positions[number] = part.posed(rest, world)
    return positions


def joined(
    parts: Sequence[Part], positions: Sequence[Array], look: Look, rig: Rig | None, say: Callable[[str], None]
) -> Soup:
    """Join parts with the same material. `positions` are their placed positions. `rig` has these parts only."""
    faces, normals, start = [], [], 0
    for number, part in enumerate(parts):
        shaped = rig is not None and rig.parts[number].is_shaped(rig.nodes.rest)
        skinned = rig is not None and rig.parts[number].skin is not None
        determinant = np.linalg.det(part.matrix[:3, :3])
        turned = determinant < 0 and not skinned  # where its node stands does not matter to a skin
        faces.append((part.faces[:, ::-1] if turned else part.faces) + start)
        if part.normals is None or shaped or determinant == 0:
            normals.append(np.zeros_like(part.positions))
        else:
            normals.append(_transform(part.normals, np.linalg.inv(part.matrix[:3, :3]).T))
        start += len(part.positions)
    all_normals = np.concatenate(normals)
    return Soup(
        np.concatenate(positions),
        np.concatenate(faces),
        all_normals if all_normals.any() else None,
        _uvs(parts, look, say),
        _colors(parts),
    )


def _uvs(parts: Sequence[Part], look: Look, say: Callable[[str], None]) -> Array | None:
    by_part = [coordinates(part, look) for part in parts]
    without = sum(uvs is None for uvs in by_part)
    if without == len(parts):
        return None
    if without:
        say(f"texture coordinates left out: {without} of {len(parts)} parts have none")
        return None
    uvs = np.concatenate([uvs for uvs in by_part if uvs is not None])
    bad = ~(np.abs(uvs) <= FARTHEST_UV).all(axis=1)
    if bad.any():
        say(f"{counted(int(bad.sum()), 'texture coordinate')} not finite or beyond {FARTHEST_UV:g}, replaced by 0")
        uvs = np.where(bad[:, None], 0.0, uvs)
    return uvs


def _colors(parts: Sequence[Part]) -> Array | None:
    if all(part.colors is None for part in parts):
        return None
    by_part = [np.ones_like(part.positions) if part.colors is None else part.colors for part in parts]
    colors = np.clip(np.nan_to_num(np.concatenate(by_part), nan=1.0), 0.0, 1.0)
    return None if (colors == 1.0).all() else colors


def _transform(vectors: Array, linear: Array) -> Array:
    """Multiply each row by a matrix, without BLAS, which may round equal rows differently and so open seams."""
    x, y, z = vectors.T
    with np.errstate(all="ignore"):  # positions that are not finite are the caller's to find
        return np.stack([x * row[0] + y * row[1] + z * row[2] for row in linear], axis=1)
