"""Atlases: unique texture coordinates for meshes that have none.

The library xatlas computes them if it is installed, else uvunwrap. The environment variable WGSSS_UNWRAP chooses one of
the two.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, unknown
from wgsss.scene.mesh import Mesh

Array = npt.NDArray[Any]

VARIABLE = "WGSSS_UNWRAP"
"""The environment variable that names the library."""
PADDING = 5
"""Empty texels around each chart of an atlas that is 1024 to 1300 texels wide, the width that both libraries aim at.

Between two charts there are at least 8 empty texels on a map of 1024 texels, and 4 on one of 512.
"""
_SIDE = 1024  # width of the page of uvunwrap, texels
_FILLED = 0.2  # share of the page that charts must cover; else a larger page is used


def library() -> str:
    """Return the name of the library that computes atlases.

    Raises InputError if none is installed, or if the one that $WGSSS_UNWRAP names is unknown or not installed.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen and chosen not in LIBRARIES:
        raise unknown(f"library in ${VARIABLE}", chosen, LIBRARIES)
    for name in [chosen] if chosen else LIBRARIES:
        if find_spec(name):
            return name
    raise InputError(f"no mesh can be unwrapped: install the Python package {chosen or ' or '.join(LIBRARIES)}")


def new_atlas(mesh: Mesh) -> Array:
    """Compute texture coordinates for the corners of the faces, float32 (F, 3, 2), v down, in the unit square.

    No two points of the surface have the same coordinates. Raises InputError if the mesh has no face with an area.
    """
    size = np.ptp(mesh.bounds, axis=0).max()
    twice_areas = np.linalg.norm(mesh.face_normals, axis=1)
    if not (size > 0 and twice_areas.max() > 1e-12 * size * size):
        raise InputError(f"{mesh.name}: no face has an area, so the mesh cannot be unwrapped")
    # xatlas compares areas with absolute thresholds: it would put faces much smaller than 1 into hundreds of charts.
    unit = np.sqrt(np.median(twice_areas[twice_areas > 0]))
    atlas = LIBRARIES[library()]((_smoothed(mesh) / unit).astype(np.float32), mesh.faces.astype(np.uint32))
    if atlas is None:
        raise InputError(f"{mesh.name}: the mesh cannot be unwrapped")
    return atlas


def _xatlas(positions: Array, faces: Array) -> Array | None:
    """Compute an atlas by xatlas. None if it finds no charts, or leaves out faces."""
    import xatlas

    pack = xatlas.PackOptions()
    pack.padding = PADDING
    pack.resolution = 0  # one page, however large
    atlas = xatlas.Atlas()
    atlas.add_mesh(positions, faces)
    atlas.generate(xatlas.ChartOptions(), pack)
    _, atlas_faces, uvs = atlas.get_mesh(0)
    if not atlas.chart_count or len(atlas_faces) != len(faces):
        return None
    # The page is not square. It is stretched to fill the map, and keeps a margin for the gutters at its border.
    page = np.array([atlas.width, atlas.height])
    return np.asarray(((uvs * page + PADDING) / (page + 2 * PADDING)).astype(np.float32)[atlas_faces])


def _uvunwrap(positions: Array, faces: Array) -> Array | None:
    """Compute an atlas by uvunwrap. None if it finds no charts."""
    import uvunwrap

    # The other packing covers an eighth more of the page, but takes minutes for thousands of charts.
    options: dict[str, Any] = {"padding": PADDING, "packing": "fast"}
    meshes = [uvunwrap.Mesh(positions, faces)]
    atlas = uvunwrap.generate(meshes, page_size=_SIDE, **options)
    # With very many charts, the padding would fill most of the page.
    if atlas.chart_count and (atlas.page_count > 1 or atlas.utilization < _FILLED):
        a, b, c = positions[faces].astype(np.float64).transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
        density = _SIDE * float(np.sqrt(0.5 / area))
        atlas = uvunwrap.generate(meshes, page_size=None, texels_per_unit=density, **options)
    if not atlas.chart_count:
        return None
    return np.array(atlas.meshes[0].corner_uvs, np.float32).reshape(-1, 3, 2)


LIBRARIES: dict[str, Callable[[Array, Array], Array | None]] = {"xatlas": _xatlas, "uvunwrap": _uvunwrap}
"""Functions that compute an atlas (F, 3, 2) from positions (V, 3) and faces (F, 3), by library, the default first."""


def _smoothed(mesh: Mesh) -> Array:
    """Return smoothed positions, float64 (V, 3), mm, relative to the lower corner of the bounding box.

    They are moved a little along their normals, towards the mean of their neighbours. Rough scans then have a third
    fewer charts. The charts of the smoothed mesh stretch the true surface a little more, which `stretch` measures.
    """
    ends = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]).T
    degree = np.maximum(np.bincount(ends.reshape(-1), minlength=len(mesh.positions)), 1)
    smooth = mesh
    for _ in range(2):
        positions, normals = smooth.positions.astype(np.float64), smooth.normals.astype(np.float64)
        total = np.zeros_like(positions)
        for a, b in (ends, ends[::-1]):
            for axis in range(3):
                total[:, axis] += np.bincount(a, positions[b, axis], len(positions))
        step = np.einsum("ij,ij->i", total / degree[:, None] - positions, normals)
        smooth = mesh.deformed(positions + 0.5 * step[:, None] * normals)
    return smooth.positions.astype(np.float64) - mesh.bounds[0]
