"""Radiance .hdr files (Ward, "Real pixels", Graphics Gems II; "Radiance file formats"): a mantissa for each channel and
an exponent that they share, flat or run-length encoded in an old and a new way."""

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
from wgsss.scene.images.runs import decoded

Array = npt.NDArray[Any]

_LONGEST_HEAD = 1 << 16  # bytes
_WHITE_EFFICACY = 179.0  # lm/W: Radiance writes XYZ in candela per square metre
_SIZE = re.compile(rb"([-+])([XY]) +(\d{1,9}) +([-+])([XY]) +(\d{1,9}) *")
_POWERS = np.ldexp(1.0, np.arange(256) - 136).astype(np.float32)
_POWERS[0] = 0.0  # black, whatever the mantissa


@dataclass(frozen=True)
class Header:
    """What the head of a file says. Lines of pixels run along the second of the two `axes`."""

    axes: tuple[str, str]
    """"-Y", "+X" and so on, the sign being the way that the axis is gone along; Y points up, X to the right"""
    shape: tuple[int, int]
    """the number of lines, and of pixels in each"""
    scale: Array
    """by which the file's values are multiplied (3,)"""
    matrix: Array | None
    """from the file's colours to linear Rec. 709, (3, 3); None where they are that"""
    start: int
    """of the pixels, bytes from the beginning of the file"""


def read_hdr(path: Path) -> tuple[Array, bool]:
    """float32 (H, W, 3), linear RGB of Rec. 709, and False: such files are no cubes. Errors do not name the path.

    EXPOSURE and COLORCORR are taken out, PRIMARIES and XYZ are converted. GAMMA is told in a warning, and not applied.
    """
    with path.open("rb") as file:
        header = _header(file.read(_LONGEST_HEAD), path)
        lines, length = header.shape
        file.seek(header.start)
        data = file.read(lines * (8 * length + 8))  # at most: a run of one takes two bytes
    rgbe = decoded(data, lines, length)
    if header.axes[0][1] == "X":  # lines are columns
        rgbe = rgbe.transpose(1, 0, 2)
    rgbe = rgbe[:: -1 if "+Y" in header.axes else 1, :: -1 if "-X" in header.axes else 1]
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = rgbe[..., :3] * _POWERS[rgbe[..., 3]][..., None]
        pixels *= header.scale.astype(np.float32)
        return (pixels if header.matrix is None else transformed(pixels, header.matrix)), False


def _header(head: bytes, path: Path) -> Header:
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
            found = _numbers(name, value, 8)
            primaries = found if found.any() else None  # some writers fill it with zeros
        elif name == b"GAMMA" and (_numbers(name, value, 1, above=0.0) != 1.0).any():
            warnings.warn(f"{path}: GAMMA={_text(value)} is not applied", Note, stacklevel=2)
    with np.errstate(all="ignore"):
        scale = np.prod(1.0 / np.stack([np.broadcast_to(d, 3) for d in divisors]), axis=0)
    if not (np.isfinite(scale).all() and scale.all()):
        raise InputError("EXPOSURE and COLORCORR, all multiplied, are beyond what numbers hold")
    end = head.find(b"\n", at)
    size = _SIZE.fullmatch(head[at:end].rstrip(b"\r")) if end >= 0 else None
    if size is None or size[2] == size[5]:
        raise InputError(f"damaged: its size should come next, not '{_text(head[at : end if end >= 0 else None])}'")
    shape = int(size[3]), int(size[6])
    check_size(*(shape[::-1] if size[2] == b"Y" else shape), MAX_SKY_SIDE)
    if xyz:
        matrix: Array | None = from_xyz(EQUAL_ENERGY) / _WHITE_EFFICACY
    else:
        matrix = None if primaries is None else from_primaries(primaries)
    axes = ((size[1] + size[2]).decode(), (size[4] + size[5]).decode())
    return Header(axes, shape, scale, matrix, end + 1)


def _numbers(name: bytes, value: bytes, count: int, above: float = -math.inf) -> Array:
    try:
        found = np.array([float(word) for word in value.split()])
    except ValueError:
        found = np.empty(0)
    if len(found) != count or not np.isfinite(found).all() or found.min() <= above:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise InputError(f"{_text(name)}={_text(value)} is not {wanted}{' above 0' if above == 0.0 else ''}")
    return found


def _text(value: bytes) -> str:
    """Bytes of a file, fit for a message of one line."""
    text = value[:40].decode("ascii", "replace").strip()
    return "".join(c if c.isprintable() else "?" for c in text)
