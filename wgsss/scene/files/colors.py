"""Vertex colours of files as linear ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def linear(display: Array) -> Array:
    """Linear colours of sRGB ones, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(display <= 0.04045, display / 12.92, ((np.maximum(display, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_colors(colors: Array, srgb: bool, notes: list[str]) -> Array:
    """Linear colours (V, 3) within 0 to 1 of a file's, which are sRGB or linear: white where one is not finite.

    Floating-point colours that are much above 1 are taken to be sRGB from 0 to 255. What is changed is noted.
    """
    if (colors > 2).any():
        notes.append("vertex colours beyond 1 are taken to go from 0 to 255")
        colors, srgb = colors / 255.0, True
    finite = np.isfinite(colors).all(axis=1, keepdims=True)
    within = np.clip(np.where(finite, colors, 1.0), 0.0, 1.0)
    changed = np.count_nonzero((within != colors).any(axis=1))
    if changed:
        notes.append(f"{changed} vertex colours are not within 0 to 1: they are clipped, or white where not finite")
    return linear(within) if srgb else within
