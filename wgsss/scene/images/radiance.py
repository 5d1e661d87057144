"""Readers of radiance from .hdr and .exr files, and of skies, which are radiance over all directions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.images.cube import lat_long_of_cube
from wgsss.scene.images.exr import read_exr
from wgsss.scene.images.hdr import read_hdr
from wgsss.userfiles import require_file

Array = npt.NDArray[Any]

_TOLERANCE = 0.02  # share of the height: some programs lose or add a few rows or columns


def read_radiance(path: str | Path) -> npt.NDArray[np.float32]:
    """Read a Radiance .hdr or OpenEXR .exr file: float32 (H, W, 3), linear RGB of Rec. 709, not negative.

    Raises InputError if the file is missing, damaged, too large or of another format, or if it contains a number that
    is not finite.
    """
    return _read(Path(path))[0]


def read_sky(path: str | Path) -> npt.NDArray[np.float32]:
    """Read a sky: radiance over latitude and longitude, twice as wide as high, or a single pixel.

    An OpenEXR file with the attribute `envmap` for a cube is converted. Raises InputError as `read_radiance`, and if
    the image has another shape.
    """
    path = Path(path)
    pixels, cube = _read(path)
    if cube:
        return lat_long_of_cube(pixels)
    height, width = pixels.shape[:2]
    if (height, width) != (1, 1) and abs(width - 2 * height) > max(1, 2 * _TOLERANCE * height):
        raise InputError(
            f"{path}: {width} x {height} pixels are not a sky: it must be a latitude-longitude image, twice as wide as"
            " high, or an OpenEXR cube with the attribute envmap"
        )
    return pixels


def _read(path: Path) -> tuple[npt.NDArray[np.float32], bool]:
    """Read radiance (H, W, 3), and whether the image is a cube of six faces."""
    if path.suffix.lower() not in (".hdr", ".exr"):
        raise InputError(f"{path}: an environment image must be a .hdr or .exr file")
    require_file(path)
    try:
        with path.open("rb") as file:
            magic = file.read(4)
        by_extension = read_exr if path.suffix.lower() == ".exr" else read_hdr
        reader = read_hdr if magic[:2] == b"#?" else read_exr if magic == b"\x76\x2f\x31\x01" else by_extension
        pixels, cube = reader(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or 'input/output error'})") from None
    except MemoryError:
        raise InputError(f"{path}: there is not enough memory for the image") from None
    bad = int((~np.isfinite(pixels)).any(axis=2).sum())
    if bad:
        raise InputError(f"{path}: {bad} pixels are not finite numbers")
    # Radiance can be negative after resampling with negative lobes, and for colours outside Rec. 709.
    return np.maximum(pixels, 0.0, dtype=np.float32), cube
