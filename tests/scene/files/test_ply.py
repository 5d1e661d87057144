"""PLY: ASCII and both byte orders, all known names, notes on data that are left out, and errors with a location."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.ply import read_ply

FORMS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LETTERS = {
    **{"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d"},
    **{"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f"},
    "float64": "d",
}
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
XYZ = ["float x", "float y", "float z"]
INDICES = "list uchar int vertex_indices"
VERTICES = ("vertex", XYZ, SQUARE)
FACES = ("face", [INDICES], [([0, 1, 2, 3],)])


def ply(form: str, *elements, comments: tuple[str, ...] = (), end: str = "\n") -> bytes:
    """Make a file of elements (name, properties, rows). A row has a number or a list for each property."""
    lines = ["ply", f"format {form} 1.0", *comments]
    body = b""
    for name, properties, rows in elements:
        lines += [f"element {name} {len(rows)}", *(f"property {p}" for p in properties)]
        for row in rows:
            values, letters = [], ""
            for value, declared in zip(row, properties, strict=True):
                types = declared.split()
                if types[0] == "list":
                    values += [len(value), *value]
                    letters += LETTERS[types[1]] + LETTERS[types[2]] * len(value)
                else:
                    values.append(value)
                    letters += LETTERS[types[0]]
            body += (
                struct.pack(FORMS[form] + letters, *values)
                if FORMS[form]
                else (" ".join(map(str, values)) + end).encode()
            )
    return end.join([*lines, "end_header", ""]).encode() + body


def read(folder: Path, data: bytes) -> Contents:
    """Read a file. Any warning is an error."""
    path = folder / "mesh.ply"
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_ply(path)


def refuse(folder: Path, data: bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, data)
    message, path = str(caught.value), f"{folder / 'mesh.ply'}: "
    assert message.startswith(path) and len(message.splitlines()) == 1
    return message.removeprefix(path)


def area(contents: Contents) -> float:
    total = 0.0
    for part in contents.parts:
        a, b, c = (part.positions[part.faces[:, i]] for i in range(3))
        total += float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    return total


every_form = pytest.mark.parametrize("form", FORMS)


@every_form
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_forms_and_line_ends(tmp_path: Path, form: str, end: str) -> None:
    contents = read(tmp_path, ply(form, VERTICES, FACES, end=end))
    np.testing.assert_array_equal(contents.parts[0].positions, SQUARE)
    assert area(contents) == 1.0 and contents.notes == () and not contents.splits


@every_form
def test_a_binary_body_may_start_like_a_line_end(tmp_path: Path, form: str) -> None:
    lead = ("lead", ["uchar a"], [(10,)])
    for end in ("\n", "\r"):
        assert area(read(tmp_path, ply(form, lead, VERTICES, FACES, end=end))) == 1.0


@every_form
@pytest.mark.parametrize("kind", ["char", "uint8", "short", "uint16", "int32", "uint", "float64", "float32"])
@pytest.mark.parametrize("length", ["int8", "uchar", "ushort", "int16", "uint", "int32"])
def test_types_in_both_spellings(tmp_path: Path, form: str, kind: str, length: str) -> None:
    vertices = ("vertex", [f"{kind} x", f"{kind} y", "double z"], SQUARE)
    faces = ("face", [f"list {length} {kind if kind[0] != 'f' else 'int'} vertex_index"], [([0, 1, 2],), ([0, 2, 3],)])
    assert area(read(tmp_path, ply(form, vertices, faces))) == 1.0


@every_form
def test_faces_of_mixed_sizes_between_other_properties(tmp_path: Path, form: str) -> None:
    outline = [(0, 0, 0), (4, 0, 0), (4, 1, 0), (1, 1, 0), (1, 4, 0), (0, 4, 0)]
    properties = ["uchar flags", "list uchar float weights", INDICES, "short group"]
    rows = [(1, [0.5], [0, 1, 2, 3, 4, 5], 3), (2, [], [0, 1, 2], 4), (3, [1, 2, 3], [0, 1], 5), (4, [], [], 6)]
    contents = read(tmp_path, ply(form, ("vertex", XYZ, outline), ("face", properties, rows)))
    assert area(contents) == pytest.approx(7.0 + 2.0)
    assert contents.notes == (
        "2 faces of fewer than three corners are left out",
        "properties of element face are left out: flags, weights, group",
    )


@every_form
def test_unknown_elements_before_between_and_after(tmp_path: Path, form: str) -> None:
    data = ply(
        form,
        ("camera", ["float view_px", "list uchar short frames"], [(1.5, [1, 2]), (2.5, [])]),
        VERTICES,
        ("material", ["int a"], []),
        ("multi part", ["list int double v"], [([],), ([1, 2],)]),
        ("nothing", [], [() for _ in range(3)]),
        FACES,
        ("edge", ["int vertex1", "int vertex2"], [(0, 1)]),
        comments=("comment end_header", "obj_info scanned", "comment", ""),
    )
    contents = read(tmp_path, data)
    assert area(contents) == 1.0
    assert contents.notes == (
        "2 rows of element camera are left out",
        "2 rows of element multi part are left out",
        "1 rows of element edge are left out",
    )


@every_form
@pytest.mark.parametrize("index", ["int", "uint"])
def test_strips_of_triangles_keep_one_winding(tmp_path: Path, form: str, index: str) -> None:
    grid = [(x, y, 0) for x in range(5) for y in range(2)]
    again = -1 if index == "int" else 2**32 - 1
    strips = [([1, 0, 3, 2, 5, 4, again, 5, 4, 7, 6],), ([7, 6, 9, 8, 8],)]
    contents = read(
        tmp_path, ply(form, ("vertex", XYZ, grid), ("tristrips", [f"list int {index} vertex_indices"], strips))
    )
    part = contents.parts[0]
    a, b, c = (part.positions[part.faces[:, i]] for i in range(3))
    np.testing.assert_array_equal(np.cross(b - a, c - a), [[0, 0, 1]] * 8)


@every_form
def test_strips_beside_faces(tmp_path: Path, form: str) -> None:
    strips = ("tristrips", ["list int int vertex_indices"], [([0, 1, 3],)])
    for faces in (("face", [INDICES], [([1, 2, 3],)]), ("face", [INDICES], [])):
        assert area(read(tmp_path, ply(form, VERTICES, faces, strips))) == len(faces[2]) * 0.5 + 0.5


@every_form
@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v", "S T"])
@pytest.mark.parametrize("kind", ["float", "double"])
def test_texture_coordinates_and_normals_of_vertices(tmp_path: Path, form: str, names: str, kind: str) -> None:
    extra = [*(f"{kind} {n}" for n in ("nx", "ny", "nz")), *(f"{kind} {n}" for n in names.split())]
    rows = [(*p, 0, 0, 2, p[0], 0.25) for p in SQUARE]
    contents = read(tmp_path, ply(form, ("vertex", XYZ + extra, rows), FACES))
    part = contents.parts[0]
    np.testing.assert_array_equal(part.uvs[0], [[p[0], 0.75] for p in SQUARE])
    np.testing.assert_array_equal(part.normals, [[0, 0, 2]] * 4)
    assert contents.splits and contents.notes == ()


@every_form
def test_texture_coordinates_of_corners_split_vertices(tmp_path: Path, form: str) -> None:
    rows = [([0, 1, 2], [0, 0, 1, 0, 1, 1]), ([0, 2, 3], [0, 0, 0.5, 0.5, 0, 1]), ([3, 1, 2], [])]
    faces = ("face", [INDICES, "list uchar float texcoord"], rows)
    contents = read(tmp_path, ply(form, VERTICES, faces))
    part = contents.parts[0]
    np.testing.assert_array_equal(part.positions[part.faces], np.array(SQUARE)[[[0, 1, 2], [0, 2, 3], [3, 1, 2]]])
    np.testing.assert_array_equal(part.uvs[0][part.faces[1]], [[0, 1], [0.5, 0.5], [0, 0]])
    assert contents.notes == ("1 of 3 faces have no texture coordinates and get 0 0",)
    assert part.faces[0, 0] == part.faces[1, 0] and part.faces[0, 2] != part.faces[1, 1]


@every_form
def test_each_texture_gives_a_part(tmp_path: Path, form: str) -> None:
    for name in ("skin.png", "my eye.png"):
        (tmp_path / name).write_bytes(b"x")
    rows = [([0, 1, 2], [0] * 6, 1), ([0, 2, 3], [1] * 6, 0), ([0, 1, 3], [0] * 6, -1), ([1, 2, 3], [0] * 6, 2)]
    faces = ("face", [INDICES, "list uchar float texcoord", "int texnumber"], rows)
    comments = ("comment TextureFile Skin.PNG", "comment TextureFile my eye.png", "comment TextureFile gone.png")
    contents = read(tmp_path, ply(form, VERTICES, faces, comments=comments))
    maps = [part.look.base_color_map for part in contents.parts]
    assert [texture and texture.name for texture in maps] == [None, "skin.png", "my eye.png", None]
    assert [len(part.faces) for part in contents.parts] == [1, 1, 1, 1]
    assert contents.notes == ("the texture 'gone.png' does not exist and is left out",)


def test_one_texture_gives_one_part(tmp_path: Path) -> None:
    (tmp_path / "t.png").write_bytes(b"x")
    vertices = ("vertex", [*XYZ, "float s", "float t"], [(*p, 0, 0) for p in SQUARE])
    contents = read(tmp_path, ply("ascii", vertices, FACES, comments=("comment TextureFile t.png",)))
    texture = contents.parts[0].look.base_color_map
    assert texture is not None and texture.source == tmp_path / "t.png"


@every_form
@pytest.mark.parametrize("names", ["red green blue alpha", "diffuse_red diffuse_green diffuse_blue", "r g b a"])
@pytest.mark.parametrize(("kind", "full"), [("uchar", 255), ("ushort", 65535), ("float", None)])
def test_colours_of_vertices(tmp_path: Path, form: str, names: str, kind: str, full: int | None) -> None:
    """Integers are sRGB; floating-point colours are linear."""
    values = [1, 0.2, 0, 1] if full is None else [full, full // 5, 0, full]
    named = names.split()
    rows = [(*p, *values[: len(named)]) for p in SQUARE]
    contents = read(tmp_path, ply(form, ("vertex", XYZ + [f"{kind} {n}" for n in named], rows), FACES))
    green = 0.2 if full is None else 0.0331048
    np.testing.assert_allclose(contents.parts[0].colors, [[1, green, 0]] * 4, atol=1e-6)
    assert contents.notes == ()


def test_colours_out_of_range_are_clipped(tmp_path: Path) -> None:
    rows = [(0, 0, 0, 255, 0, 0), (1, 0, 0, 0, 0, 0), (1, 1, 0, 127.5, 0, 0), (0, 1, 0, float("nan"), 0, 0)]
    contents = read(tmp_path, ply("ascii", ("vertex", [*XYZ, "float red", "float green", "float blue"], rows), FACES))
    np.testing.assert_allclose(contents.parts[0].colors[:, 0], [1, 0, 0.214041, 1], atol=1e-6)
    assert len(contents.notes) == 2


def test_elements_and_properties_that_are_left_out_are_named(tmp_path: Path) -> None:
    vertices = (
        "vertex",
        [*XYZ, "uchar red", "uchar green", "uchar blue", "uchar alpha", "float quality"],
        [(*p, 1, 2, 3, 4, 5) for p in SQUARE],
    )
    faces = ("face", [INDICES, "uchar red", "uchar green", "uchar blue"], [([0, 1, 2, 3], 1, 2, 3)])
    assert read(tmp_path, ply("binary_little_endian", vertices, faces)).notes == (
        "properties of element vertex are left out: alpha, quality",
        "properties of element face are left out: red, green, blue",
    )


@pytest.mark.parametrize("names", [("Vertex", "Face", "vertex_indices"), ("vertices", "faces", "corners")])
def test_odd_names(tmp_path: Path, names: tuple[str, str, str]) -> None:
    vertex, face, indices = names
    faces = (face, ["list uchar float weights", f"list uchar int {indices}"], [([0.5], [0, 1, 2, 3])])
    vertices = (vertex, ["float X", "float Y", "float Z"], SQUARE)
    assert area(read(tmp_path, ply("binary_little_endian", vertices, faces))) == 1.0


@every_form
def test_positions_that_are_not_finite_are_left_to_the_mesh_checks(tmp_path: Path, form: str) -> None:
    vertices = ("vertex", XYZ, [*SQUARE[:3], (float("nan"), float("inf"), 0)])
    assert (~np.isfinite(read(tmp_path, ply(form, vertices, FACES)).parts[0].positions)).sum() == 2


def test_trailing_lines_and_blank_lines(tmp_path: Path) -> None:
    data = ply("ascii", VERTICES, FACES)
    head, body = data.split(b"end_header\n")
    assert area(read(tmp_path, head + b"end_header\n" + body.replace(b"\n", b"\n\n \n") + b"\n\n")) == 1.0
    assert area(read(tmp_path, data.rstrip())) == 1.0
    assert read(tmp_path, data + b"1 2 3\n").notes == ("1 lines after the last element are left out",)
    binary = ply("binary_big_endian", VERTICES, FACES)
    assert read(tmp_path, binary + b"more").notes == ("4 bytes after the last element are left out",)


@every_form
def test_point_clouds_and_no_faces(tmp_path: Path, form: str) -> None:
    for elements in ([VERTICES], [VERTICES, ("face", [INDICES], [])]):
        assert refuse(tmp_path, ply(form, *elements)) == "the mesh is empty: it has no faces, 4 points"
    lines = ("face", [INDICES], [([0, 1],)])
    assert refuse(tmp_path, ply(form, VERTICES, lines)) == "the mesh is empty: no face has three corners"


@every_form
@pytest.mark.parametrize("count", [10**6, 10**12, 10**30])
def test_more_rows_than_the_file_holds(tmp_path: Path, form: str, count: int) -> None:
    data = ply(form, VERTICES, FACES)
    for element in (b"vertex 4", b"face 1"):
        message = refuse(tmp_path, data.replace(element, element[:-1] + str(count).encode()))
        name = element.split()[0].decode()
        assert message == f"truncated: it has fewer than {count} rows of element {name}"


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian"])
def test_lists_longer_than_the_file(tmp_path: Path, form: str) -> None:
    faces = ("face", ["list uint int vertex_indices"], [([0, 1, 2],), ([0, 1, 2, 3],)])
    data = ply(form, VERTICES, faces)
    at = len(data) - 5 * 4
    assert refuse(tmp_path, data[:at] + b"\xff" * 4 + data[at + 4 :]).startswith("truncated: it has fewer than 2 rows")
    signed = data.replace(b"list uint", b"list int")
    at = len(signed) - 5 * 4
    assert refuse(tmp_path, signed[:at] + b"\xff" * 4 + signed[at + 4 :]) == "damaged: row 2 of element face"


@every_form
def test_truncation_anywhere(tmp_path: Path, form: str) -> None:
    data = ply(form, VERTICES, ("face", [INDICES, "uchar flags"], [([0, 1, 2], 77), ([0, 1, 2, 3], 77)]))
    for size in range(len(data) - 2):
        refuse(tmp_path, data[:size])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"3 0 1 2", b"3 0 1 9", "row 1 of element face: vertex 9 does not exist (there are 4)"),
        (b"3 0 1 2", b"3 0 1 -1", "row 1 of element face: vertex -1 does not exist (there are 4)"),
        (b"3 0 1 2", b"3 0 1 1.5", "row 1 of element face: vertex 1.5 does not exist (there are 4)"),
        (b"3 0 1 2", b"3 0 1 nan", "row 1 of element face: vertex nan does not exist (there are 4)"),
        (b"3 0 1 2", b"4 0 1 2", "line 14: its numbers do not fit the properties of element face"),
        (b"3 0 1 2", b"3 0 1 2 3", "line 14: its numbers do not fit the properties of element face"),
        (b"3 0 1 2", b"-3 0 1 2", "line 14: its numbers do not fit the properties of element face"),
        (b"1 0 0\n", b"1 0\n", "line 11: its numbers do not fit the properties of element vertex"),
        (b"1 0 0\n", b"1 x 0\n", "line 11: 'x' is not a number"),
        (b"float x", b"foat x", "line 4: 'property foat x' is not understood"),
        (b"list uchar int", b"list float int", "line 8: 'property list float int vertex_indices' is not understood"),
        (b"list uchar int", b"list uchar", "line 8: 'property list uchar vertex_indices' is not understood"),
        (b"vertex 4", b"vertex -4", "line 3: 'element vertex -4' is not understood"),
        (b"vertex 4", b"vertex", "line 3: 'element vertex' is not understood"),
        (b"vertex 4", b"vertex 4.5", "line 3: 'element vertex 4.5' is not understood"),
        (b"format ascii", b"format ebcdic", "line 2: 'format ebcdic 1.0' is not understood"),
        (b"format ascii 1.0", b"comment", "damaged: the header names no format"),
        (b"element vertex 4\n", b"", "line 3: 'property float x' is not understood"),
        (b"float x", b"float a", "damaged: there is no element vertex with the properties x, y and z"),
        (b"end_header", b"end", "damaged: the header does not end with 'end_header'"),
        (b"ply\n", b"plx\n", "damaged, or not a .ply file: its first line is not 'ply'"),
    ],
)
def test_damage_is_one_line_with_the_location(tmp_path: Path, old: bytes, new: bytes, message: str) -> None:
    data = ply("ascii", ("vertex", XYZ, SQUARE), ("face", [INDICES], [([0, 1, 2],)]))
    assert old in data
    assert refuse(tmp_path, data.replace(old, new, 1)) == message


@every_form
def test_wrong_numbers_of_texture_coordinates_are_errors(tmp_path: Path, form: str) -> None:
    faces = ("face", [INDICES, "list uchar float texcoord"], [([0, 1, 2], [0] * 6), ([0, 1, 2], [0] * 5)])
    assert refuse(tmp_path, ply(form, VERTICES, faces)) == "row 2 of element face: 5 texture coordinates for 3 corners"


def test_real_meshes(data: Path) -> None:
    bunny = read_ply(data / "bunny_stanford.ply")
    assert len(bunny.parts[0].faces) == 69_451 and area(bunny) == pytest.approx(0.057129, rel=1e-4)
