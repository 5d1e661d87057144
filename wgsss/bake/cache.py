"""The cache of baked data: one file per entry, per user, keyed by content and by the code that makes it."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss import wgsl

Arrays = dict[str, npt.NDArray[Any]]
KeyPart = bytes | str | int | float | npt.NDArray[Any] | None


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

    An entry is an uncompressed .npz, whose members carry CRC-32 checksums. A damaged entry is rebuilt with a warning;
    where the folder cannot be written, the result is used and a warning given. Entries are written to a temporary
    file and moved into place, so that processes that bake the same entry at once do not disturb each other.

    Args:
        kind: what the entry is, the head of its file name.
        key: the content it is made of.
        make: makes the arrays by name. The module that defines it is part of the key.
        code: what else the result depends on: functions or classes, standing for their modules, and names of WGSL
            modules.
        label: says what is being made, on a terminal, while `make` runs.
    """
    path = folder() / f"{kind}-{_digest(key, make, code)}.npz"
    try:
        with np.load(path, allow_pickle=False) as entry:
            return {name: entry[name] for name in entry.files}
    except (FileNotFoundError, NotADirectoryError):
        pass
    except Exception as error:  # a damaged file can fail in any way: bad zip, bad checksum, bad array header
        warnings.warn(f"{path}: damaged cache entry ({error}), made anew", stacklevel=2)
    arrays = _make(make, label)
    try:
        _write(path, arrays)
    except OSError as error:
        warnings.warn(f"{path.parent}: the cache cannot be written ({error.strerror or error})", stacklevel=2)
    return arrays


def _digest(key: Sequence[KeyPart], make: Callable[[], Arrays], code: Sequence[Any]) -> str:
    digest = hashlib.sha256()

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


def _make(make: Callable[[], Arrays], label: str) -> Arrays:
    told = bool(label) and sys.stderr.isatty()
    if told:
        print(f"{label} …", end="", file=sys.stderr, flush=True)
    try:
        return make()
    finally:
        if told:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def _write(path: Path, arrays: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
