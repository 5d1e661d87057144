"""Reading image files: radiance from .hdr and .exr, maps from 8-bit formats."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]


def read_radiance(path: str | Path) -> npt.NDArray[np.float32]:
    """float32 (H, W, 3), linear RGB and not negative, from a Radiance .hdr or an OpenEXR .exr file.

    Raises InputError for a file that is missing, damaged, of another kind, or holds a number that is not finite.
    """
    path = Path(path)
    readers = {".hdr": _read_hdr, ".exr": _read_exr}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: an environment image must be a .hdr or .exr file")
    require_file(path)
    try:
        pixels = reader(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or 'input/output error'})") from None
    bad = int((~np.isfinite(pixels)).any(axis=2).sum())
    if bad:
        raise InputError(f"{path}: {bad} pixels are not finite numbers")
    # Resampling filters with negative lobes leave negative radiance, which no light has.
    clamped: npt.NDArray[np.float32] = np.maximum(pixels, 0.0, dtype=np.float32)
    return clamped


def read_map(path: str | Path, mode: str) -> npt.NDArray[np.uint8]:
    """uint8 (H, W, 3) for mode "RGB", (H, W) for mode "L", from any 8-bit image file.

    Raises InputError for a file that is missing, damaged or no image.
    """
    from PIL import Image

    path = Path(path)
    require_file(path)
    try:
        with Image.open(path) as image:
            return np.array(image.convert(mode))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise InputError(f"{path}: damaged, or not an image") from None


def require_file(path: Path) -> None:
    """Raise InputError unless there is a file there that is not empty."""
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', error)})") from None
    if empty:
        raise InputError(f"{path}: the file is empty")


def _read_exr(path: Path) -> Array:
    import OpenEXR

    try:
        with _quiet(), OpenEXR.File(str(path)) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # the binding raises RuntimeError, ValueError and TypeError alike
        raise InputError("damaged, or not an OpenEXR file") from error
    for name in ("RGB", "RGBA"):
        if name in channels:
            return np.asarray(channels[name][..., :3], np.float32)
    try:
        planes = [channels[name] for name in ("RGB" if "R" in channels else "YYY")]
    except KeyError:
        raise InputError(f"no R, G and B channels (it has {', '.join(channels) or 'none'})") from None
    return np.stack(planes, axis=-1).astype(np.float32)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence the OpenEXR library, which reports damage on both standard streams, below Python, before it raises."""
    saved, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)


def _read_hdr(path: Path) -> Array:
    """Radiance RGBE (Ward, Graphics Gems II): a mantissa per channel and one exponent, run-length encoded by line."""
    data = path.read_bytes()
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise InputError("damaged, or not a Radiance .hdr file")
    head, _, rest = data.partition(b"\n\n")
    size = re.match(rb"([-+])Y (\d{1,6}) ([-+])X (\d{1,6})\n", rest)
    if size is None:
        raise InputError("damaged, or of an orientation that is not supported")
    if b"xyze" in head:
        raise InputError("holds XYZ colours, which are not supported")
    height, width = int(size[2]), int(size[4])
    if not height or not width:
        raise InputError("the image is empty")
    rgbe = _decode_rgbe(rest[size.end() :], height, width)
    exposure = np.prod([float(value) for value in re.findall(rb"^EXPOSURE= *([-+.\deE]+)", head, re.MULTILINE)])
    scale = np.ldexp(1.0 / exposure, rgbe[..., 3:].astype(np.int32) - 136)
    pixels = np.where(rgbe[..., 3:] > 0, rgbe[..., :3] * scale, 0.0)
    return pixels[:: -1 if size[1] == b"+" else 1, :: -1 if size[3] == b"-" else 1].astype(np.float32)


def _decode_rgbe(data: bytes, height: int, width: int) -> Array:
    if not (8 <= width < 32768 and data[:2] == b"\2\2" and data[2:3] < b"\x80"):
        if len(data) < 4 * width * height:
            raise InputError("truncated, or in the old run-length encoding, which is not supported")
        return np.frombuffer(data, np.uint8, 4 * width * height).reshape(height, width, 4)
    planes = np.empty((height, 4, width), np.uint8)
    at = 0
    try:
        for row in range(height):
            if data[at : at + 4] != b"\2\2" + width.to_bytes(2, "big"):
                raise IndexError
            at += 4
            line = bytearray()
            while len(line) < 4 * width:
                count = data[at]
                if count > 128:
                    line += data[at + 1 : at + 2] * (count - 128)
                    at += 2
                else:
                    line += data[at + 1 : at + 1 + count]
                    at += 1 + count
                if not count or at > len(data):
                    raise IndexError
            planes[row] = np.frombuffer(line, np.uint8).reshape(4, width)
    except (IndexError, ValueError):
        raise InputError(f"damaged or truncated in row {row} of {height}") from None
    return planes.transpose(0, 2, 1)
