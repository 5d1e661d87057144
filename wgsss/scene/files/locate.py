"""Finding the files that a file names, as they are written by programs of other systems."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from urllib.parse import unquote


def locate(name: str, folder: Path) -> Path | None:
    """The regular file that a name, relative to a folder, means; None where there is none.

    Tried in turn: the name as it is, percent-decoded, with slashes for backslashes, its last part beside the file, and
    each of these in another letter case.
    """
    spellings = list(dict.fromkeys(_spellings(name)))
    for find in (_as_written, _in_other_case):
        for spelling in spellings:
            try:
                found = find(folder, spelling)
            except (OSError, ValueError):  # too long, a NUL in it, a folder that may not be read
                continue
            if found is not None:
                return found
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
    """The file whose folders and name are these but for the case of their letters, the first by name of several."""
    path = PurePosixPath(name)
    if path.is_absolute():
        return None
    found = [folder]
    for part in path.parts:
        if part == "..":
            found = [at / part for at in found]
        else:
            found = [
                here
                for at in found
                if at.is_dir()
                for here in sorted(at.iterdir())
                if here.name.casefold() == part.casefold()
            ]
    return next((at for at in found if at.is_file()), None)
