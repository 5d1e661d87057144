"""Mesh files with faces of differing numbers of corners, rewritten in the form in which trimesh can read them."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

_PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "b"),
    **dict.fromkeys(("uchar", "uint8"), "B"),
    **dict.fromkeys(("short", "int16"), "h"),
    **dict.fromkeys(("ushort", "uint16"), "H"),
    **dict.fromkeys(("int", "int32"), "i"),
    **dict.fromkeys(("uint", "uint32"), "I"),
    **dict.fromkeys(("float", "float32"), "f"),
    **dict.fromkeys(("double", "float64"), "d"),
}


def ply_as_ascii(data: bytes) -> bytes:
    """A binary PLY file as an ASCII one. Raises ValueError or struct.error where it is damaged or ASCII already."""
    end = re.search(rb"end_header\r?\n", data)
    if end is None:
        raise ValueError("the header does not end")
    head = data[: end.end()].decode("ascii")
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}[head.split()[2]]
    rows, at = [], end.end()
    for element in re.split(r"^element ", head, flags=re.MULTILINE)[1:]:
        first, *lines = element.splitlines()
        readers = [_property(line.split()[1:], order) for line in lines if line.startswith("property ")]
        for _ in range(int(first.split()[1])):
            row: list[float] = []
            for read in readers:
                values, at = read(data, at)
                row += values
            rows.append(" ".join(map(repr, row)))
    return re.sub(r"binary_\w+_endian", "ascii", head).encode() + "\n".join(rows).encode() + b"\n"


def _property(words: list[str], order: str) -> Callable[[bytes, int], tuple[list[float], int]]:
    """What reads a property of a row at a place: its numbers, a list's length first, and the place after."""
    if words[0] != "list":
        scalar = struct.Struct(order + _PLY_TYPES[words[0]])
        return lambda data, at: (list(scalar.unpack_from(data, at)), at + scalar.size)
    size, kind = struct.Struct(order + _PLY_TYPES[words[1]]), _PLY_TYPES[words[2]]

    def read(data: bytes, at: int) -> tuple[list[float], int]:
        (count,) = size.unpack_from(data, at)
        items = struct.Struct(f"{order}{count}{kind}")
        return [count, *items.unpack_from(data, at + size.size)], at + size.size + items.size

    return read


def off_as_triangles(data: bytes) -> bytes:
    """An OFF file with its faces split into fans of triangles. Raises ValueError or IndexError where it is damaged."""
    lines = [line.split("#")[0].split() for line in data.decode("utf-8").replace("OFF", "OFF\n", 1).splitlines()]
    _, counts, *rows = (line for line in lines if line)
    vertices, faces = int(counts[0]), int(counts[1])
    fans = []
    for row in rows[vertices : vertices + faces]:
        corners = row[1 : int(row[0]) + 1]
        fans += [["3", corners[0], *corners[i : i + 2]] for i in range(1, len(corners) - 1)]
    head = ["OFF", f"{vertices} {len(fans)} 0"]
    return "\n".join([*head, *(" ".join(line) for line in rows[:vertices] + fans)]).encode()
