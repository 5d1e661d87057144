"""Reader of image files at their full bit depth: PNG, JPEG, TIFF, WebP and others that Pillow reads.

Pillow reduces some 16-bit images to 8 bits and cannot read others. Therefore, PNG files of 16 bits and several channels
are decoded twice, and TIFF files of more than 8 bits are read by tifffile through imageio.
"""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, Note
from wgsss.scene.images.files import check_size
from wgsss.userfiles import require_file

Array = npt.NDArray[Any]

# Some readers of Pillow start other programs (EPS) or accept almost any file (TGA).
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "GIF", "PPM", "JPEG2000", "DDS", "PSD", "WEBP")
_TGA = (".tga", ".icb", ".vda", ".vst")
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# Pillow's names of the 16-bit layouts of PNG files that it reduces to 8 bits, with the mode and the name of the layout
# that decode the low bytes.
_LOW_BYTES = {"RGB;16B": ("RGB", "RGB;16L"), "RGBA;16B": ("RGBA", "RGBA;16L"), "LA;16B": ("RGBA", "RGBA")}
_PLAIN = {"1": "L", "La": "LA", "PA": "RGBA", "RGBa": "RGBA", **{m: m for m in ("L", "LA", "RGB", "RGBA", "I", "F")}}
_RADIANCE = (b"#?", b"\x76\x2f\x31\x01")


def read_pixels(source: str | Path | bytes) -> Array:
    """Read the first image of a file, or of its encoded bytes, at its bit depth.

    Returns:
        (H, W, C) of type uint8 or uint16, where the largest value of the type means 1, or float32. C is 1 for grey, 2
        for grey and alpha, 3 for RGB, 4 for RGB and alpha; colours are not multiplied by alpha. EXIF orientation,
        colour profiles and gamma are ignored, as glTF 2.0 requires.

    Raises:
        InputError: if the file is missing, damaged or not an image, or has more than MAX_SIDE pixels on a side, which
            is checked before decoding.
    """
    if not isinstance(source, bytes):
        require_file(Path(source))
    try:
        data = source if isinstance(source, bytes) else Path(source).read_bytes()
        pixels = _decoded(data, tga=not isinstance(source, bytes) and Path(source).suffix.lower() in _TGA)
    except InputError as error:
        raise InputError(f"{message_prefix(source)}{error}") from None
    except OSError as error:
        raise InputError(f"{message_prefix(source)}cannot be read ({error.strerror or error})") from None
    return _unit_range(pixels, message_prefix(source))


def message_prefix(source: str | Path | bytes) -> str:
    """Return the beginning of messages about a source: its path, or "" for bytes, which the caller names."""
    return "" if isinstance(source, bytes) else f"{source}: "


def _decoded(data: bytes, tga: bool) -> Array:
    if data.startswith(_RADIANCE):
        raise InputError("a .hdr or .exr image can light a scene, but cannot be a texture: convert it to PNG or TIFF")
    with _quiet():
        try:
            pixels = _read_tiff(data) if data.startswith(_TIFF) else None
            pixels = _read_with_pillow(data, tga) if pixels is None else pixels
        except InputError:
            raise
        except Exception:  # decoders raise any exception for damaged data
            raise InputError("damaged, or not an image") from None
    return pixels


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress messages of the libraries and the size limit of Pillow. `check_size` has a lower limit."""
    from PIL import Image

    log = logging.getLogger("tifffile")
    limit, disabled = Image.MAX_IMAGE_PIXELS, log.disabled
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        Image.MAX_IMAGE_PIXELS, log.disabled = None, True
        try:
            yield
        finally:
            Image.MAX_IMAGE_PIXELS, log.disabled = limit, disabled


def _read_with_pillow(data: bytes, tga: bool) -> Array:
    with _opened(data, tga) as image:
        raw = image.tile[0].args if image.format == "PNG" and image.tile else ""
        if isinstance(raw, str) and raw in _LOW_BYTES:
            return _read_png_16(data, image, raw)
        key = image.info.get("transparency")  # the transparent value of a PNG
        if image.mode.startswith("I;16"):
            grey = np.array(image).astype(np.uint16)
            return grey if key is None else np.dstack([grey, _opaque(grey != key)])
        mode = _PLAIN.get(image.mode, "RGB")
        if mode in ("L", "RGB") and image.has_transparency_data:
            mode += "A"
        return np.array(image if image.mode == mode else image.convert(mode))


def _opened(data: bytes, tga: bool) -> Any:
    """Open a Pillow image and check its size, without decoding it."""
    from PIL import Image

    image = Image.open(io.BytesIO(data), formats=("TGA", *_FORMATS) if tga else _FORMATS)
    check_size(*image.size)
    return image


def _read_png_16(data: bytes, image: Any, raw: str) -> Array:
    """Read a PNG of 16 bits and several channels: first the high bytes with Pillow, then the low bytes."""
    mode, low = _LOW_BYTES[raw]
    with _opened(data, tga=False) as again:
        again._mode = mode
        again.tile = [(*again.tile[0][:3], low)]
        low_bytes = np.array(again).astype(np.uint16)
    if mode == "RGBA" and raw == "LA;16B":  # the four bytes of grey and alpha
        return low_bytes[..., 0::2] << 8 | low_bytes[..., 1::2]
    whole = np.array(image).astype(np.uint16) << 8 | low_bytes
    key = image.info.get("transparency")  # the transparent colour
    return whole if key is None else np.dstack([whole, _opaque((whole != np.array(key)).any(axis=2))])


def _opaque(mask: Array) -> Array:
    """Return 16-bit alpha: opaque where the mask is set, else transparent."""
    return np.where(mask, 65535, 0).astype(np.uint16)


def _read_tiff(data: bytes) -> Array | None:
    """Read a TIFF of more than 8 bits. Return None for others, and if tifffile cannot decode it alone."""
    import imageio.v3 as iio

    try:
        with iio.imopen(io.BytesIO(data), "r", plugin="tifffile") as opened:
            file: Any = opened
            tags = file.metadata(index=0, page=0)
            check_size(tags["ImageWidth"], tags["ImageLength"])
            bits = tags.get("BitsPerSample", 1)
            if max(bits if isinstance(bits, tuple) else (bits,)) <= 8:
                return None
            pixels = file.read(index=0, page=0)
    except InputError:
        raise
    except Exception:
        return None
    if pixels.ndim == 3 and tags.get("PlanarConfiguration") == 2:
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.ndim > 3 or pixels.shape[:2] != (tags["ImageLength"], tags["ImageWidth"]):
        return None
    if tags.get("PhotometricInterpretation") == 0 and pixels.dtype == np.uint16:  # white is zero
        pixels = 65535 - pixels
    colours = 1 if tags.get("PhotometricInterpretation") in (0, 1) else 3
    alpha = tags.get("ExtraSamples") or ()
    has_alpha = next(iter(alpha if isinstance(alpha, tuple) else (alpha,)), 0) in (1, 2)
    return pixels.reshape(*pixels.shape[:2], -1)[..., : colours + has_alpha]


def _unit_range(pixels: Array, prefix: str) -> Array:
    """Convert pixels of any type to uint8, uint16 or float32 (H, W, C). Negative integers become 0, with a warning."""
    pixels = pixels if pixels.ndim == 3 else pixels[..., None]
    if pixels.dtype in (np.uint8, np.uint16):
        return pixels
    if pixels.dtype.kind == "f":
        return pixels.astype(np.float32)
    if pixels.dtype.kind == "b":
        return pixels.astype(np.uint8) * 255
    if pixels.min() < 0:
        warnings.warn(f"{prefix}values below 0 in an image of signed integers become 0", Note, stacklevel=2)
    if pixels.dtype.itemsize == 4 and pixels.max() <= 65535:  # 16-bit values that are stored as 32 bits
        return np.clip(pixels, 0, 65535).astype(np.uint16)
    largest = np.iinfo(pixels.dtype).max
    return (np.maximum(pixels, 0) * (65535.0 / largest) + 0.5).astype(np.uint16)
