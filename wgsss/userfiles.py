"""Checks on files that users name, made before anything reads them."""

from __future__ import annotations

import stat
from pathlib import Path

from wgsss.errors import InputError

MOST_BYTES = 1 << 32
"""Largest size of an input file in bytes. A sparse file may claim any size."""
MOST_TEXT = 1 << 26
"""Largest size of a text file in bytes."""


def require_file(path: Path, *, most_bytes: int = MOST_BYTES, may_be_empty: bool = False) -> None:
    """Raise InputError unless the path is a regular file that can be read and is not empty.

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
    """Read a UTF-8 text file. A byte order mark at its beginning is skipped.

    `kind` names the expected kind of file in errors. Raises InputError if the file cannot be read or is not UTF-8.
    """
    require_file(path, most_bytes=MOST_TEXT)
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not {kind}: it is not UTF-8 text") from None


def path_from(text: str, folder: Path) -> Path:
    """Resolve a path relative to a folder. ~ and ~USER stand for home folders.

    Raises InputError if the text is empty, or if the user does not exist.
    """
    if not text.strip():
        raise InputError("the name of the file is empty")
    try:
        return folder / Path(text).expanduser()
    except RuntimeError:
        raise InputError(f"{text}: there is no such home folder") from None
