"""Simplification of meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.repair import weld

Array = npt.NDArray[Any]


def simplified(positions: Array, faces: Array, most: int) -> tuple[Array, Array]:
    """Simplify a mesh to about `most` faces. Returns positions float32 (V, 3) and faces int64 (F, 3).

    Edges are collapsed in the order of their quadric error (Garland & Heckbert 1997), by the library
    fast-simplification.
    """
    from fast_simplification import simplify

    welded, index = weld(positions)
    vertices, triangles = simplify(welded, index[faces].astype(np.int32), target_count=most)
    return np.asarray(vertices, np.float32), np.asarray(triangles, np.int64)
