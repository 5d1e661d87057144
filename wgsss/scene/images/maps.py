"""Readers of textures: with 8 bits per channel, and grey levels at the depth of the file."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, Note
from wgsss.scene.images.pixels import message_prefix, read_pixels

Array = npt.NDArray[Any]

_LUMA = (19595, 38470, 7471)  # weights of ITU-R BT.601, in units of 2^-16, as in Pillow


def read_map(source: str | Path | bytes, mode: str, *, linear: bool = False) -> npt.NDArray[np.uint8]:
    """Read a texture with 8 bits per channel from an image file of any bit depth, or from its encoded bytes.

    Values outside 0 to 1 are clamped, with a warning.

    Args:
        mode: "RGB" for (H, W, 3); "RGBA" for (H, W, 4); "L" for grey or luminance, (H, W); "A" for alpha, (H, W), which
            is 255 if the image has none.
        linear: whether the map holds data (normals, thickness, a factor) instead of colours. Floating-point images hold
            linear values: colours are encoded as sRGB, and data are kept.

    Raises:
        InputError: as `read_pixels`, and for numbers that are not finite.
    """
    pixels = read_pixels(source)
    if pixels.dtype == np.float32:
        pixels = _finite(pixels, message_prefix(source))
        if not linear:
            colours = pixels.shape[2] - (pixels.shape[2] in (2, 4))
            pixels[..., :colours] = _srgb(pixels[..., :colours])
    return _eight_bits(_channels(pixels, mode))


def read_levels(source: str | Path | bytes) -> npt.NDArray[Any]:
    """Read a map of linear grey levels (H, W): uint8 from an image of 8 bits, uint16 from one of more.

    Values outside 0 to 1 are clamped, with a warning. Errors are those of `read_map`.
    """
    pixels = read_pixels(source)
    if pixels.dtype == np.float32:
        pixels = np.round(_finite(pixels, message_prefix(source)) * 65535.0).astype(np.uint16)
    return np.ascontiguousarray(_channels(pixels, "L"))


def _finite(pixels: Array, prefix: str) -> Array:
    """Check that pixels are finite, and clamp them to 0 to 1, with a warning if this changes them."""
    bad = int((~np.isfinite(pixels)).any(axis=2).sum())
    if bad:
        raise InputError(f"{prefix}{bad} pixels are not finite numbers")
    outside = int(((pixels < 0.0) | (pixels > 1.0)).any(axis=2).sum())
    if outside:
        warnings.warn(f"{prefix}{outside} pixels outside 0 to 1 are clamped", Note, stacklevel=3)
    return np.clip(pixels, 0.0, 1.0)


def _srgb(linear: Array) -> Array:
    """Encode linear values 0 to 1 as sRGB (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def _channels(pixels: Array, mode: str) -> Array:
    """Return the channels of a mode, at the bit depth of the image."""
    channels = pixels.shape[2]
    colours = pixels[..., :1] if channels < 3 else pixels[..., :3]
    full = 1.0 if pixels.dtype == np.float32 else np.iinfo(pixels.dtype).max
    alpha = pixels[..., -1] if channels in (2, 4) else np.full(pixels.shape[:2], full, pixels.dtype)
    if mode == "A":
        return alpha
    if mode == "L":
        return _luma(colours)
    colours = np.broadcast_to(colours, (*pixels.shape[:2], 3))
    if mode == "RGB":
        return colours
    if mode == "RGBA":
        return np.dstack([colours, alpha])
    raise ValueError(f"a texture is read as RGB, RGBA, L or A, not {mode!r}")


def _luma(colours: Array) -> Array:
    """Compute grey (H, W) from one or three channels, at the bit depth of the image."""
    if colours.shape[2] == 1:
        return colours[..., 0]
    if colours.dtype == np.float32:
        weighted = [c * np.float32(w / 65536) for c, w in zip(np.moveaxis(colours, 2, 0), _LUMA, strict=True)]
        return sum(weighted[1:], weighted[0])
    total = np.full(colours.shape[:2], 0x8000, np.uint32)
    for i, weight in enumerate(_LUMA):
        total += colours[..., i].astype(np.uint32) * np.uint32(weight)
    return (total >> 16).astype(colours.dtype)


def _eight_bits(pixels: Array) -> npt.NDArray[np.uint8]:
    """Round to 8 bits. The result is a new array."""
    if pixels.dtype == np.uint16:
        pixels = (pixels.astype(np.uint32) + 128) // 257
    elif pixels.dtype == np.float32:
        pixels = pixels * 255.0 + 0.5
    return np.ascontiguousarray(pixels).astype(np.uint8)
