"""The file runs.jsonl: one run of the benchmark per line.

Damaged lines are skipped, and several processes can append at once.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from wgsss.errors import InputError, Note
from wgsss.folders import created_folder
from wgsss.study.run_record import Run, parse_run
from wgsss.userfiles import require_file

FILE = "runs.jsonl"
_NAMED = 3  # damaged lines that a warning names


def read_runs(folder: str | Path) -> list[Run]:
    """Read the runs in a folder, in the order in which they ended. Lines that are not runs are skipped with a warning.

    Raises InputError if there are no runs.
    """
    path = Path(folder) / FILE
    runs, faults = _read(path)
    if not runs:
        raise InputError(f"{path}: {faults[0] if faults else 'there are no runs in it'}")
    return runs


def _read(path: Path) -> tuple[list[Run], list[str]]:
    """Return the runs of a file, and for each other line a text that says what is wrong with it."""
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
            runs.append(parse_run(line))
        except InputError as error:
            faults.append(f"line {number} is not a run ({error})")
    if runs and faults:
        more = f" and {len(faults) - _NAMED} more" if len(faults) > _NAMED else ""
        note = f"{path}: {len(faults)} of {len(runs) + len(faults)} lines skipped: {'; '.join(faults[:_NAMED])}{more}"
        warnings.warn(note, Note, stacklevel=3)
    return runs, faults


@contextmanager
def open_log(folder: Path) -> Iterator[tuple[list[Run], Callable[[Run], None]]]:
    """Create the folder if needed, and yield the runs in it and a function that appends a run.

    A folder that this call created is removed again if no run was appended. Raises InputError if the file cannot be
    written.
    """
    path = folder / FILE
    with created_folder(folder):
        existed = path.exists()
        if existed:
            require_file(path, may_be_empty=True)
        try:
            path.open("ab").close()
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
        try:
            yield _read(path)[0], lambda run: _append(path, run)
        finally:
            with suppress(OSError):
                if not existed and path.stat().st_size == 0:
                    path.unlink()


def _append(path: Path, run: Run) -> None:
    """Append a whole line or nothing. If the last line of the file was cut off, end it first."""
    line = json.dumps(run, ensure_ascii=False, allow_nan=False).encode("utf-8", "backslashreplace") + b"\n"
    try:
        with path.open("ab", buffering=0) as file, _locked(file) as is_locked:
            size = file.seek(0, os.SEEK_END)
            try:
                rest = line if _ends_a_line(path) else b"\n" + line
                while rest:
                    rest = rest[file.write(rest) or 0 :]
            except BaseException:
                if is_locked:  # so no other process has appended since
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
def _locked(file: IO[bytes]) -> Iterator[bool]:
    """Lock a file against other processes during the block. Yields whether that worked."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX)
    except (ImportError, OSError):  # Windows, and file systems without locks
        yield False
        return
    yield True  # closing the file releases the lock
