"""Files that users name: whether they can be read at all, before anything opens them."""

from __future__ import annotations

import stat
from pathlib import Path

from wgsss.errors import InputError

MOST_BYTES = 1 << 32
"""of a file; a sparse one may claim any size"""
MOST_TEXT = 1 << 26
"""bytes of a file of text"""


def require_file(path: Path, *, most_bytes: int = MOST_BYTES, may_be_empty: bool = False) -> None:
    """Raise InputError unless there is a regular file there that can be read and is not empty.

    Folders, devices, pipes and sockets are refused before they are opened: reading one may never end.
    """
    try:
        status = path.stat()
        kind = stat.S_IFMT(status.st_mode)
        if kind == stat.S_IFREG:
            path.open("rb").close()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError:  # a NUL
        raise InputError(f"{str(path)!r} is not the name of a file") from None
    if kind != stat.S_IFREG:
        raise InputError(f"{path}: this is {'a folder' if kind == stat.S_IFDIR else 'not a regular file'}")
    if status.st_size > most_bytes:
        raise InputError(f"{path}: {status.st_size} bytes are too many ({most_bytes} at most)")
    if status.st_size == 0 and not may_be_empty:
        raise InputError(f"{path}: the file is empty")


def read_text(path: Path, kind: str) -> str:
    """The text of a UTF-8 file, without the mark at its beginning that some editors write.

    `kind` names what the file should be. Raises InputError where it cannot be read or is no such text.
    """
    require_file(path, most_bytes=MOST_TEXT)
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not {kind}: it is not UTF-8 text") from None


def path_from(text: str, folder: Path) -> Path:
    """The path that a text names, relative to a folder, ~ and ~USER being home folders.

    Raises InputError where there is no such user, and where the text is empty.
    """
    if not text.strip():
        raise InputError("the name of the file is empty")
    try:
        return folder / Path(text).expanduser()
    except RuntimeError:
        raise InputError(f"{text}: there is no such home folder") from None
