"""Meshes with fewer faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.repair import weld

Array = npt.NDArray[Any]


def simplified(positions: Array, faces: Array, most: int) -> tuple[Array, Array]:
    """float32 (V, 3) and int64 (F, 3): a surface near the one given, of about `most` faces.

    Edges are collapsed by quadric errors (Garland & Heckbert 1997), as the library fast-simplification has them.
    """
    from fast_simplification import simplify

    welded, index = weld(positions)
    found, kept = simplify(welded, index[faces].astype(np.int32), target_count=most)
    return np.asarray(found, np.float32), np.asarray(kept, np.int64)
