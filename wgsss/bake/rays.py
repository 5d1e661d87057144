"""Rays against a mesh, cast by Embree where its package has a wheel and by libigl elsewhere.

Both find the same faces but for rays that meet an edge to within rounding. libigl takes three to seven times as long.
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

_EXTENT = 1e4  # of the mesh as it is handed over: libigl ignores faces of less than about 1e-6 square units


class Caster:
    """Casts rays against the triangles `faces` (F, 3) of `positions` (V, 3)."""

    def __init__(self, positions: Array, faces: Array, library: str | None = None) -> None:
        """`library` is one of LIBRARIES; by default the first that is installed. Raises InputError where none is."""
        self._low = positions.min(axis=0).astype(np.float64)
        self._scale = _EXTENT / max(float(np.linalg.norm(np.ptp(positions, axis=0))), 1e-30)
        self._first, self._any = LIBRARIES[library or _installed()](self._placed(positions), faces)

    def first(self, origins: Array, directions: Array) -> Array:
        """The face (N,) that each ray meets first, -1 where it meets none. `origins` (N, 3) are in the units of the
        positions, `directions` (N, 3) unit vectors. Faces are met from both sides."""
        return self._first(self._placed(origins), directions)

    def blocked(self, origins: Array, directions: Array) -> Array:
        """Whether each ray meets a face, bool (N,)."""
        return self._any(self._placed(origins), directions) >= 0

    def _placed(self, points: Array) -> Array:
        """Points in a box of about _EXTENT from the origin, so that neither library's tolerances matter."""
        return (points - self._low) * self._scale


def _embree(positions: Array, faces: Array) -> tuple[Cast, Cast]:
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, positions.astype(np.float32), np.ascontiguousarray(faces, np.int32))

    def cast(query: str) -> Cast:
        return lambda x, w: scene.run(x.astype(np.float32), w.astype(np.float32), query=query)

    return cast("INTERSECT"), cast("OCCLUDED")


def _libigl(positions: Array, faces: Array) -> tuple[Cast, Cast]:
    import igl

    tree, triangles = igl.AABB(), faces.astype(np.int64)
    tree.init(positions, triangles)

    def cast(x: Array, w: Array) -> Array:
        return np.asarray(tree.intersect_ray_first(positions, triangles, x, w.astype(np.float64))[0])

    return cast, cast


LIBRARIES: dict[str, Callable[[Array, Array], tuple[Cast, Cast]]] = {"embreex": _embree, "igl": _libigl}
"""what can cast rays, by the name of the module, the fastest first"""


def _installed() -> str:
    for name in LIBRARIES:
        if find_spec(name):
            return name
    raise InputError("nothing can cast rays: install the Python package embreex or libigl")
