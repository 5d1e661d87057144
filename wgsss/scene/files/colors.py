"""Conversion of the vertex colours of files to linear colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def linear(display: Array) -> Array:
    """Convert sRGB colours to linear colours, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(display <= 0.04045, display / 12.92, ((np.maximum(display, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_colors(colors: Array, srgb: bool, notes: list[str]) -> Array:
    """Convert vertex colours (V, 3) of a file to linear colours, clipped to 0 to 1.

    `srgb` says whether the file's colours are sRGB or linear. Colours that are not finite become white. If a colour is
    above 2, all are read as sRGB from 0 to 255. A note is added for each of these changes.
    """
    if (colors > 2).any():
        notes.append("vertex colours exceed 1 and are read as 0 to 255")
        colors, srgb = colors / 255.0, True
    finite = np.isfinite(colors).all(axis=1, keepdims=True)
    within = np.clip(np.where(finite, colors, 1.0), 0.0, 1.0)
    changed = np.count_nonzero((within != colors).any(axis=1))
    if changed:
        notes.append(f"{changed} vertex colours are outside 0 to 1: they are clipped, or white if not finite")
    return linear(within) if srgb else within
