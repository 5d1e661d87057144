"""Thin media, through which light reaches the far side."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError

Array = NDArray[np.float64]


def blend(R: ArrayLike, T: ArrayLike, cosine: ArrayLike) -> Array:
    """P(r) = (1 - t) R + t T with t = (1 - cosine) / 2 (004 section 3.1, after Donner and Jensen 2005), in 1/mm^2.

    `R` and `T` (..., 3): profiles at the straight distance between the points where light enters and leaves; `cosine`
    (...): of the angle between their normals, -1 on opposite faces. A mesh has no thickness to take T for: use that of
    a slab as thick as its thin parts are. Raises InputError for a cosine outside of -1 to 1.
    """
    cosine = np.asarray(cosine, dtype=np.float64)
    outside = ~(np.abs(cosine) <= 1.0 + 1e-6)  # normals are rounded
    if outside.any():
        raise InputError(f"the cosine between normals must be from -1 to 1, not {cosine[outside].flat[0]}")
    t = 0.5 * (1.0 - np.clip(cosine, -1.0, 1.0))[..., None]
    return (1.0 - t) * np.asarray(R, dtype=np.float64) + t * np.asarray(T, dtype=np.float64)
