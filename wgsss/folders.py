"""Output folders: all files of a folder appear at once or not at all, and no empty folder is left behind."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wgsss.errors import InputError


@contextmanager
def atomic_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder whose files move to `folder` when the block ends, and are deleted if it fails.

    Other files in `folder` stay. Raises InputError if `folder` cannot be written, before the block runs if possible.
    """
    target = _resolved(folder)
    with naming_path(folder):
        if target.exists() and not target.is_dir():
            raise InputError(f"{folder}: this is not a folder")
        if not target.parent.is_dir():
            raise InputError(f"{folder}: there is no folder '{target.parent}'")
        temporary = (target if target.is_dir() else target.parent) / f".wgsss-{os.getpid()}"
        try:
            temporary.mkdir()
            yield temporary
            _move_files(temporary, target)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def _move_files(source: Path, target: Path) -> None:
    files = list(source.iterdir())
    for file in files:
        if (target / file.name).is_dir():
            raise InputError(f"{target / file.name}: this is a folder, in the place of a file")
    if files and not target.exists():
        source.rename(target)
    else:
        for file in files:
            os.replace(file, target / file.name)


@contextmanager
def created_folder(folder: Path) -> Iterator[None]:
    """Create a folder and its parents for the block. At its end, delete those that it created and that are empty.

    Raises InputError if the folder cannot be created.
    """
    target = _resolved(folder)
    missing: list[Path] = []
    try:
        with naming_path(folder):
            if target.exists() and not target.is_dir():
                raise InputError(f"{folder}: this is not a folder")
            missing += (path for path in (target, *target.parents) if not path.exists())
            target.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()


@contextmanager
def naming_path(path: Path) -> Iterator[None]:
    """Turn an OSError in the block into an InputError that names a file or folder."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def _resolved(folder: Path) -> Path:
    try:
        return folder.resolve()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    except (RuntimeError, ValueError):  # a circle of links, a NUL
        raise InputError(f"{str(folder)!r} is not the name of a folder") from None
