"""Splitting of text files into words with numpy, for the readers of OBJ, OFF, ASCII PLY and ASCII STL."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.userfiles import require_file

Array = npt.NDArray[Any]

# Numbers that are not finite, as Microsoft's C library writes them. Their '#' does not start a comment.
_MSVC = re.compile(rb"([-+]?)\d\.#(IND|QNAN|SNAN|INF)\w*|([-+]?)nan\(\w*\)", re.IGNORECASE)


def file_bytes(path: Path) -> bytes:
    """Read the bytes of a regular file. Raises InputError if it is missing or empty, or cannot be read."""
    require_file(path)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def decoded(name: bytes) -> str:
    """Decode a name in a text file of unknown encoding: as UTF-8 if it is valid, else as Latin-1."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def printable(name: bytes | str) -> str:
    """Return a word of a file for a message: at most 60 characters, and "?" for those that cannot be printed."""
    text = decoded(name) if isinstance(name, bytes) else name
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= 60 else f"{text[:57]}..."


def without_comment(name: str) -> str:
    """Return a name up to the first '#' after a blank. That may be a comment or part of the name: callers try both."""
    return re.split(r"\s#", name, maxsplit=1)[0].rstrip()


class Text:
    """The words of a text file in R rows. A row is a line that is not blank, and '#' starts a comment.

    If `continued` is set, a line that ends with a backslash continues in the next line. `first_line` is the number of
    the first line. Raises InputError if the data is not text.
    """

    def __init__(self, path: Path, data: bytes, continued: bool = False, first_line: int = 1) -> None:
        data = data.rstrip(b"\0\x1a")  # some programs end a text with these
        if b"\0" in data:
            raise InputError(f"{path}: damaged: it is not a text file")
        self.path, self._first_line = path, first_line
        self.raw = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        plain = self.raw
        # Replacements keep the length, so that an offset means the same place in `raw` and in `plain`.
        if b"#" in plain:
            plain = re.sub(rb"#(?!IND|QNAN|SNAN|INF)[^\n]*", lambda match: b" " * len(match[0]), plain)
        if continued and b"\\" in plain:
            plain = plain.replace(b"\v", b" ")
            plain = re.sub(rb"\\[ \t]*\n", lambda match: b" " * (len(match[0]) - 1) + b"\v", plain)
        self.codes: Array = np.frombuffer(plain, np.uint8)
        space = np.concatenate([[True], self.codes <= 32, [True]])
        change = np.flatnonzero(space[1:] != space[:-1])
        self.starts, self.ends = change[::2], change[1::2]
        breaks = np.flatnonzero(self.codes == 10)
        edges = np.concatenate([[0], np.searchsorted(self.starts, breaks), [len(self.starts)]])
        first = edges[np.concatenate([[True], edges[1:] != edges[:-1]])]
        self.first = first
        """int64 (R + 1,): the index of the first word of each row, then the number of words"""
        self.widths = np.diff(first)
        """int64 (R,): the number of words of each row"""

    def row_starts_with(self, word: bytes) -> Array:
        """Return, for each row, whether its first word is `word`: bool (R,)."""
        start, end = self.starts[self.first[:-1]], self.ends[self.first[:-1]]
        same = end - start == len(word)
        for i, code in enumerate(word):
            same[same] = self.codes[start[same] + i] == code
        return same

    def word(self, index: int) -> bytes:
        """Return the word at an index."""
        return self.raw[self.starts[index] : self.ends[index]]

    def rest(self, row: int) -> str:
        """Return the text after the first word of a row up to the end of the line, including a comment."""
        start = self.ends[self.first[row]]
        end = self.raw.find(b"\n", start)
        return decoded(self.raw[start : end if end >= 0 else None].strip())

    def words(self, indices: Array, separator: bytes = b" ") -> list[bytes]:
        """Return the words at rising indices, split further at a separator of one byte."""
        if not len(indices):
            return []
        starts, ends = self.starts[indices], self.ends[indices]
        codes = self.codes[starts[0] : ends[-1]]
        edges = np.zeros(len(codes) + 1, np.int8)
        edges[starts - starts[0]] = 1
        edges[ends - starts[0]] = -1
        inside = np.cumsum(edges[:-1], dtype=np.int8).view(bool)
        if separator != b" ":
            inside &= codes != separator[0]
        return np.where(inside, codes, np.uint8(32)).tobytes().split()

    def numbers(self, indices: Array) -> Array:
        """Convert the words at rising indices to float64 (N,). Raises InputError if a word is not a number."""
        return self.converted(self.words(indices), float, indices)

    def converted(self, words: Sequence[bytes], kind: Callable[[bytes], Any], indices: Array) -> Array:
        """Convert N words to float64 or int64 (N,), according to `kind` (float or int).

        `indices` (N,) are the words of the file that contain them, for errors. Raises InputError if a word is not a
        number of this kind.
        """
        try:
            if b"_" in self.raw and b"_" in b" ".join(words):  # Python accepts underscores in numbers
                raise ValueError
            return np.array(list(map(kind, words)), np.int64 if kind is int else np.float64)
        except (ValueError, OverflowError):
            return np.array([self._number(w, kind, i) for w, i in zip(words, indices, strict=True)])

    def _number(self, word: bytes, kind: Callable[[bytes], Any], index: int) -> Any:
        msvc = _MSVC.fullmatch(word)
        if msvc and kind is float:
            return float((msvc[1] or b"") + b"inf") if msvc[2] and msvc[2].upper() == b"INF" else np.nan
        try:
            if b"_" in word:
                raise ValueError
            value = kind(word)
            return np.int64(value) if kind is int else value
        except OverflowError:
            raise self.error(index, f"'{printable(word)}' is out of range") from None
        except ValueError:
            raise self.error(index, f"'{printable(word)}' is not a {'whole ' * (kind is int)}number") from None

    def table(self, rows: Array, least: int, most: int, skip: int = 1) -> tuple[Array, Array]:
        """Read up to `most` numbers of each of N rows, after their first `skip` words.

        Returns the numbers as float64 (N, most), with 0 where a row has fewer, and the count of numbers in each row
        (N,), including those beyond `most`. Raises InputError if a row has fewer than `least`.
        """
        widths = self.widths[rows] - skip
        short = np.flatnonzero(widths < least)
        if len(short):
            count = max(widths[short[0]], 0)
            raise self.error(self.first[rows[short[0]]], f"{count} numbers where at least {least} are needed")
        present = np.arange(most) < widths[:, None]
        values = np.zeros(present.shape)
        values[present] = self.numbers((self.first[rows][:, None] + skip + np.arange(most))[present])
        return values, widths

    def line(self, index: int) -> int:
        """Return the number of the line that contains a word, counted from 1."""
        before = self.codes[: self.starts[index]]
        return self._first_line + int(np.count_nonzero(before == 10) + np.count_nonzero(before == 11))

    def error(self, index: int, message: str) -> InputError:
        """Make an error that names the line that contains a word."""
        return InputError(f"{self.path}: line {self.line(index)}: {message}")
