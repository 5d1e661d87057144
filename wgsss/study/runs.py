"""The file of a bench's runs, one a line: read whatever it holds, and appended to by several processes at once."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from wgsss.errors import InputError, Note
from wgsss.folders import created_folder
from wgsss.study.run_line import Run, parsed
from wgsss.userfiles import require_file

FILE = "runs.jsonl"
_NAMED = 3  # lines that a warning names


def read(folder: str | Path) -> list[Run]:
    """The runs in a folder, in the order in which they ended. Lines that are no runs are left out with a warning.

    Raises InputError where there is no run.
    """
    path = Path(folder) / FILE
    runs, faults = _read(path)
    if not runs:
        raise InputError(f"{path}: {faults[0] if faults else 'there are no runs in it'}")
    return runs


def _read(path: Path) -> tuple[list[Run], list[str]]:
    """The runs of a file, and what is wrong with its other lines."""
    require_file(path, may_be_empty=True)
    try:
        lines = path.read_bytes().removeprefix(b"\xef\xbb\xbf").split(b"\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    runs, faults = [], []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            runs.append(parsed(line))
        except InputError as error:
            faults.append(f"line {number} is not a run ({error})")
    if runs and faults:
        more = f" and {len(faults) - _NAMED} more" if len(faults) > _NAMED else ""
        note = f"{path}: left out, of {len(runs) + len(faults)} lines: {'; '.join(faults[:_NAMED])}{more}"
        warnings.warn(note, Note, stacklevel=3)
    return runs, faults


@contextmanager
def appended(folder: Path) -> Iterator[tuple[list[Run], Callable[[Run], None]]]:
    """The runs in a folder, which may have none yet or be missing, and what appends one.

    A folder to which nothing was appended goes again, if it was made here. Raises InputError where it cannot be
    written.
    """
    path = folder / FILE
    with created_folder(folder):
        held = path.exists()
        if held:
            require_file(path, may_be_empty=True)
        try:
            path.open("ab").close()
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
        try:
            yield _read(path)[0], lambda run: _append(path, run)
        finally:
            with suppress(OSError):
                if not held and path.stat().st_size == 0:
                    path.unlink()


def _append(path: Path, run: Run) -> None:
    """A line, as a whole or not at all. One that was cut off before it is ended first, so that it spoils no other."""
    line = json.dumps(run, ensure_ascii=False, allow_nan=False).encode("utf-8", "backslashreplace") + b"\n"
    try:
        with path.open("ab", buffering=0) as file, _locked(file) as locked:
            size = file.seek(0, os.SEEK_END)
            try:
                rest = line if _ends_a_line(path) else b"\n" + line
                while rest:
                    rest = rest[file.write(rest) or 0 :]
            except BaseException:
                if locked:  # and so nobody has written after us
                    file.truncate(size)
                raise
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def _ends_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) == 0:
            return True
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"


@contextmanager
def _locked(file: Any) -> Iterator[bool]:
    """Keep other processes from appending in the block; whether that could be done."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX)
    except (ImportError, OSError):  # Windows, and file systems without locks
        yield False
        return
    yield True  # the lock goes as the file is closed
