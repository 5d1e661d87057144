"""Profiles of thin media, through which light reaches the far side."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wgsss.errors import InputError

Array = NDArray[np.float64]


def blend(R: ArrayLike, T: ArrayLike, cosine: ArrayLike) -> Array:
    """Return P(r) = (1 - t) R + t T in 1/mm^2, (..., 3), with t = (1 - cosine) / 2.

    `R` and `T` (..., 3): a reflectance and a transmittance profile at the straight distance between the points where
    light enters and leaves, 1/mm^2. `cosine` (...): that of the angle between the normals there, -1 on opposite faces.
    A mesh has no single thickness: take the T of a slab that is as thick as the thin parts of the mesh. Source:
    Mikkelsen 2009, section 3.1, after Donner and Jensen 2005. Raises InputError for a cosine outside -1 to 1.
    """
    cosine = np.asarray(cosine, dtype=np.float64)
    outside = ~(np.abs(cosine) <= 1.0 + 1e-6)  # normals are rounded
    if outside.any():
        raise InputError(f"the cosine between normals must be from -1 to 1, not {cosine[outside].flat[0]}")
    t = 0.5 * (1.0 - np.clip(cosine, -1.0, 1.0))[..., None]
    return (1.0 - t) * np.asarray(R, dtype=np.float64) + t * np.asarray(T, dtype=np.float64)
