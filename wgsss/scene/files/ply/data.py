"""The numbers of PLY files as a table for each element, whatever the elements mean."""

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
from wgsss.scene.files.text import Text, shown

Array = npt.NDArray[Any]

_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}


@dataclass(frozen=True)
class Lists:
    """A list for each row: how long each is, int64 (N,), and the values of all, one after the other."""

    counts: Array
    values: Array


Table = dict[str, Array | Lists]


def read_tables(path: Path, data: bytes, header: Header, notes: list[str]) -> dict[str, Table]:
    """The rows of each element by its name; of two with one name the first counts, and so of properties.

    Numbers are float64 in an ASCII file, and of their own types in a binary one. Raises InputError, naming the line or
    the element, where the file is damaged or truncated.
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
            raise text.error(edges[misfit], f"its numbers do not fit the properties of element {shown(element.name)}")
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
            raise InputError(f"{path}: damaged: row {misfit + 1} of element {shown(element.name)}")
        yield table
        at = int(edges[-1])
    if data[at:].strip():
        notes.append(f"{len(data) - at} bytes after the last element are left out")


def _size(type_: str) -> int:
    return int(type_[-1])


def _numbers(data: bytes, type_: str) -> Array:
    """A view of the data in which a number starts at every byte."""
    return np.ndarray((max(len(data) - _size(type_) + 1, 0),), type_, data, strides=(1,))


def _truncated(path: Path, element: Element) -> InputError:
    return InputError(f"{path}: truncated: it has fewer than {element.count} rows of element {shown(element.name)}")


def _table(
    element: Element, edges: Array, take: Callable[[Array, str], Array], size: Callable[[str], int]
) -> tuple[Table, int | None]:
    """The properties of rows that lie between `edges` (N + 1,), and the first row whose properties do not fill it.

    `take` gives the numbers of a type at some places, and `size` how many places one takes up.
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
            places = np.repeat(at - each * before, counts) + each * np.arange(counts.sum())
            value = Lists(counts, take(places, p.type))
            at = at + each * counts
        table.setdefault(p.name, value)
    misfit = at != ends
    return table, int(misfit.argmax()) if misfit.any() else None


def _edges(path: Path, data: bytes, at: int, element: Element, order: str) -> Array:
    """Where the rows of an element of a binary file start, and where the last one ends, int64 (N + 1,)."""
    least = sum(_size(p.length or p.type) for p in element.properties)
    if element.count * least > len(data) - at:
        raise _truncated(path, element)
    if not any(p.length for p in element.properties):
        return at + least * np.arange(element.count + 1 if least else 1)
    edges = _equal_edges(data, at, element, order)
    return _walked_edges(path, data, at, element, order) if edges is None else edges


def _equal_edges(data: bytes, at: int, element: Element, order: str) -> Array | None:
    """The same where all rows have lists of the same lengths, as most files do; None where they do not."""
    fields: list[tuple[int, str, int]] = []
    place = at
    for p in element.properties:
        if p.length:
            numbers = _numbers(data, order + p.length)
            if place >= len(numbers):
                return None
            fields.append((place, p.length, int(numbers[place])))
            place += _size(p.length) + max(fields[-1][2], 0) * _size(p.type)
        else:
            place += _size(p.type)
    if element.count * (place - at) > len(data) - at:
        return None
    edges: Array = at + (place - at) * np.arange(element.count + 1)
    rows = edges[:-1] - at
    if all((_numbers(data, order + type_)[start + rows] == length).all() for start, type_, length in fields):
        return edges
    return None


def _walked_edges(path: Path, data: bytes, at: int, element: Element, order: str) -> Array:
    """The same for lists of differing lengths, from row to row."""
    lists, before = [], 0  # the bytes before each list, its length, that one's size, and that of an item
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
                    raise InputError(f"{path}: damaged: row {len(edges)} of element {shown(element.name)}")
                at += skip + length_size + length * item_size
            at += before
            edges.append(at)
    except struct.error:
        raise _truncated(path, element) from None
    if at > len(data):
        raise _truncated(path, element)
    return np.array(edges)
