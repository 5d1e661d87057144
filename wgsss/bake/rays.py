"""Rays against a mesh, cast by Embree if the package embreex is installed, else by libigl.

Both find the same faces, except for rays that meet an edge up to rounding. libigl takes three to seven times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]
Cast = Callable[[Array, Array], Array]

_EXTENT = 1e4  # the mesh is scaled to this size: libigl ignores faces of less than about 1e-6 square units


class Caster:
    """Casts rays against the triangles `faces` (F, 3) of `positions` (V, 3)."""

    def __init__(self, positions: Array, faces: Array, library: str | None = None) -> None:
        """`library` is one of LIBRARIES; by default the first that is installed. Raises InputError if none is."""
        self._low = positions.min(axis=0).astype(np.float64)
        self._scale = _EXTENT / max(float(np.linalg.norm(np.ptp(positions, axis=0))), 1e-30)
        self._first, self._any = LIBRARIES[library or _installed()](self._placed(positions), faces)

    def first(self, origins: Array, directions: Array) -> Array:
        """Return the face (N,) that each ray meets first, or -1.

        `origins` (N, 3) are in the unit of the positions; `directions` (N, 3) are of length 1. Faces are met from both
        sides.
        """
        return self._first(self._placed(origins), directions)

    def blocked(self, origins: Array, directions: Array) -> Array:
        """Return whether each ray meets a face: bool (N,). Arguments as of `first`."""
        return self._any(self._placed(origins), directions) >= 0

    def _placed(self, points: Array) -> Array:
        """Move and scale points into a box of size _EXTENT at the origin, where the tolerances of the libraries fit."""
        return (points - self._low) * self._scale


def _embree(positions: Array, faces: Array) -> tuple[Cast, Cast]:
    """Return functions of origins and directions that find the first face, and any face, by Embree."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, positions.astype(np.float32), np.ascontiguousarray(faces, np.int32))

    def cast(query: str) -> Cast:
        return lambda x, w: scene.run(x.astype(np.float32), w.astype(np.float32), query=query)

    return cast("INTERSECT"), cast("OCCLUDED")


def _libigl(positions: Array, faces: Array) -> tuple[Cast, Cast]:
    """Return functions of origins and directions that find the first face, and any face, by libigl."""
    import igl

    tree, triangles = igl.AABB(), faces.astype(np.int64)
    tree.init(positions, triangles)

    def cast(x: Array, w: Array) -> Array:
        return np.asarray(tree.intersect_ray_first(positions, triangles, x, w.astype(np.float64))[0])

    return cast, cast


LIBRARIES: dict[str, Callable[[Array, Array], tuple[Cast, Cast]]] = {"embreex": _embree, "igl": _libigl}
"""The functions that return (first, any) for a mesh, by the name of the library, the fastest first."""


def _installed() -> str:
    """Return the first of LIBRARIES that is installed."""
    for name in LIBRARIES:
        if find_spec(name):
            return name
    raise InputError("no library can cast rays: install the Python package embreex or libigl")
