"""Everything that wgsss prints, whatever the state of the standard streams.

Results go to standard output, everything else to standard error. A character that the encoding of a stream lacks is
printed as an escape such as \\u2026. Text for a closed stream is dropped. A result that cannot be written is an error.
A message that cannot be written to standard error is dropped, and the work continues.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from wgsss.errors import InputError


def occupy_standard_streams() -> None:
    """Open /dev/null in place of closed standard streams, or the next file opened would take their number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest number that is free


def print_result(text: str) -> None:
    """Print a result on standard output.

    Raises BrokenPipeError if the reader has closed the pipe, and InputError if the text cannot be written.
    """
    try:
        _write(sys.stdout, text + "\n")
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"standard output cannot be written ({error.strerror or error})") from None


def print_message(text: str) -> None:
    """Print a line on standard error."""
    _write_to_stderr(text + "\n")


def is_terminal() -> bool:
    """Whether standard error is a terminal, so that progress can be shown on it."""
    try:
        return sys.stderr is not None and sys.stderr.isatty()
    except ValueError:  # it is closed
        return False


@contextmanager
def activity(label: str) -> Iterator[None]:
    """Show a label on the terminal while the block runs, and erase it at the end. An empty label shows nothing."""
    is_shown = bool(label) and is_terminal()
    if is_shown:
        _write_to_stderr(f"{label} …")
    try:
        yield
    finally:
        if is_shown:
            _write_to_stderr("\r\033[K")


def progress_bar(*arguments: Any, **options: Any) -> Any:
    """A progress bar of tqdm with these arguments, shown on a terminal only."""
    from tqdm import tqdm

    return tqdm(*arguments, file=_StandardError(), disable=not is_terminal(), dynamic_ncols=True, **options)


def json_text(value: Any) -> str:
    """Format a value as JSON. Characters that standard output cannot encode become JSON escapes."""
    import json

    text = json.dumps(value, indent=2, ensure_ascii=False)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeError:
        text = json.dumps(value, indent=2)
    return text


class _StandardError:
    """Standard error as a file whose writes never fail."""

    def write(self, text: str) -> None:
        _write_to_stderr(text)

    def flush(self) -> None:
        pass

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)


def _write_to_stderr(text: str) -> None:
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
        _discard_buffer(stream)
        raise


def _discard_buffer(stream: Any) -> None:
    """Redirect a stream to /dev/null, so that what its buffer still holds does not fail again when the process ends."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(null, stream.fileno())
        finally:
            os.close(null)
