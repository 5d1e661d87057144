"""Folders to write to: all files of one appear at once or not at all, and what was made for nothing goes again."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wgsss.errors import InputError


@contextmanager
def appearing(folder: Path) -> Iterator[Path]:
    """A folder to write to, whose files move to `folder` when the block ends and vanish if it fails.

    What else is in `folder` stays. Raises InputError where it cannot be written: before the block, where that shows.
    """
    target = _resolved(folder)
    with _told(folder):
        if target.exists() and not target.is_dir():
            raise InputError(f"{folder}: this is not a folder")
        if not target.parent.is_dir():
            raise InputError(f"{folder}: there is no folder '{target.parent}'")
        place = (target if target.is_dir() else target.parent) / f".wgsss-{os.getpid()}"
        try:
            place.mkdir()
            yield place
            _move(place, target)
        finally:
            shutil.rmtree(place, ignore_errors=True)


def _move(place: Path, target: Path) -> None:
    files = list(place.iterdir())
    for file in files:
        if (target / file.name).is_dir():
            raise InputError(f"{target / file.name}: this is a folder, in the place of a file")
    if files and not target.exists():
        place.rename(target)
    else:
        for file in files:
            os.replace(file, target / file.name)


@contextmanager
def made(folder: Path) -> Iterator[None]:
    """Make a folder and those above it; those that were made and hold nothing when the block ends go again.

    Raises InputError where that cannot be.
    """
    target = _resolved(folder)
    missing: list[Path] = []
    try:
        with _told(folder):
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
def _told(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None


def _resolved(folder: Path) -> Path:
    try:
        return folder.resolve()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    except (RuntimeError, ValueError):  # a circle of links, a NUL
        raise InputError(f"{str(folder)!r} is not the name of a folder") from None
