"""Textures from image files at the depth that the file has: PNG, JPEG, TIFF, WebP and others that Pillow reads.

Pillow reduces some 16-bit kinds to 8 bits and does not know some others. Those are read in another way: PNG of 16 bits
and several channels by decoding twice, TIFF of more than 8 bits by tifffile through imageio. For the other formats
imageio would hand on what Pillow gives, less the transparency of palettes.
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

# Pillow has readers that start other programs (EPS) and such that take almost any file for theirs (TGA).
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "GIF", "PPM", "JPEG2000", "DDS", "PSD", "WEBP")
_TGA = (".tga", ".icb", ".vda", ".vst")
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# Pillow's names of how the bytes of a PNG are packed: those of 16 bits that it reduces; the mode, and the name by which
# it takes the second bytes.
_LOW_BYTES = {"RGB;16B": ("RGB", "RGB;16L"), "RGBA;16B": ("RGBA", "RGBA;16L"), "LA;16B": ("RGBA", "RGBA")}
_PLAIN = {"1": "L", "La": "LA", "PA": "RGBA", "RGBa": "RGBA", **{m: m for m in ("L", "LA", "RGB", "RGBA", "I", "F")}}
_RADIANCE = (b"#?", b"\x76\x2f\x31\x01")


def read_pixels(source: str | Path | bytes) -> Array:
    """The first image of a file, or of the encoded bytes of one, (H, W, C) at the depth that it has.

    Returns:
        uint8 or uint16, where the largest value of the type stands for 1, or float32. C is 1 for grey, 2 for grey and
        alpha, 3 for RGB, 4 for RGB and alpha; alpha is not multiplied in. EXIF orientation, colour profiles and gamma
        are ignored, as glTF 2.0 wants it.

    Raises:
        InputError: for a file that is missing, damaged, not an image, or larger than MAX_SIDE on a side, which is told
            from its header.
    """
    if not isinstance(source, bytes):
        require_file(Path(source))
    try:
        data = source if isinstance(source, bytes) else Path(source).read_bytes()
        pixels = _decoded(data, tga=not isinstance(source, bytes) and Path(source).suffix.lower() in _TGA)
    except InputError as error:
        raise InputError(f"{named(source)}{error}") from None
    except OSError as error:
        raise InputError(f"{named(source)}cannot be read ({error.strerror or error})") from None
    return _unit_range(pixels, named(source))


def named(source: str | Path | bytes) -> str:
    """The head of a message about a source: its path, or nothing for bytes, which their owner names."""
    return "" if isinstance(source, bytes) else f"{source}: "


def _decoded(data: bytes, tga: bool) -> Array:
    if data.startswith(_RADIANCE):
        raise InputError("a .hdr or .exr image can light a scene, but not be a texture: convert it to PNG or TIFF")
    with _quiet():
        try:
            pixels = _read_tiff(data) if data.startswith(_TIFF) else None
            pixels = _read_with_pillow(data, tga) if pixels is None else pixels
        except InputError:
            raise
        except Exception:  # decoders raise whatever their damaged data makes them stumble over
            raise InputError("damaged, or not an image") from None
    return pixels


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the libraries' own remarks, and without Pillow's limit of size: ours is lower, and tells the size."""
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
        key = image.info.get("transparency")  # of a PNG: the value that is transparent
        if image.mode.startswith("I;16"):
            grey = np.array(image).astype(np.uint16)
            return grey if key is None else np.dstack([grey, _opaque(grey != key)])
        mode = _PLAIN.get(image.mode, "RGB")
        if mode in ("L", "RGB") and image.has_transparency_data:
            mode += "A"
        return np.array(image if image.mode == mode else image.convert(mode))


def _opened(data: bytes, tga: bool) -> Any:
    """A Pillow image of a size that can be used, not decoded yet."""
    from PIL import Image

    image = Image.open(io.BytesIO(data), formats=("TGA", *_FORMATS) if tga else _FORMATS)
    check_size(*image.size)
    return image


def _read_png_16(data: bytes, image: Any, raw: str) -> Array:
    """A PNG of 16 bits and several channels. Pillow keeps the first byte of each number, or as well the second one."""
    mode, low = _LOW_BYTES[raw]
    with _opened(data, tga=False) as again:
        again._mode = mode
        again.tile = [(*again.tile[0][:3], low)]
        second = np.array(again).astype(np.uint16)
    if mode == "RGBA" and raw == "LA;16B":  # all four bytes of grey and alpha
        return second[..., 0::2] << 8 | second[..., 1::2]
    whole = np.array(image).astype(np.uint16) << 8 | second
    key = image.info.get("transparency")  # the colour that is transparent
    return whole if key is None else np.dstack([whole, _opaque((whole != np.array(key)).any(axis=2))])


def _opaque(where: Array) -> Array:
    return np.where(where, 65535, 0).astype(np.uint16)


def _read_tiff(data: bytes) -> Array | None:
    """A TIFF of more than 8 bits; None for others, and for compression that tifffile leaves to other libraries."""
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


def _unit_range(pixels: Array, where: str) -> Array:
    """uint8, uint16 or float32 (H, W, C) from numbers of any type; integers with a sign have no use for it."""
    pixels = pixels if pixels.ndim == 3 else pixels[..., None]
    if pixels.dtype in (np.uint8, np.uint16):
        return pixels
    if pixels.dtype.kind == "f":
        return pixels.astype(np.float32)
    if pixels.dtype.kind == "b":
        return pixels.astype(np.uint8) * 255
    if pixels.min() < 0:
        warnings.warn(f"{where}values below 0 in an image of signed integers count as 0", Note, stacklevel=2)
    if pixels.dtype.itemsize == 4 and pixels.max() <= 65535:  # how 16 bits are kept by those who have no such type
        return np.clip(pixels, 0, 65535).astype(np.uint16)
    largest = np.iinfo(pixels.dtype).max
    return (np.maximum(pixels, 0) * (65535.0 / largest) + 0.5).astype(np.uint16)
