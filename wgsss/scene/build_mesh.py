"""Builds the mesh of repaired triangles, with the attributes of its corners."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.mesh import Mesh
from wgsss.scene.repair import Repaired
from wgsss.scene.soup import Soup

Array = npt.NDArray[Any]

# The normals of a file are kept if more than this share of them differs from smooth normals by more than this angle, as
# at hard edges. Otherwise they are smooth normals computed with other weights, which would be cracked at texture seams.
OWN_NORMALS_SHARE, OWN_NORMALS_DEGREES = 1e-3, 20.0


def build_mesh(soup: Soup, fixed: Repaired, name: str) -> Mesh:
    """Build the mesh of the repaired faces of a soup. Normals of flipped faces are flipped too, to point outwards."""

    def corners(values: Array | None) -> Array | None:
        return None if values is None else fixed.corners(values[soup.faces])

    mesh = Mesh(
        fixed.positions, fixed.faces, corner_uvs=corners(soup.uvs), corner_colors=corners(soup.colors), name=name
    )
    normals = corners(soup.normals)
    if normals is None:
        return mesh
    inward = fixed.flipped & (np.einsum("ij,ij->i", mesh.face_normals, normals.sum(axis=1)) < 0)
    return replace(mesh, corner_normals=_own_normals(mesh, np.where(inward[:, None, None], -normals, normals)))


def _own_normals(mesh: Mesh, normals: Array) -> Array | None:
    """Normalise the normals (F, 3, 3) of a file, and fill missing ones. Returns None if all are nearly smooth."""
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    smooth = mesh.normals[mesh.faces]
    unit = np.where(np.isfinite(length) & (length > 1e-6), normals / np.maximum(length, 1e-6), smooth)
    far = np.einsum("ijk,ijk->ij", unit, smooth) < math.cos(math.radians(OWN_NORMALS_DEGREES))
    return unit if far.mean() > OWN_NORMALS_SHARE else None


def device_vertices(mesh: Mesh) -> int:
    """Count the vertices of the render mesh: vertices are repeated where corners differ in an attribute."""
    carried = [values for values in (mesh.corner_normals, mesh.corner_uvs, mesh.corner_colors) if values is not None]
    if not carried:
        return len(mesh.positions)
    columns = [np.ascontiguousarray(values.reshape(3 * len(mesh.faces), -1)).view(np.uint32) for values in carried]
    return len(np.unique(np.concatenate([mesh.faces.reshape(-1, 1).astype(np.uint32), *columns], axis=1), axis=0))
