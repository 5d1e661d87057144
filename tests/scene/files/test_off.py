"""OFF: every header, faces of mixed sizes, colours, and errors that name the line."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.off import read_off

VERTICES = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
FACES = ["4 0 1 2 3"]


def off(head: str = "OFF\n4 1 0", vertices: list[str] = VERTICES, faces: list[str] = FACES) -> str:
    return "\n".join([head, *vertices, *faces]) + "\n"


def read(folder: Path, text: str | bytes) -> Contents:
    """Write text to a file and read it. Any warning is an error."""
    path = folder / "mesh.off"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_off(path)


def refuse(folder: Path, text: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, text)
    message, path = str(caught.value), f"{folder / 'mesh.off'}: "
    assert message.startswith(path) and len(message.splitlines()) == 1
    return message.removeprefix(path)


def area(contents: Contents) -> float:
    (part,) = contents.parts
    a, b, c = (part.positions[part.faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


@pytest.mark.parametrize(
    "text",
    [
        off(),
        off("OFF 4 1 0"),
        off("OFF4 1 0"),
        off("OFF\n4 1"),
        off("4 1 0"),
        off("off\n4 1 0"),
        off("# a\n\nOFF # b\n# c\n\n  4 1 0 # d"),
        off().replace("\n", "\r\n"),
        off().replace("\n", "\r"),
        off().replace(" ", "\t "),
        "\ufeff" + off(),
        off().rstrip(),
        off(faces=["3 0 1 2", "3 0 2 3"]).replace("4 1 0", "4 2 5"),
    ],
)
def test_headers_and_blanks(tmp_path: Path, text: str) -> None:
    contents = read(tmp_path, text)
    assert area(contents) == 1.0 and contents.notes == () and not contents.splits


def test_faces_of_mixed_sizes_and_their_colours(tmp_path: Path) -> None:
    contents = read(tmp_path, off("OFF 4 4 0", faces=["2 0 1", "3 0 1 2 255 0 0", "4 0 1 2 3 0.5", "0"]))
    assert area(contents) == 1.5
    assert contents.notes == ("colours of 2 faces are left out", "2 faces of fewer than three corners are left out")


@pytest.mark.parametrize("color", ["255 51 0", "255 51 0 255", "1.0 0.2 0.0", "1 .2 0 1"])
def test_colours_of_vertices_are_srgb(tmp_path: Path, color: str) -> None:
    contents = read(tmp_path, off("COFF\n4 1 0", [f"{v} {color}" for v in VERTICES]))
    np.testing.assert_allclose(contents.parts[0].colors, [[1, 0.0331048, 0]] * 4, atol=1e-6)


def test_normals_colours_and_texture_coordinates(tmp_path: Path) -> None:
    contents = read(
        tmp_path, off("STCNOFF 4 1 0", [f"{v} 0 0 1 10 20 30 {'255 ' * (i % 2)}.25 .5" for i, v in enumerate(VERTICES)])
    )
    (part,) = contents.parts
    assert part.colors is not None and part.normals is not None
    np.testing.assert_array_equal(part.normals, [[0, 0, 1]] * 4)
    np.testing.assert_array_equal(part.uvs[0], [[0.25, 0.5]] * 4)
    assert contents.splits


def test_data_that_are_left_out_are_noted(tmp_path: Path) -> None:
    assert read(tmp_path, off(vertices=[f"{v} 9" for v in VERTICES])).notes == (
        "4 vertices have more than 3 numbers: the rest is left out",
    )
    assert read(tmp_path, off() + "0 1\n").notes == ("1 lines after the last face are left out",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("OFF BINARY\n\0\0\0\4", "binary OFF files are not supported"),
        (off("4OFF\n4 1 0"), "OFF files of more than three dimensions are not supported"),
        (off("nOFF\n3\n4 1 0"), "OFF files of more than three dimensions are not supported"),
        ("OFF\n", "damaged: the numbers of vertices and faces are missing"),
        ("OFF\n8\n", "line 2: 1 numbers where at least 2 are needed"),
        ("OFF\n4.5 1 0\n", "line 2: the numbers of vertices and faces are not whole numbers"),
        ("OFF\n-4 1 0\n", "line 2: the numbers of vertices and faces are not whole numbers"),
        ("OFF\nnan 1e300 0\n", "line 2: the numbers of vertices and faces are not whole numbers"),
        ("<html>\n", "damaged, or not an .off file: its first word is neither 'OFF' nor a number"),
        (b"\x89PNG\0\1", "damaged: it is not a text file"),
        (" \n# c\n", "the file is empty"),
        (off("OFF\n4 100000000000 0"), "truncated: it has 5 of 100000000004 lines of vertices and faces"),
        (off(faces=["4 0 1 2 4"]), "line 7: vertex 4 does not exist (there are 4)"),
        (off(faces=["4 0 1 2 -1"]), "line 7: vertex -1 does not exist (there are 4)"),
        (off(faces=["5 0 1 2 3"]), "line 7: a face of 5 corners, but 4 numbers follow"),
        (off(faces=["-4 0 1 2 3"]), "line 7: a face of -4 corners, but 4 numbers follow"),
        (off(faces=["4 0 1 2 3.5"]), "line 7: '3.5' is not a whole number"),
        (off(vertices=["0 0", *VERTICES[1:]]), "line 3: 2 numbers where at least 3 are needed"),
        (off(vertices=["0 0 x", *VERTICES[1:]]), "line 3: 'x' is not a number"),
        (off("COFF\n4 1 0"), "line 3: 3 numbers where at least 6 are needed"),
        (off("OFF\n4 0 0", faces=[]), "the mesh is empty: it has no faces"),
    ],
)
def test_damage_is_one_line_with_the_location(tmp_path: Path, text: str | bytes, message: str) -> None:
    assert refuse(tmp_path, text) == message
