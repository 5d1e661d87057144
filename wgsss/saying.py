"""Everything that wgsss prints, whatever the standard streams are.

Results go to standard output, all else to standard error. What a stream's encoding lacks is printed as an escape, such
as \\u2026. A stream that is closed takes nothing. A result that cannot be written is an error; where standard error
cannot be written, nothing more can be done, and the work goes on.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from wgsss.errors import InputError


def occupy_standard_streams() -> None:
    """Open /dev/null in place of standard streams that are closed: the next file that is opened would become one."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest number that is free


def result(text: str) -> None:
    """Print a result. Raises BrokenPipeError where its reader has gone, and InputError where it cannot be written."""
    try:
        _write(sys.stdout, text + "\n")
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"standard output cannot be written ({error.strerror or error})") from None


def aside(text: str) -> None:
    """Print a line on standard error."""
    _attempt(text + "\n")


def on_terminal() -> bool:
    """Whether standard error is a terminal, which shows how far the work is."""
    try:
        return sys.stderr is not None and sys.stderr.isatty()
    except ValueError:  # it is closed
        return False


@contextmanager
def doing(what: str) -> Iterator[None]:
    """Say on a terminal what is done in the block, and wipe it away when it ends."""
    told = bool(what) and on_terminal()
    if told:
        _attempt(f"{what} …")
    try:
        yield
    finally:
        if told:
            _attempt("\r\033[K")


def progress(*things: Any, **shown: Any) -> Any:
    """A bar of tqdm, with its arguments, on a terminal only."""
    from tqdm import tqdm

    return tqdm(*things, file=_Aside(), disable=not on_terminal(), dynamic_ncols=True, **shown)


def json_text(value: Any) -> str:
    """A value as JSON that standard output can hold: an escape such as \\U0001f600 would be none."""
    import json

    text = json.dumps(value, indent=2, ensure_ascii=False)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeError:
        text = json.dumps(value, indent=2)
    return text


class _Aside:
    """Standard error as a file that never fails."""

    def write(self, text: str) -> None:
        _attempt(text)

    def flush(self) -> None:
        pass

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)


def _attempt(text: str) -> None:
    with suppress(OSError):
        _write(sys.stderr, text)


def _write(stream: Any, text: str) -> None:
    if stream is None or stream.closed:
        return
    encoding = getattr(stream, "encoding", None)
    if encoding:
        text = text.encode(encoding, "backslashreplace").decode(encoding)
    try:
        stream.write(text)
        stream.flush()
    except OSError:
        _abandon(stream)
        raise


def _abandon(stream: Any) -> None:
    """Let what a stream still holds go nowhere: written again as the process ends, it would fail again."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(nowhere, stream.fileno())
        finally:
            os.close(nowhere)
