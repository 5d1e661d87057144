"""Search for the files that a file refers to, in the spellings of programs on other systems."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from urllib.parse import unquote


def locate(name: str, folder: Path) -> Path | None:
    """Find the regular file that a name refers to, relative to a folder. Return None if there is none.

    The function tries in turn: the name as it is, percent-decoded, with slashes for backslashes, and its last part in
    the folder itself. If none of these exists, it tries them again and ignores the case of letters.
    """
    spellings = list(dict.fromkeys(_spellings(name)))
    for find in (_as_written, _in_other_case):
        for spelling in spellings:
            try:
                file = find(folder, spelling)
            except (OSError, ValueError):  # the name is too long or contains a NUL, or a folder cannot be read
                continue
            if file is not None:
                return file
    return None


def _spellings(name: str) -> Iterator[str]:
    for whole in (name, name.replace("\\", "/")):
        yield from (whole, unquote(whole))
    for whole in (name.replace("\\", "/"), unquote(name).replace("\\", "/")):
        yield PurePosixPath(whole).name


def _as_written(folder: Path, name: str) -> Path | None:
    path = folder / name
    return path if name and path.is_file() else None


def _in_other_case(folder: Path, name: str) -> Path | None:
    """Find a file by its path, ignoring the case of letters. Of several, return the first by name."""
    relative = PurePosixPath(name)
    if relative.is_absolute():
        return None
    matches = [folder]
    for part in relative.parts:
        if part == "..":
            matches = [path / part for path in matches]
        else:
            matches = [
                entry
                for path in matches
                if path.is_dir()
                for entry in sorted(path.iterdir())
                if entry.name.casefold() == part.casefold()
            ]
    return next((path for path in matches if path.is_file()), None)
