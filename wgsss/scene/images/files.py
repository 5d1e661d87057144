"""What every reader of images asks first: whether the image is of a size to use."""

from __future__ import annotations

from wgsss.errors import InputError

MAX_SIDE = 8192
"""texels: the longest side of a texture that every WebGPU device has"""
MAX_SKY_SIDE = 16384
"""pixels: the longest side of a sky, which is averaged before it becomes a texture"""


def check_size(width: int, height: int, most: int = MAX_SIDE) -> None:
    """Raise InputError for an image without pixels, or with more than `most` on a side."""
    if width < 1 or height < 1:
        raise InputError("the image is empty")
    if max(width, height) > most:
        raise InputError(f"the image has {width} x {height} pixels; at most {most} on a side are possible")
