"""What every reader of images asks first: whether the image is of a size to use."""

from __future__ import annotations

from wgsss.errors import InputError

MAX_SIDE = 8192
"""texels: the longest side of a texture that every WebGPU device has"""


def check_size(width: int, height: int) -> None:
    """Raise InputError for an image without pixels, or with more than MAX_SIDE on a side."""
    if width < 1 or height < 1:
        raise InputError("the image is empty")
    if max(width, height) > MAX_SIDE:
        raise InputError(f"the image has {width} x {height} pixels; at most {MAX_SIDE} on a side are possible")
