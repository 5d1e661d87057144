"""Wavefront OBJ: every notation of faces, notes on statements that are left out, and errors that name the line."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.obj import read_obj

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
CUBE_CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
CUBE_FACES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]


def read(folder: Path, text: str | bytes, name: str = "mesh.obj") -> Contents:
    """Write text to a file and read it. Any warning is an error."""
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_obj(path)


def refuse(folder: Path, text: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, text)
    message = str(caught.value)
    path = f"{folder / 'mesh.obj'}: "
    assert message.startswith(path) and len(message.splitlines()) == 1
    return message.removeprefix(path)


def area(contents: Contents) -> float:
    return sum(float(np.linalg.norm(normals(p), axis=1).sum()) for p in contents.parts) / 2


def volume(contents: Contents) -> float:
    return sum(float(np.einsum("ij,ij", p.positions[p.faces[:, 0]], normals(p))) for p in contents.parts) / 6


def normals(part) -> np.ndarray:
    a, b, c = (part.positions[part.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def cube(at: float = 0.0, relative: bool = False, blank: str = " ") -> str:
    """Return the text of a closed cube of edge 1, with negative (`relative`) or positive indices."""
    lines = [blank.join(["v", *(f"{x}" for x in (p[0] + at, p[1], p[2]))]) for p in CUBE_CORNERS]
    lines += [blank.join(["f", *(str(i - 9 if relative else i) for i in face)]) for face in CUBE_FACES]
    return "\n".join(lines) + "\n"


def test_negative_numbers_count_back_from_the_face(tmp_path: Path) -> None:
    three = read(tmp_path, "".join(cube(at, relative=True) for at in (0, 5, 10)))
    assert volume(three) == pytest.approx(3.0) and area(three) == pytest.approx(18.0)
    assert np.ptp(three.parts[0].positions[:, 0]) == 11.0


def test_negative_numbers_of_texture_coordinates_and_normals(tmp_path: Path) -> None:
    block = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nf -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1\n"
    part = read(tmp_path, block + block.replace("vt 1 1", "vt .5 .5")).parts[0]
    np.testing.assert_allclose(part.uvs[0][[2, 6]], [[1, 0], [0.5, 0.5]])
    assert (part.normals == (0, 0, 1)).all()


def test_a_face_may_refer_to_later_vertices(tmp_path: Path) -> None:
    assert area(read(tmp_path, "f 1 2 3 4\n" + SQUARE)) == 1.0


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(" ", "\t"),
        lambda text: text.replace(" ", " \t  "),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text.replace("\n", "\r\n", 5).replace("\n", "\n\n \n"),
        lambda text: text.replace("\n", " # a comment\n"),
        lambda text: text.replace("\n", "#\n"),
        lambda text: text.replace(" ", " \\\n"),
        lambda text: text.replace(" ", " \\  \r\n\t", 9),
        lambda text: "\ufeff" + text,
        lambda text: "  " + text.replace("\n", "\n  "),
        lambda text: text.rstrip(),
        lambda text: text + "\0",
        lambda text: text.replace("f ", "fo "),
        lambda text: text.replace("v ", "v +").replace("\n", " 1.0\n", 8),
        lambda text: "# C:\\models\\\n" + text,
        lambda text: "# caf\udce9\n" + "o na\udcefve\n" + text,
    ],
)
def test_every_notation_gives_the_same_cube(tmp_path: Path, change) -> None:
    contents = read(tmp_path, change(cube()).encode("utf-8", "surrogateescape"))
    assert volume(contents) == pytest.approx(1.0) and area(contents) == pytest.approx(6.0)
    assert contents.notes == () and not contents.splits


def test_concave_polygons_keep_their_area(tmp_path: Path) -> None:
    outline = "v 0 0 0\nv 40 0 0\nv 40 15 0\nv 15 15 0\nv 15 40 0\nv 0 40 0\n"
    for corners in ("1 2 3 4 5 6", "3 4 5 6 1 2", "6 5 4 3 2 1"):
        contents = read(tmp_path, f"{outline}f {corners}\n")
        assert area(contents) == pytest.approx(975.0)
        assert abs(normals(contents.parts[0]).sum(axis=0)[2]) == pytest.approx(2 * 975.0), "no triangle is flipped"


def test_each_face_may_leave_out_fields_of_its_corners(tmp_path: Path) -> None:
    text = (
        SQUARE
        + "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nf 1/1 2/2 3/3\nf 1//1 3//1 4//1\nf 1/1/1 2/2/1 3/3/1\nf 1/ 2// 3/3/\n"
    )
    contents = read(tmp_path, text)
    part = contents.parts[0]
    assert len(part.faces) == 4 and contents.splits
    assert contents.notes == ("2 of 4 faces have no texture coordinates and get 0 0",)
    lengths = np.linalg.norm(part.normals[part.faces], axis=2)
    np.testing.assert_array_equal(lengths, [[0, 0, 0], [1, 1, 1], [1, 1, 1], [0, 0, 0]])
    np.testing.assert_array_equal(part.uvs[0][part.faces[1]], [[0, 0]] * 3)
    np.testing.assert_array_equal(part.uvs[0][part.faces[0]], [[0, 1], [1, 1], [1, 0]])


def test_vertices_are_split_only_where_corners_differ(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 9 9\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 4/4 3/5 1/1\n"
    assert len(read(tmp_path, text).parts[0].positions) == 5


def test_texture_coordinates_of_one_and_three_numbers_or_not_finite(tmp_path: Path) -> None:
    contents = read(tmp_path, SQUARE + "vt .25\nvt 1 .5 7\nvt nan 0\nvt 1.#INF 0\nf 1/1 2/2 3/3 4/4\n")
    np.testing.assert_array_equal(contents.parts[0].uvs[0], [[0.25, 1], [1, 0.5], [0, 1], [0, 1]])
    assert contents.notes == ("2 texture coordinates are not finite numbers and become 0",)


def test_positions_that_are_not_finite_are_left_to_the_mesh_checks(tmp_path: Path) -> None:
    positions = read(tmp_path, "v 0 0 0\nv 1 0 nan\nv -1.#IND 1e400 0\nv 1 -nan(ind) 0\nf 1 2 3 4\n").parts[0].positions
    assert (~np.isfinite(positions)).sum() == 4


def test_vertex_colours_are_srgb(tmp_path: Path) -> None:
    contents = read(tmp_path, "v 0 0 0 1 0 .5\nv 1 0 0 0 0 0 1\nv 0 1 0\nf 1 2 3\n")
    np.testing.assert_allclose(contents.parts[0].colors, [[1, 0, 0.214041], [0, 0, 0], [1, 1, 1]], atol=1e-6)
    assert contents.notes == ("1 of 3 vertices have no colour and become white",)


def test_vertex_colours_from_0_to_255(tmp_path: Path) -> None:
    contents = read(tmp_path, "v 0 0 0 255 0 0\nv 1 0 0 0 0 0\nv 0 1 0 0 nan 300\nf 1 2 3\n")
    np.testing.assert_allclose(contents.parts[0].colors, [[1, 0, 0], [0, 0, 0], [1, 1, 1]])
    assert len(contents.notes) == 2


def test_vertex_colours_in_comments_of_zbrush(tmp_path: Path) -> None:
    painted = "#MRGB ffff0000ff00ff00\n#MRGB ff000000ffffffff\n"
    np.testing.assert_allclose(
        read(tmp_path, SQUARE + painted + "f 1 2 3 4\n").parts[0].colors, [[1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 1, 1]]
    )
    contents = read(tmp_path, SQUARE + "#MRGB ffff0000\nf 1 2 3 4\n")
    assert contents.parts[0].colors is None
    assert contents.notes == ("vertex colours (#MRGB) are left out: there are 1 for 4 vertices",)


def test_statements_that_are_left_out_are_counted(tmp_path: Path) -> None:
    text = (
        SQUARE
        + "v 9 9 9\nv 8 8 8 2\nl 1 2 3\np 1\np 2\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2 3\nend\n"
        + "F 1 2 3\nf 1 2\ncsh -x\nf 1 2 3 4\n"
    )
    assert read(tmp_path, text).notes == (
        "2 points are left out",
        "1 lines are left out",
        "2 free-form curves or surfaces are left out",
        "1 calls of other programs are left out",
        "1 lines are not understood and are left out ('F')",
        "weights of vertices (v x y z w) are ignored",
        "1 faces of fewer than three corners are left out",
        "2 unused vertices are left out",
    )


@pytest.mark.parametrize(
    ("statements", "noted"),
    [("s 1\nf 1 2 3\nf 1 3 4\n", False), ("s off\nf 1 2 3 4\n", True), ("s 1\nf 1 2 3\ns 2\nf 1 3 4\n", True)],
)
def test_smoothing_groups_with_hard_edges_are_noted(tmp_path: Path, statements: str, noted: bool) -> None:
    assert bool(read(tmp_path, SQUARE + statements).notes) == noted


def test_smoothing_groups_are_not_noted_if_faces_have_normals(tmp_path: Path) -> None:
    assert read(tmp_path, SQUARE + "vn 0 0 1\ns off\nf 1//1 2//1 3//1\ns 3\nf 1//1 3//1 4//1\n").notes == ()


def test_materials_become_parts(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl Material #25\nKd 0 1 0\n")
    text = (
        "mtllib a.mtl\n"
        + SQUARE
        + "f 1 2 3\nusemtl red # the red one\nf 1 3 4\nusemtl Material #25\nf 1 2 4\nusemtl red\nf 2 3 4\n"
    )
    contents = read(tmp_path, text)
    assert [(p.look.name, p.look.base_color, len(p.faces)) for p in contents.parts] == [
        ("", (1, 1, 1), 1),
        ("red", (1, 0, 0), 2),
        ("Material #25", (0, 1, 0), 1),
    ]
    assert contents.splits and contents.notes == ()


def test_missing_materials_are_noted(tmp_path: Path) -> None:
    contents = read(tmp_path, "mtllib gone.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    assert contents.notes == ("the material file 'gone.mtl' does not exist",)
    contents = read(tmp_path, SQUARE + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    assert contents.notes == ("no .mtl file describes materials a, b",)
    assert [part.look.name for part in contents.parts] == ["a", "b"]


@pytest.mark.parametrize(
    "statement", ["b.mtl a.mtl", "my file.mtl", "b.mtl my file.mtl", "C:\\x\\A.MTL", "sub/a.mtl # c"]
)
def test_material_files_in_other_spellings(tmp_path: Path, statement: str) -> None:
    for name in ("a.mtl", "my file.mtl"):
        (tmp_path / name).write_text("newmtl m\nKd 0.5 0.5 0.5\n")
    (tmp_path / "b.mtl").write_text("newmtl other\n")
    contents = read(tmp_path, f"mtllib {statement}\n{SQUARE}usemtl m\nf 1 2 3\n")
    assert contents.parts[0].look.base_color == (0.5, 0.5, 0.5) and contents.notes == (
        "1 unused vertices are left out",
    )


def test_a_damaged_material_file_does_not_hide_the_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_bytes(b"\0\1\2")
    (note,) = read(tmp_path, "mtllib a.mtl\n" + SQUARE + "f 1 2 3 4\n").notes
    assert note == f"materials left out: {tmp_path / 'a.mtl'}: damaged: it is not a text file"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SQUARE + "f 1 2 5\n", "line 5: vertex 5 does not exist (the file has 4)"),
        (SQUARE + "f 1 2 -5\n", "line 5: vertex -5 does not exist (the file has 4)"),
        ("f -1 -2 -3\n" + SQUARE, "line 1: vertex -1 does not exist (the file has 4)"),
        (SQUARE + "\n\nf 0 1 2\n", "line 7: vertex 0 does not exist (the file has 4)"),
        (SQUARE + "f 1/1 2/1 3/1\n", "line 5: texture coordinate 1 does not exist (the file has 0)"),
        (SQUARE + "f 1//0 2//0 3//0\n", "line 5: normal 0 does not exist (the file has 0)"),
        (SQUARE + "f 1 2 \\\n x\n", "line 6: 'x' is not a whole number"),
        (SQUARE + "f 1 2 3.0\n", "line 5: '3.0' is not a whole number"),
        (SQUARE + "f 1 2 1_0\n", "line 5: '1_0' is not a whole number"),
        (SQUARE + "f 1 2 99999999999999999999\n", "line 5: '99999999999999999999' is out of range"),
        (SQUARE + "f 1/2/3/4 2 3\n", "line 5: '1/2/3/4' is not a corner of a face"),
        (SQUARE + "f /1 2 3\n", "line 5: '/1' is not a corner of a face"),
        ("v 1,5 0 0\n", "line 1: '1,5' is not a number"),
        ("# c\nv 1 0\n", "line 2: 2 numbers where at least 3 are needed"),
        (SQUARE, "the mesh is empty: it has no faces, 4 vertices"),
        (SQUARE + "l 1 2\n", "the mesh is empty: it has no faces, 4 vertices; 1 lines are left out"),
        (SQUARE + "f 1 2\n", "the mesh is empty: no face has three corners"),
        (" \n", "the mesh is empty: it has no faces, 0 vertices"),
        ("", "the file is empty"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\r", "damaged: it is not a text file"),
    ],
)
def test_damage_is_one_line_with_the_location(tmp_path: Path, text: str | bytes, message: str) -> None:
    assert refuse(tmp_path, text) == message


def test_unicode_line_separators_do_not_break_a_message(tmp_path: Path) -> None:
    assert refuse(tmp_path, SQUARE + "f 1 2 \u2028\x85\n").endswith("is not a whole number")


def test_a_real_head_and_dragon(data: Path) -> None:
    dragon = read_obj(data / "stanford_dragon_100k.obj")
    assert sum(len(part.faces) for part in dragon.parts) == 100_000
    assert area(dragon) == pytest.approx(345.348746) and volume(dragon) == pytest.approx(155.74676)
    head = read_obj(data / "lee_perry_smith" / "LeePerrySmith.obj").parts[0]
    assert len(head.uvs[0]) == len(head.positions) == 35_368
