"""The body of PLY files: one table of numbers for each element, without interpretation."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.ply.header import Element, Header
from wgsss.scene.files.text import Text, printable

Array = npt.NDArray[Any]

_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}


@dataclass(frozen=True)
class Lists:
    """One list for each of N rows."""

    counts: Array
    """int64 (N,): the lengths of the lists"""
    values: Array
    """(sum of counts,): the values of all lists in a row"""


Table = dict[str, Array | Lists]


def read_tables(path: Path, data: bytes, header: Header, notes: list[str]) -> dict[str, Table]:
    """Read the rows of each element, by its name.

    Of two elements or properties with the same name, the first is used. Numbers are float64 for an ASCII file and have
    the types of the header for a binary one. Raises InputError, naming the line or the element, if the file is damaged
    or truncated.
    """
    tables: dict[str, Table] = {}
    rows = (_binary if header.order else _ascii)(path, data, header, notes)
    for element, table in zip(header.elements, rows, strict=True):
        tables.setdefault(element.name, table)
    return tables


def _ascii(path: Path, data: bytes, header: Header, notes: list[str]) -> Iterator[Table]:
    text = Text(path, data[header.size :], first_line=header.lines + 1)
    row = 0
    for element in header.elements:
        count = element.count if element.properties else 0
        if count > len(text.widths) - row:
            raise _truncated(path, element)
        edges = text.first[row : row + count + 1]
        numbers = text.numbers(np.arange(edges[0], edges[-1]))

        def take(at: Array, _: str, numbers: Array = numbers) -> Array:
            return numbers[at]

        table, misfit = _table(element, edges - edges[0], take, lambda _: 1)
        if misfit is not None:
            raise text.error(
                edges[misfit], f"its numbers do not fit the properties of element {printable(element.name)}"
            )
        yield table
        row += count
    if row < len(text.widths):
        notes.append(f"{len(text.widths) - row} lines after the last element are left out")


def _binary(path: Path, data: bytes, header: Header, notes: list[str]) -> Iterator[Table]:
    at = header.size
    for element in header.elements:

        def take(at: Array, type_: str) -> Array:
            return _numbers(data, header.order + type_)[at]

        edges = _edges(path, data, at, element, header.order)
        table, misfit = _table(element, edges, take, _size)
        if misfit is not None:
            raise InputError(f"{path}: damaged: row {misfit + 1} of element {printable(element.name)}")
        yield table
        at = int(edges[-1])
    if data[at:].strip():
        notes.append(f"{len(data) - at} bytes after the last element are left out")


def _size(type_: str) -> int:
    return int(type_[-1])


def _numbers(data: bytes, type_: str) -> Array:
    """Return an overlapping view of the data with a number that starts at each byte."""
    return np.ndarray((max(len(data) - _size(type_) + 1, 0),), type_, data, strides=(1,))


def _truncated(path: Path, element: Element) -> InputError:
    return InputError(f"{path}: truncated: it has fewer than {element.count} rows of element {printable(element.name)}")


def _table(
    element: Element, edges: Array, take: Callable[[Array, str], Array], size: Callable[[str], int]
) -> tuple[Table, int | None]:
    """Read the properties of N rows, where row i lies between edges[i] and edges[i + 1].

    Edges count words in an ASCII file and bytes in a binary one. `take` returns the numbers of a type at some offsets,
    and `size` returns the size of a number of a type. Returns the table, and the first row that its properties do not
    fill exactly, or None.
    """
    table: Table = {}
    at, ends = edges[:-1], edges[1:]
    for p in element.properties:
        first = p.length or p.type
        misfit = at + size(first) > ends
        if misfit.any():
            return {}, int(misfit.argmax())
        value: Array | Lists = take(at, first)
        at = at + size(first)
        if p.length:
            counts, each = take(at - size(first), first), size(p.type)
            misfit = ~((counts >= 0) & (counts <= (ends - at) // each) & (counts == np.floor(counts)))
            if misfit.any():
                return {}, int(misfit.argmax())
            counts = counts.astype(np.int64)
            before = np.cumsum(counts) - counts
            offsets = np.repeat(at - each * before, counts) + each * np.arange(counts.sum())
            value = Lists(counts, take(offsets, p.type))
            at = at + each * counts
        table.setdefault(p.name, value)
    misfit = at != ends
    return table, int(misfit.argmax()) if misfit.any() else None


def _edges(path: Path, data: bytes, at: int, element: Element, order: str) -> Array:
    """Return the byte offsets of the N rows of a binary element, and the end of the last row: int64 (N + 1,)."""
    least = sum(_size(p.length or p.type) for p in element.properties)
    if element.count * least > len(data) - at:
        raise _truncated(path, element)
    if not any(p.length for p in element.properties):
        return at + least * np.arange(element.count + 1 if least else 1)
    edges = _equal_edges(data, at, element, order)
    return _walked_edges(path, data, at, element, order) if edges is None else edges


def _equal_edges(data: bytes, at: int, element: Element, order: str) -> Array | None:
    """Compute the edges of an element whose rows all have lists of equal length. Return None if the lengths differ."""
    fields: list[tuple[int, str, int]] = []
    offset = at
    for p in element.properties:
        if p.length:
            numbers = _numbers(data, order + p.length)
            if offset >= len(numbers):
                return None
            fields.append((offset, p.length, int(numbers[offset])))
            offset += _size(p.length) + max(fields[-1][2], 0) * _size(p.type)
        else:
            offset += _size(p.type)
    if element.count * (offset - at) > len(data) - at:
        return None
    edges: Array = at + (offset - at) * np.arange(element.count + 1)
    rows = edges[:-1] - at
    if all((_numbers(data, order + type_)[start + rows] == length).all() for start, type_, length in fields):
        return edges
    return None


def _walked_edges(path: Path, data: bytes, at: int, element: Element, order: str) -> Array:
    """Compute the edges of an element with lists of different lengths, by reading row after row."""
    lists, before = [], 0  # bytes before each list, reader of its length, size of the length, size of an item
    for p in element.properties:
        if p.length:
            read = struct.Struct((order or "<") + _STRUCT[p.length]).unpack_from
            lists.append((before, read, _size(p.length), _size(p.type)))
            before = 0
        else:
            before += _size(p.type)
    edges = [at]
    try:
        for _ in range(element.count):
            for skip, read, length_size, item_size in lists:
                (length,) = read(data, at + skip)
                if length < 0:
                    raise InputError(f"{path}: damaged: row {len(edges)} of element {printable(element.name)}")
                at += skip + length_size + length * item_size
            at += before
            edges.append(at)
    except struct.error:
        raise _truncated(path, element) from None
    if at > len(data):
        raise _truncated(path, element)
    return np.array(edges)
