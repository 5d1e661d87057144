"""Splitting a text file into words with numpy: the formats OBJ, OFF, ASCII PLY and ASCII STL are read from these."""

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

# How Microsoft's C library writes numbers that are not finite. Their '#' starts no comment.
_MSVC = re.compile(rb"([-+]?)\d\.#(IND|QNAN|SNAN|INF)\w*|([-+]?)nan\(\w*\)", re.IGNORECASE)


def file_bytes(path: Path) -> bytes:
    """All of a regular file. Raises InputError where it is missing, empty or cannot be read."""
    require_file(path)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def decoded(name: bytes) -> str:
    """A name in a text file that does not say its encoding: UTF-8, or else Latin-1."""
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def shown(name: bytes | str) -> str:
    """A word of a file as a message can show it: on one line, and not too long."""
    text = decoded(name) if isinstance(name, bytes) else name
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= 60 else f"{text[:57]}..."


def without_comment(name: str) -> str:
    """A name up to a '#' after a blank. Whether that is a comment or part of the name only the names in use tell."""
    return re.split(r"\s#", name, maxsplit=1)[0].rstrip()


class Text:
    """The words of a text file, in rows. A row is a line that is not blank; where `continued`, a line that ends with a
    backslash goes on in the next one. '#' starts a comment.

    Raises InputError where the data is not text.
    """

    def __init__(self, path: Path, data: bytes, continued: bool = False, first_line: int = 1) -> None:
        data = data.rstrip(b"\0\x1a")  # with which some programs end a text
        if b"\0" in data:
            raise InputError(f"{path}: damaged: it is not a text file")
        self.path, self._first_line = path, first_line
        self.raw = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        plain = self.raw
        # What is replaced keeps its length, so that places in `raw` and `plain` are the same.
        if b"#" in plain:
            plain = re.sub(rb"#(?!IND|QNAN|SNAN|INF)[^\n]*", lambda found: b" " * len(found[0]), plain)
        if continued and b"\\" in plain:
            plain = plain.replace(b"\v", b" ")
            plain = re.sub(rb"\\[ \t]*\n", lambda found: b" " * (len(found[0]) - 1) + b"\v", plain)
        self.codes: Array = np.frombuffer(plain, np.uint8)
        space = np.concatenate([[True], self.codes <= 32, [True]])
        change = np.flatnonzero(space[1:] != space[:-1])
        self.starts, self.ends = change[::2], change[1::2]
        breaks = np.flatnonzero(self.codes == 10)
        edges = np.concatenate([[0], np.searchsorted(self.starts, breaks), [len(self.starts)]])
        first = edges[np.concatenate([[True], edges[1:] != edges[:-1]])]
        self.first = first
        """int64 (R + 1,): the first word of each row, and the number of words"""
        self.widths = np.diff(first)
        """int64 (R,): the words of each row"""

    def row_starts_with(self, word: bytes) -> Array:
        """bool (R,): whether the first word of a row is this one."""
        start, end = self.starts[self.first[:-1]], self.ends[self.first[:-1]]
        same = end - start == len(word)
        for i, code in enumerate(word):
            same[same] = self.codes[start[same] + i] == code
        return same

    def word(self, index: int) -> bytes:
        return self.raw[self.starts[index] : self.ends[index]]

    def rest(self, row: int) -> str:
        """What follows a row's first word up to the end of the line, comments included: names may hold any letter."""
        start = self.ends[self.first[row]]
        end = self.raw.find(b"\n", start)
        return decoded(self.raw[start : end if end >= 0 else None].strip())

    def words(self, indices: Array, separator: bytes = b" ") -> list[bytes]:
        """The words of rising indices, split further at a separator."""
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
        """float64 (N,): the words of rising indices as numbers. Raises InputError for one that is no number."""
        return self.converted(self.words(indices), float, indices)

    def converted(self, words: Sequence[bytes], kind: Callable[[bytes], Any], indices: Array) -> Array:
        """float64 or int64 (N,): `words`, of which each lies in the word of the file that `indices` names."""
        try:
            if b"_" in self.raw and b"_" in b" ".join(words):  # which Python takes within numbers
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
            raise self.error(index, f"'{shown(word)}' is out of range") from None
        except ValueError:
            raise self.error(index, f"'{shown(word)}' is not a {'whole ' * (kind is int)}number") from None

    def table(self, rows: Array, least: int, most: int, skip: int = 1) -> tuple[Array, Array]:
        """The numbers of some rows after their first `skip` words, float64 (N, most), 0 where a row has fewer, and how
        many each row has (N,). Those beyond `most` are not read.

        Raises InputError where a row has fewer than `least`.
        """
        widths = self.widths[rows] - skip
        short = np.flatnonzero(widths < least)
        if len(short):
            has = max(widths[short[0]], 0)
            raise self.error(self.first[rows[short[0]]], f"{has} numbers where there must be at least {least}")
        there = np.arange(most) < widths[:, None]
        values = np.zeros(there.shape)
        values[there] = self.numbers((self.first[rows][:, None] + skip + np.arange(most))[there])
        return values, widths

    def line(self, index: int) -> int:
        """The number of the line, from 1, in which a word stands."""
        before = self.codes[: self.starts[index]]
        return self._first_line + int(np.count_nonzero(before == 10) + np.count_nonzero(before == 11))

    def error(self, index: int, what: str) -> InputError:
        """An error that names the line in which a word stands."""
        return InputError(f"{self.path}: line {self.line(index)}: {what}")
