"""The cache of baked data: one file per entry, per user, named by a fingerprint of its input and its code."""

from __future__ import annotations

import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import console
from wgsss.errors import Note
from wgsss.fingerprint import fingerprint

Arrays = dict[str, npt.NDArray[Any]]

_CONTENTS = "wgsss contents"
"""the member of a file that lists which entry it is and which arrays it has"""


def folder() -> Path:
    """Return the folder of the entries: `$WGSSS_CACHE`, else the user's cache folder."""
    if chosen := os.environ.get("WGSSS_CACHE"):
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("wgsss"))


def cached(kind: str, key: Sequence[object], make: Callable[[], Arrays], *, label: str = "") -> Arrays:
    """Return the arrays of `make()`, from the cache where it has an entry with this key.

    The name of an entry is a fingerprint of the key, of the code of `make` and of the code of the key's dataclasses:
    if one of them changes, a new entry is made.

    An entry is an uncompressed .npz file, whose members have CRC-32 checksums. One member lists which entry it is and
    which arrays it has. If a file is damaged or is another entry, it warns and calls `make` again; if the folder cannot
    be written, it warns and returns the result. A file is written under a temporary name and then renamed, so that
    several processes can make the same entry at the same time.

    `make` runs with one BLAS thread, because the rounding of sums depends on the number of threads, and entries with
    the same key must have the same bits.

    Args:
        kind: the sort of entry, the head of its file name.
        key: all values that `make` reads, of the types that `fingerprint` knows.
        make: returns the arrays by name.
        label: the text shown on a terminal while `make` runs.
    """
    path = folder() / f"{kind}-{fingerprint([*key], make.__module__)[:32]}.npz"
    entry = _read(path)
    if entry is not None:
        return entry
    from threadpoolctl import threadpool_limits

    with console.activity(label), threadpool_limits(1, "blas"):
        arrays = {name: np.asarray(values) for name, values in make().items()}
    try:
        _write(path, arrays)
    except OSError as error:
        place = path if os.path.isdir(path) else path.parent
        warnings.warn(f"{place}: the cache cannot be written ({error.strerror or error})", Note, stacklevel=2)
    return arrays


def entries() -> dict[Path, int]:
    """Return the files of all entries with their sizes in bytes."""
    sizes = {}
    with suppress(OSError):  # there is no folder yet, or it cannot be read
        for path in folder().glob("*.npz"):
            with suppress(OSError):  # another process has just replaced it
                sizes[path] = path.stat().st_size
    return sizes


def _read(path: Path) -> Arrays | None:
    """Return the arrays of an entry, or None where there is no file, or a file that cannot be used, with a warning."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ValueError
        with path.open("rb") as file, np.load(file, allow_pickle=False) as entry:
            arrays = {name: entry[name] for name in entry.files}
        if str(arrays.pop(_CONTENTS)) != _contents(path, arrays):
            raise ValueError
    except (FileNotFoundError, NotADirectoryError):
        return None
    except Exception as error:  # a damaged file can fail in any way: bad zip, bad checksum, bad array header
        why = getattr(error, "strerror", None) or "damaged, or of other content"
        warnings.warn(f"{path}: this cache entry cannot be used ({why}) and is computed again", Note, stacklevel=3)
        return None
    return arrays


def _contents(path: Path, arrays: Arrays) -> str:
    """Return a text that identifies the entry and lists its arrays."""
    return "; ".join([path.stem, *sorted(f"{name} {a.dtype.str} {a.shape}" for name, a in arrays.items())])


def _write(path: Path, arrays: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays, **{_CONTENTS: np.array(_contents(path, arrays))})  # type: ignore[arg-type]
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
