"""Reader of OpenEXR files. It chooses the channels of a picture, crops to the display window and converts colours."""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.images.colour import REC709, from_primaries, from_xyz, luminance_weights, transformed
from wgsss.scene.images.files import MAX_SIDE, MAX_SKY_SIDE, check_size

Array = npt.NDArray[Any]

_MOST_BYTES = 4 << 30  # limit for all channels of a file, which are decoded together
# Names of the channels of each kind of picture. The first kind whose channels all exist is used.
_KINDS = (("R", "G", "B"), ("r", "g", "b"), ("Y", "RY", "BY"), ("X", "Y", "Z"), ("Y",))
# Names of layers, in lower case, that are preferred if a file has several pictures, most likely first.
_PICTURES = ("", "rgba", "rgb", "combined", "composite", "beauty", "image", "color", "colour", "main", "c")


@dataclass(frozen=True)
class _Part:
    """The header of one part (image) of a file."""

    name: str
    header: dict[str, Any]
    channels: list[str]

    def window(self, name: str) -> tuple[int, int, int, int]:
        """Return left, top, right and bottom of a window; right and bottom are exclusive."""
        if name not in self.header:
            raise InputError(f"damaged: it has no {name}")
        (left, top), (right, bottom) = self.header[name]
        return int(left), int(top), int(right) + 1, int(bottom) + 1

    @property
    def deep(self) -> bool:
        """Whether the pixels are lists of samples at several depths."""
        return str(self.header.get("type")).startswith("Storage.deep")

    def check(self) -> None:
        """Raise InputError if a window or tile is too large or empty."""
        for name in ("displayWindow", "dataWindow"):
            left, top, right, bottom = self.window(name)
            check_size(right - left, bottom - top, MAX_SKY_SIDE)
        tiles = self.header.get("tiles")
        if tiles is not None and max(tiles.xSize, tiles.ySize) > MAX_SIDE:
            raise InputError(f"its tiles have {tiles.xSize} x {tiles.ySize} pixels; at most {MAX_SIDE} are possible")

    @property
    def nbytes(self) -> int:
        """Upper bound of the size of all channels in bytes."""
        left, top, right, bottom = self.window("dataWindow")
        return 4 * (right - left) * (bottom - top) * len(self.channels)


@dataclass(frozen=True)
class _Picture:
    """The channels of one part that form a picture."""

    part: int
    layer: str
    """text before the last dot in the names of the channels"""
    kind: tuple[str, ...]
    """one of _KINDS"""

    @property
    def channels(self) -> list[str]:
        return [f"{self.layer}.{name}" if self.layer else name for name in self.kind]


def read_exr(path: Path) -> tuple[Array, bool]:
    """Read an OpenEXR file: float32 (H, W, 3), linear RGB of Rec. 709, and whether it is a cube of six faces.

    The result covers the display window and is black outside the data window. Raises InputError without the path.
    """
    import OpenEXR

    with _opened(path, header_only=True) as file:
        parts = [
            _Part(part.name(), dict(part.header), [channel.name for channel in part.header["channels"]])
            for part in file.parts
        ]
    for part in parts:
        part.check()
    if sum(part.nbytes for part in parts) > _MOST_BYTES:
        raise InputError(f"its channels take more than {_MOST_BYTES >> 30} GiB")
    picture = _choose_picture(parts)
    with _opened(path, header_only=False) as file:
        channels = file.channels(picture.part)
        planes = [np.asarray(channels[name].pixels) for name in picture.channels]
    part = parts[picture.part]
    pixels = _to_display_window(_colours(picture.kind, planes, part.header), part)
    return pixels, part.header.get("envmap") == OpenEXR.ENVMAP_CUBE


@contextlib.contextmanager
def _opened(path: Path, header_only: bool) -> Iterator[Any]:
    import OpenEXR

    try:
        with _quiet(), OpenEXR.File(str(path), separate_channels=True, header_only=header_only) as file:
            yield file
    except InputError:
        raise
    except Exception as error:  # the binding raises RuntimeError, ValueError and TypeError alike
        raise InputError("damaged, or not an OpenEXR file") from error


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence the OpenEXR library, which reports damage on standard output and error, from Python and from C++."""
    saved = {}
    for stream in (1, 2):
        with contextlib.suppress(OSError):  # there is no such stream
            saved[stream] = os.dup(stream)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in saved:
            os.dup2(nowhere, stream)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        with contextlib.suppress(TypeError, OSError, AttributeError):  # not on a POSIX system
            ctypes.CDLL(None).fflush(None)  # write what the C library has buffered
        for stream, before in saved.items():
            os.dup2(before, stream)
            os.close(before)
        os.close(nowhere)


def _choose_picture(parts: list[_Part]) -> _Picture:
    """Choose the most likely picture of a file. Raises InputError if there is none, or several equally likely ones."""
    flat = [(i, part) for i, part in enumerate(parts) if not part.deep]
    if not flat:
        raise InputError("deep images, with several samples per pixel, are not supported")
    candidates, names = [], []
    for i, part in flat:
        layers: dict[str, set[str]] = {}
        for channel in part.channels:
            layer, _, name = channel.rpartition(".")
            layers.setdefault(layer, set()).add(name)
            names.append(f"{part.name}: {channel}" if len(parts) > 1 and not channel.startswith(part.name) else channel)
        for layer, has in layers.items():
            kind = next((kind for kind in _KINDS if has.issuperset(kind)), None)
            if kind is not None:
                candidates.append((_rank(layer, part.name), _Picture(i, layer, kind)))
    best = min((rank for rank, _ in candidates), default=0)
    likeliest = [picture for rank, picture in candidates if rank == best]
    listed = ", ".join(names[:12]) + (", …" if len(names) > 12 else "")
    if not likeliest:
        raise InputError(f"no R, G and B channels (it has {listed or 'none'})")
    if len(likeliest) > 1:
        raise InputError(f"it is not clear which of its pictures to read (it has {listed})")
    return likeliest[0]


def _rank(layer: str, part: str) -> int:
    """Rank a layer by its name, or by the name of its part if it has none. Rank 0 is the most likely picture."""
    name = (layer or part).lower().rpartition(".")[2]
    return _PICTURES.index(name) if name in _PICTURES else len(_PICTURES)


def _colours(kind: tuple[str, ...], planes: list[Array], header: dict[str, Any]) -> Array:
    """Convert the channels of a kind of picture to linear RGB of Rec. 709: float32 (H, W, 3)."""
    primaries = header.get("chromaticities", REC709)
    planes = [plane.astype(np.float32) for plane in planes]
    with np.errstate(all="ignore"):  # the caller checks that pixels are finite
        if kind == ("X", "Y", "Z"):
            return transformed(np.stack(planes, axis=-1), from_xyz())
        if kind == ("Y",):
            return np.stack(planes * 3, axis=-1)
        if kind == ("Y", "RY", "BY"):  # (R - Y) / Y and (B - Y) / Y
            Y, RY, BY = planes[0], *(_enlarged(chroma, planes[0].shape) for chroma in planes[1:])
            red, blue = (RY + 1.0) * Y, (BY + 1.0) * Y
            share = luminance_weights(primaries).astype(np.float32)
            rgb = np.stack([red, (Y - share[0] * red - share[2] * blue) / share[1], blue], axis=-1)
        else:
            rgb = np.stack(planes, axis=-1)
        matrix = from_primaries(primaries)
        return rgb if matrix is None else transformed(rgb, matrix)


def _enlarged(plane: Array, shape: tuple[int, ...]) -> Array:
    """Interpolate a chroma plane with values at even rows and columns to the full shape."""
    for axis in (0, 1):
        if plane.shape[axis] < shape[axis]:
            after = np.concatenate([plane, plane.take([-1], axis)], axis).take(range(1, plane.shape[axis] + 1), axis)
            both = np.stack([plane, 0.5 * (plane + after)], axis + 1)
            larger = (*plane.shape[:axis], 2 * plane.shape[axis], *plane.shape[axis + 1 :])
            plane = both.reshape(larger).take(range(shape[axis]), axis)
    return plane


def _to_display_window(pixels: Array, part: _Part) -> Array:
    """Copy pixels of the data window into the display window."""
    left, top, right, bottom = part.window("dataWindow")
    l0, t0, r0, b0 = part.window("displayWindow")
    if (left, top, right, bottom) == (l0, t0, r0, b0):
        return pixels
    window = np.zeros((b0 - t0, r0 - l0, 3), np.float32)
    x0, x1, y0, y1 = max(left, l0), min(right, r0), max(top, t0), min(bottom, b0)
    if x0 < x1 and y0 < y1:
        window[y0 - t0 : y1 - t0, x0 - l0 : x1 - l0] = pixels[y0 - top : y1 - top, x0 - left : x1 - left]
    return window
