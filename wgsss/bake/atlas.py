"""Texture coordinates for a mesh that has none, or none that are unique.

xatlas makes them where it is installed, which is wherever it has a wheel, and uvunwrap elsewhere. The environment
variable WGSSS_UNWRAP chooses one of the two.
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
"""the environment variable that names the library"""
PADDING = 5
"""Empty texels around each chart where the atlas is about 1024 to 1300 texels wide, the size that both libraries aim
at: at least 8 between two charts at 1024, and 4 at 512."""
_SIDE = 1024  # of uvunwrap's page, in texels
_FILLED = 0.2  # the least of it that charts are to cover, or else the page grows


def library() -> str:
    """The name of the library that makes atlases.

    Raises InputError where none is installed, or not the one that $WGSSS_UNWRAP names.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen and chosen not in LIBRARIES:
        raise unknown(f"library in ${VARIABLE}", chosen, LIBRARIES)
    for name in [chosen] if chosen else LIBRARIES:
        if find_spec(name):
            return name
    raise InputError(f"no mesh can be unwrapped: install the Python package {chosen or ' or '.join(LIBRARIES)}")


def new_atlas(mesh: Mesh) -> Array:
    """float32 (F, 3, 2): texture coordinates of the faces' corners that fill the unit square, v down. No two points of
    the surface share one.

    Raises InputError where the mesh has no face with an area.
    """
    size = np.ptp(mesh.bounds, axis=0).max()
    twice_areas = np.linalg.norm(mesh.face_normals, axis=1)
    if not (size > 0 and twice_areas.max() > 1e-12 * size * size):
        raise InputError(f"{mesh.name}: no face has an area, so the mesh cannot be unwrapped")
    # xatlas compares areas with absolute thresholds: faces much smaller than 1 would end up as hundreds of charts.
    unit = np.sqrt(np.median(twice_areas[twice_areas > 0]))
    atlas = LIBRARIES[library()]((_smoothed(mesh) / unit).astype(np.float32), mesh.faces.astype(np.uint32))
    if atlas is None:
        raise InputError(f"{mesh.name}: the mesh cannot be unwrapped")
    return atlas


def _xatlas(positions: Array, faces: Array) -> Array | None:
    import xatlas

    pack = xatlas.PackOptions()
    pack.padding = PADDING
    pack.resolution = 0  # one page, however large
    atlas = xatlas.Atlas()
    atlas.add_mesh(positions, faces)
    atlas.generate(xatlas.ChartOptions(), pack)
    _, found, uvs = atlas.get_mesh(0)
    if not atlas.chart_count or len(found) != len(faces):
        return None
    # The page is not square: stretched to fill the map, with room for the gutters along its rim.
    page = np.array([atlas.width, atlas.height])
    return np.asarray(((uvs * page + PADDING) / (page + 2 * PADDING)).astype(np.float32)[found])


def _uvunwrap(positions: Array, faces: Array) -> Array | None:
    import uvunwrap

    # The other way of packing fits in an eighth more, but takes minutes for thousands of charts.
    options: dict[str, Any] = {"padding": PADDING, "packing": "fast"}
    meshes = [uvunwrap.Mesh(positions, faces)]
    atlas = uvunwrap.generate(meshes, page_size=_SIDE, **options)
    # Gutters would take up most of the page where there are very many charts.
    if atlas.chart_count and (atlas.page_count > 1 or atlas.utilization < _FILLED):
        a, b, c = positions[faces].astype(np.float64).transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
        density = _SIDE * float(np.sqrt(0.5 / area))
        atlas = uvunwrap.generate(meshes, page_size=None, texels_per_unit=density, **options)
    if not atlas.chart_count:
        return None
    return np.array(atlas.meshes[0].corner_uvs, np.float32).reshape(-1, 3, 2)


LIBRARIES: dict[str, Callable[[Array, Array], Array | None]] = {"xatlas": _xatlas, "uvunwrap": _uvunwrap}
"""what can make an atlas (F, 3, 2) of positions (V, 3) and faces (F, 3), by name, the default first; None: it cannot"""


def _smoothed(mesh: Mesh) -> Array:
    """float64 (V, 3): positions moved a little along their normals towards the mean of their neighbours, mm. On rough
    scans that saves a third of the charts; what it distorts, the stretch of the true surface accounts for."""
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
