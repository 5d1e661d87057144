"""STL: binary files that start like ASCII files and vice versa, damaged files, and notes on data that are left out."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.stl import read_stl

FACETS = [[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0), (0, 1, 0)]]


def binary(head: bytes = b"", attributes: tuple[int, ...] = (0, 0), count: int = 2) -> bytes:
    facets = [struct.pack("<12fH", 0, 0, 1, *sum(f, ()), a) for f, a in zip(FACETS, attributes, strict=True)]
    return head.ljust(80, b" ") + struct.pack("<I", count) + b"".join(facets)


def ascii_solid(name: str = "", facets=FACETS, end: str = "\n") -> bytes:
    lines = [f"solid {name}"]
    for facet in facets:
        corners = [f"      vertex {x:e} {y:.3f} {z}" for x, y, z in facet]
        lines += ["  facet normal 0 0 1", "    outer loop", *corners, "    endloop", "  endfacet"]
    return end.join([*lines, f"endsolid {name}", ""]).encode()


def read(folder: Path, data: bytes) -> Contents:
    """Read a file. Any warning is an error."""
    path = folder / "mesh.stl"
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_stl(path)


def refuse(folder: Path, data: bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, data)
    message, path = str(caught.value), f"{folder / 'mesh.stl'}: "
    assert message.startswith(path) and len(message.splitlines()) == 1
    return message.removeprefix(path)


def corners(contents: Contents) -> np.ndarray:
    (part,) = contents.parts
    return part.positions[part.faces]


@pytest.mark.parametrize(
    "data",
    [
        binary(),
        binary(b"solid made by a program"),
        binary(b"facet"),
        ascii_solid(),
        ascii_solid("a vertex of facet # 1"),
        ascii_solid(end="\r\n"),
        ascii_solid(end="\r"),
        ascii_solid().upper(),
        b"\xef\xbb\xbf\n\n  " + ascii_solid().replace(b" ", b"\t"),
        ascii_solid("one", FACETS[:1]) + ascii_solid("two", FACETS[1:]),
        ascii_solid("caf\u00e9").replace("\u00e9".encode(), b"\xe9"),
        ascii_solid() + b"\0\0\0",
    ],
)
def test_binary_and_ascii(tmp_path: Path, data: bytes) -> None:
    contents = read(tmp_path, data)
    np.testing.assert_array_equal(corners(contents), FACETS)
    assert contents.splits and contents.notes == ()


def test_colours_of_facets_are_noted(tmp_path: Path) -> None:
    assert read(tmp_path, binary(attributes=(0, 0x8FFF))).notes == ("colours (attributes) of 1 facets are left out",)
    assert read(tmp_path, binary(b"COLOR=\xff\0\0\xff")).notes == ("the colour is left out",)


def test_bytes_after_the_last_facet_are_noted(tmp_path: Path) -> None:
    contents = read(tmp_path, binary() + b"more")
    assert len(corners(contents)) == 2 and contents.notes == ("4 bytes after the last facet are left out",)
    cut = ascii_solid().removesuffix(b"endsolid \n")
    assert read(tmp_path, cut).notes == ("the file may be truncated: it does not end with 'endsolid'",)


def test_loops_of_more_than_three_vertices_are_split(tmp_path: Path) -> None:
    square = [[(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]]
    a, b, c = corners(read(tmp_path, ascii_solid(facets=square + FACETS))).transpose(1, 0, 2)
    assert np.cross(b - a, c - a)[:, 2].tolist() == [4, 4, 1, 1]


def test_positions_that_are_not_finite_are_left_to_the_mesh_checks(tmp_path: Path) -> None:
    data = bytearray(binary())
    data[96:108] = struct.pack("<2f", float("nan"), float("inf")) + b"\1\0\x80\x7f"  # the last is a signalling NaN
    assert (~np.isfinite(corners(read(tmp_path, bytes(data))))).sum() == 3
    assert np.isnan(corners(read(tmp_path, ascii_solid().replace(b"1.000 0", b"nan 0")))).any()


def test_truncation_anywhere(tmp_path: Path) -> None:
    for size in range(len(binary())):
        refuse(tmp_path, binary(b"solid")[:size])
    text = ascii_solid()
    for size in range(0, text.index(b"endsolid"), 3):
        try:
            notes = read(tmp_path, text[:size]).notes
        except InputError:
            continue
        assert notes == ("the file may be truncated: it does not end with 'endsolid'",)
    assert refuse(tmp_path, text[: text.rindex(b"vertex")]) == "line 10: a loop of 2 vertices"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (binary(count=3), "truncated, or not an .stl file: it has 2 of 3 facets"),
        (binary(count=2**32 - 1), "truncated, or not an .stl file: it has 2 of 4294967295 facets"),
        (binary()[:84].replace(b"\2", b"\0"), "the mesh is empty: it has no facets"),
        (b"solid a\nendsolid a\n", "the mesh is empty: it has no facets"),
        (b"hello", "damaged, or not an .stl file"),
        (b"", "the file is empty"),
        (ascii_solid().replace(b"0.000 ", b"zero ", 1), "line 4: 'zero' is not a number"),
        (ascii_solid().replace(b" 0.000 0\n", b"\n", 1), "line 4: 1 numbers where at least 3 are needed"),
        (ascii_solid().replace(b"    outer loop\n", b"", 1), "line 3: a vertex outside any 'outer loop'"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, data: bytes, message: str) -> None:
    assert refuse(tmp_path, data) == message
