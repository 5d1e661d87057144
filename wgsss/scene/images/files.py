"""Limits of the size of images, and their check."""

from __future__ import annotations

from wgsss.errors import InputError

MAX_SIDE = 8192
"""longest side of a texture, in texels, that every WebGPU device supports"""
MAX_SKY_SIDE = 16384
"""longest side of a sky, in pixels; skies are averaged before they become textures"""


def check_size(width: int, height: int, most: int = MAX_SIDE) -> None:
    """Raise InputError if an image has no pixels, or more than `most` on a side."""
    if width < 1 or height < 1:
        raise InputError("the image is empty")
    if max(width, height) > most:
        raise InputError(f"the image has {width} x {height} pixels; at most {most} on a side are possible")
