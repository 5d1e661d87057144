"""Reader of Radiance .hdr files. A pixel has a mantissa for each of its three channels and one shared exponent.

Sources: Ward, "Real pixels", Graphics Gems II, and "Radiance file formats".
"""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, Note
from wgsss.scene.images.colour import EQUAL_ENERGY, from_primaries, from_xyz, transformed
from wgsss.scene.images.files import MAX_SKY_SIDE, check_size
from wgsss.scene.images.runs import decode

Array = npt.NDArray[Any]

_LONGEST_HEADER = 1 << 16  # bytes
_WHITE_EFFICACY = 179.0  # lm/W: Radiance writes XYZ in candela per square metre
_SIZE = re.compile(rb"([-+])([XY]) +(\d{1,9}) +([-+])([XY]) +(\d{1,9}) *")
_POWERS = np.ldexp(1.0, np.arange(256) - 136).astype(np.float32)
_POWERS[0] = 0.0  # black for any mantissa


@dataclass(frozen=True)
class Header:
    """The header of a file."""

    axes: tuple[str, str]
    """directions from line to line, and along a line, such as ("-Y", "+X"); +Y is up, +X is right"""
    shape: tuple[int, int]
    """number of lines, and of pixels in a line"""
    scale: Array
    """(3,): factors of the values of the file"""
    matrix: Array | None
    """(3, 3): matrix from the colours of the file to linear Rec. 709; None for the identity"""
    start: int
    """byte offset of the pixels"""


def read_hdr(path: Path) -> tuple[Array, bool]:
    """Read a Radiance file: float32 (H, W, 3), linear RGB of Rec. 709, and False, since it is never a cube.

    Values are divided by EXPOSURE and COLORCORR; PRIMARIES and XYZ are converted. GAMMA is not applied, and causes a
    warning. Raises InputError without the path.
    """
    with path.open("rb") as file:
        header = _header(file.read(_LONGEST_HEADER), path)
        lines, length = header.shape
        file.seek(header.start)
        data = file.read(lines * (8 * length + 8))  # upper bound: a run of one byte takes two bytes
    rgbe = decode(data, lines, length)
    if header.axes[0][1] == "X":  # lines of the file are columns of the image
        rgbe = rgbe.transpose(1, 0, 2)
    rgbe = rgbe[:: -1 if "+Y" in header.axes else 1, :: -1 if "-X" in header.axes else 1]
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = rgbe[..., :3] * _POWERS[rgbe[..., 3]][..., None]
        pixels *= header.scale.astype(np.float32)
        return (pixels if header.matrix is None else transformed(pixels, header.matrix)), False


def _header(head: bytes, path: Path) -> Header:
    """Parse the header at the beginning of a file. The path is for warnings."""
    damaged = InputError("damaged, or not a Radiance .hdr file")
    if not head.startswith(b"#?"):
        raise damaged
    divisors, primaries, xyz, at = [np.ones(3)], None, False, 0
    while True:
        end = head.find(b"\n", at)
        if end < 0:
            raise damaged
        line, at = head[at:end].rstrip(b"\r"), end + 1
        if not line:
            break
        name, _, value = line.partition(b"=")
        name = name.rstrip()
        if name == b"FORMAT":
            if value.strip() not in (b"32-bit_rle_rgbe", b"32-bit_rle_xyze"):
                raise InputError(f"FORMAT={_text(value)} is not supported")
            xyz = value.strip() == b"32-bit_rle_xyze"
        elif name == b"EXPOSURE":
            divisors.append(_numbers(name, value, 1, above=0.0))
        elif name == b"COLORCORR":
            divisors.append(_numbers(name, value, 3, above=0.0))
        elif name == b"PRIMARIES":
            chromaticities = _numbers(name, value, 8)
            primaries = chromaticities if chromaticities.any() else None  # some programs write zeros
        elif name == b"GAMMA" and (_numbers(name, value, 1, above=0.0) != 1.0).any():
            warnings.warn(f"{path}: GAMMA={_text(value)} is not applied", Note, stacklevel=2)
    with np.errstate(all="ignore"):
        scale = np.prod(1.0 / np.stack([np.broadcast_to(d, 3) for d in divisors]), axis=0)
    if not (np.isfinite(scale).all() and scale.all()):
        raise InputError("the product of EXPOSURE and COLORCORR is out of range")
    end = head.find(b"\n", at)
    size = _SIZE.fullmatch(head[at:end].rstrip(b"\r")) if end >= 0 else None
    if size is None or size[2] == size[5]:
        raise InputError(
            f"damaged: expected the size of the image, not '{_text(head[at : end if end >= 0 else None])}'"
        )
    shape = int(size[3]), int(size[6])
    check_size(*(shape[::-1] if size[2] == b"Y" else shape), MAX_SKY_SIDE)
    if xyz:
        matrix: Array | None = from_xyz(EQUAL_ENERGY) / _WHITE_EFFICACY
    else:
        matrix = None if primaries is None else from_primaries(primaries)
    axes = ((size[1] + size[2]).decode(), (size[4] + size[5]).decode())
    return Header(axes, shape, scale, matrix, end + 1)


def _numbers(name: bytes, value: bytes, count: int, above: float = -math.inf) -> Array:
    """Parse the numbers (count,) of a variable. Raises InputError if they are not finite or not above a bound."""
    try:
        numbers = np.array([float(word) for word in value.split()])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) != count or not np.isfinite(numbers).all() or numbers.min() <= above:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise InputError(f"{_text(name)}={_text(value)} is not {expected}{' above 0' if above == 0.0 else ''}")
    return numbers


def _text(value: bytes) -> str:
    """Format bytes of a file for a message of one line."""
    text = value[:40].decode("ascii", "replace").strip()
    return "".join(c if c.isprintable() else "?" for c in text)
