"""What every reader of files asks first: whether there is a regular file, and whether its image is of a size to use."""

from __future__ import annotations

import stat
from pathlib import Path

from wgsss.errors import InputError

MAX_SIDE = 8192
"""texels: the longest side of a texture that every WebGPU device has"""


def require_file(path: Path) -> None:
    """Raise InputError unless there is a regular file that can be read and is not empty.

    Devices and pipes are refused before they are opened: reading one may never end.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
            raise InputError(f"{path}: this is {kind}")
        with path.open("rb") as file:
            empty = not file.read(1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if empty:
        raise InputError(f"{path}: the file is empty")


def check_size(width: int, height: int) -> None:
    """Raise InputError for an image without pixels, or with more than MAX_SIDE on a side."""
    if width < 1 or height < 1:
        raise InputError("the image is empty")
    if max(width, height) > MAX_SIDE:
        raise InputError(f"the image has {width} x {height} pixels; at most {MAX_SIDE} on a side are possible")
