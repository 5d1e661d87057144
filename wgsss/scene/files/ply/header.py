"""The header of PLY files: the elements and their properties.

Source: "The PLY Polygon File Format" (Turk, 1994).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from wgsss.errors import InputError
from wgsss.scene.files.text import decoded, printable

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Property:
    """A property of the rows of an element: one number, or a list of numbers."""

    name: str
    type: str
    """numpy type of the number or of the items, such as "f4" """
    length: str | None = None
    """numpy type of the length of a list; None for a single number"""


@dataclass(frozen=True)
class Element:
    """A table of the file with `count` rows. Names are in lower case."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class Header:
    """The header of a file."""

    order: str
    """byte order of a binary file, "<" or ">"; "" for ASCII"""
    elements: list[Element]
    comments: list[str]
    lines: int
    """number of lines"""
    size: int
    """size in bytes"""


def read_header(path: Path, data: bytes) -> Header:
    """Read the header of a file. Raises InputError, naming the line, if it is damaged."""
    first = re.match(rb"ply[ \t]*(\r(?!\n)|\r?\n)", data, re.IGNORECASE)
    if first is None:
        raise InputError(f"{path}: damaged, or not a .ply file: its first line is not 'ply'")
    # All lines end like the first one. The binary data after the last line may begin with bytes like a line end.
    line_end = rb"\r" if first[1] == b"\r" else rb"\r?\n"
    end = re.search(line_end + rb"[ \t]*end_header[ \t]*" + line_end, data)
    if end is None:
        raise InputError(f"{path}: damaged: the header does not end with 'end_header'")
    lines = re.split(line_end, data[: end.start()])[1:]
    order, elements, comments = None, list[Element](), list[str]()
    for number, line in enumerate(lines, start=2):
        keyword, *words = decoded(line).split() or ["comment"]
        try:
            if keyword == "format":
                order = _ORDERS[words[0]]
            elif keyword in ("comment", "obj_info"):
                comments.append(decoded(line).strip().removeprefix(keyword).strip())
            elif keyword == "element":
                elements.append(_element(words))
            elif keyword == "property":
                elements[-1].properties.append(_property(words))
            else:
                raise ValueError
        except (ValueError, LookupError):
            raise InputError(f"{path}: line {number}: '{printable(line.strip())}' is not understood") from None
    if order is None:
        raise InputError(f"{path}: damaged: the header names no format")
    return Header(order, elements, comments, len(lines) + 2, end.end())


def _element(words: list[str]) -> Element:
    count = int(words[-1])
    if count < 0 or len(words) < 2:
        raise ValueError
    return Element(" ".join(words[:-1]).lower(), count)


def _property(words: list[str]) -> Property:
    if words[0] != "list":
        return Property(" ".join(words[1:]).lower(), _TYPES[words[0]])
    length = _TYPES[words[1]]
    if length[0] == "f":
        raise ValueError
    return Property(" ".join(words[3:]).lower(), _TYPES[words[2]], length)
