"""The cache of baked data: one file per entry, per user, keyed by content and by the code that makes it."""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import console, wgsl
from wgsss.errors import Note

Arrays = dict[str, npt.NDArray[Any]]
KeyPart = bytes | str | int | float | npt.NDArray[Any] | None

_CONTENTS = "wgsss contents"
"""the member of an entry that says which one it is and what else it holds"""


def folder() -> Path:
    """Where entries are: `$WGSSS_CACHE`, else the user's cache folder."""
    if chosen := os.environ.get("WGSSS_CACHE"):
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("wgsss"))


def cached(
    kind: str,
    key: Sequence[KeyPart],
    make: Callable[[], Arrays],
    *,
    code: Sequence[Any] = (),
    label: str = "",
) -> Arrays:
    """What `make()` gives, from the cache where an entry with this key is there.

    An entry is an uncompressed .npz, whose members carry CRC-32 checksums; one of them says which entry it is and what
    else is in it. An entry that is damaged or another one is made anew with a warning; where the folder cannot be
    written, the result is used and a warning given. Entries are written to a temporary file and moved into place, so
    that processes that bake the same entry at once do not disturb each other.

    `make` runs with one BLAS thread: with two, sums are rounded otherwise, and equal keys would stand for other bits.

    Args:
        kind: what the entry is, the head of its file name.
        key: the content it is made of.
        make: makes the arrays by name. The module that defines it is part of the key.
        code: what else the result depends on: functions or classes, standing for their modules, and names of WGSL
            modules.
        label: says what is being made, on a terminal, while `make` runs.
    """
    path = folder() / f"{kind}-{_digest(key, make, code)}.npz"
    found = _read(path)
    if found is not None:
        return found
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
    """The entries there are, and bytes of each."""
    found = {}
    with suppress(OSError):  # there is no folder yet, or it cannot be read
        for path in folder().glob("*.npz"):
            with suppress(OSError):  # another process has just replaced it
                found[path] = path.stat().st_size
    return found


def _read(path: Path) -> Arrays | None:
    """The arrays of an entry, or None where there is none. Warns of one that is of no use."""
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
        warnings.warn(f"{path}: this cache entry is of no use ({why}): made anew", Note, stacklevel=3)
        return None
    return arrays


def _contents(path: Path, arrays: Arrays) -> str:
    """Which entry it is, and what it holds."""
    return "; ".join([path.stem, *sorted(f"{name} {a.dtype.str} {a.shape}" for name, a in arrays.items())])


def _digest(key: Sequence[KeyPart], make: Callable[[], Arrays], code: Sequence[Any]) -> str:
    digest = hashlib.sha256(_CONTENTS.encode())

    def add(tag: str, data: bytes) -> None:
        digest.update(f"{tag}:{len(data)}:".encode())
        digest.update(data)

    for item in (make, *code):
        if isinstance(item, str):
            add("code", wgsl.load(item).source.encode())
        else:
            add("code", Path(str(sys.modules[item.__module__].__file__)).read_bytes())
    for part in key:
        if isinstance(part, np.ndarray):
            add(f"array {part.dtype.str} {part.shape}", np.ascontiguousarray(part).tobytes())
        else:
            add(type(part).__name__, part if isinstance(part, bytes) else repr(part).encode())
    return digest.hexdigest()[:32]


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
