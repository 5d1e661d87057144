"""Conversion of cube maps to latitude-longitude images."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]

# For each of the faces +x, -x, +y, -y, +z, -z of the cubes of OpenEXR (ImfEnvmap): the directions in which the column
# and the row increase, each as axis and sign.
_FACES = (
    ((2, 1), (1, -1)),
    ((2, -1), (1, -1)),
    ((0, 1), (2, -1)),
    ((0, 1), (2, 1)),
    ((0, -1), (1, -1)),
    ((0, 1), (1, -1)),
)


def lat_long_of_cube(pixels: Array) -> npt.NDArray[np.float32]:
    """Resample the six faces (6 S, S, 3) of an OpenEXR cube, one below the other, to float32 (2 S, 4 S, 3).

    As in OpenEXR, the first and last texels of a face lie on its edges. The centre of the result is +z of the cube,
    which is -z of the scene. Raises InputError for other shapes.
    """
    height, side = pixels.shape[:2]
    if height != 6 * side:
        raise InputError(f"{side} x {height} pixels are not a cube: it must have six square faces, one below the other")
    faces = pixels.reshape(6, side, side, 3)
    v, u = np.meshgrid(
        (np.arange(2 * side) + 0.5) / (2 * side), (np.arange(4 * side) + 0.5) / (4 * side), indexing="ij"
    )
    longitude = np.pi * (1.0 - 2.0 * u)
    sine = np.sin(np.pi * v)
    d = np.stack([sine * np.sin(longitude), np.cos(np.pi * v), sine * np.cos(longitude)], axis=-1)
    axis = np.abs(d).argmax(axis=-1)
    face = 2 * axis + (np.take_along_axis(d, axis[..., None], -1)[..., 0] < 0.0)
    image = np.empty((2 * side, 4 * side, 3), np.float32)
    for i, (across, down) in enumerate(_FACES):
        here = face == i
        w = d[here]
        depth = np.abs(w[:, i // 2])
        x, y = (np.clip((sign * w[:, k] / depth + 1.0) / 2.0, 0.0, 1.0) * (side - 1) for k, sign in (across, down))
        image[here] = _bilinear(faces[i], x, y)
    return image


def _bilinear(face: Array, x: Array, y: Array) -> Array:
    """Interpolate a face (S, S, 3) at positions x and y (N,), in texels."""
    last = len(face) - 1
    left, top = np.minimum(x.astype(int), max(last - 1, 0)), np.minimum(y.astype(int), max(last - 1, 0))
    right, below = np.minimum(left + 1, last), np.minimum(top + 1, last)
    s, t = (x - left)[:, None], (y - top)[:, None]
    upper = face[top, left] * (1.0 - s) + face[top, right] * s
    lower = face[below, left] * (1.0 - s) + face[below, right] * s
    return upper * (1.0 - t) + lower * t
