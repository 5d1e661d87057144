"""OBJ, PLY and STL files of other programs give the same picture as a plain file of the same surface."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import BLUE, RED, ball, checker, difference, differing, encoded, picture, scene_and_notes

from wgsss.errors import InputError
from wgsss.scene import Mesh, Scene, load_scene

Array = np.ndarray[Any, Any]

CORNERS = [(x, y, z) for x in (-15, 15) for y in (-15, 15) for z in (-15, 15)]
SIDES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]


def quiet(path: Path, **options: Any) -> Scene:
    """Load the scene of a file. Any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_scene(path, **options)


def volume(mesh: Mesh) -> float:
    a, b, c = mesh.positions[mesh.faces].astype(float).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


# --- OBJ: three boxes in a row, in every notation --------------------------------------------------------------------


def boxes(negative: bool = False, blocks: bool = False) -> str:
    """Return the text of three boxes: first all vertices and then all faces, or box by box."""
    vertices, faces = [], []
    for number, middle in enumerate((-40, 0, 40)):
        vertices.append([f"v {x + middle} {y} {z}" for x, y, z in CORNERS])
        base = 8 * number
        start = -9 if blocks else base - 25
        faces.append([f"f {' '.join(str(c + start if negative else c + base) for c in side)}" for side in SIDES])
    parts = [line for v, f in zip(vertices, faces, strict=True) for line in v + f] if blocks else []
    return "\n".join(parts or [line for block in (*vertices, *faces) for line in block]) + "\n"


def as_bytes(change: Callable[[str], str], encoding: str = "utf-8") -> bytes:
    return change(boxes()).encode(encoding)


WRITTEN: dict[str, bytes] = {
    "blocks of v and f with negative numbers": boxes(negative=True, blocks=True).encode(),
    "negative numbers at the end": boxes(negative=True).encode(),
    "blocks of v and f": boxes(blocks=True).encode(),
    "tabs": as_bytes(lambda t: t.replace(" ", "\t")),
    "tabs and spaces, before and after": as_bytes(
        lambda t: "".join(f" \t{line} \t \n" for line in t.replace(" ", "  \t ").splitlines())
    ),
    "a Latin-1 comment": as_bytes(lambda t: f"# Büste von Müller\n{t}", "latin-1"),
    "a byte order mark": b"\xef\xbb\xbf" + boxes().encode(),
    "lines that end as on Windows": as_bytes(lambda t: t.replace("\n", "\r\n")),
    "lines that end as on old Macs": as_bytes(lambda t: t.replace("\n", "\r")),
    "comments behind": as_bytes(lambda t: t.replace("\n", " # here\n")),
    "lines that go on": as_bytes(lambda t: t.replace(" ", " \\\n", 60)),
    "numbers with exponents": as_bytes(lambda t: t.replace("v -55 ", "v -5.5e+1 ").replace("v 55 ", "v +55. ")),
    "a weight after the position": as_bytes(lambda t: t.replace("\nf", "\nf", 1).replace(" 15\nv", " 15 1.0\nv")),
    "names of groups and objects": as_bytes(lambda t: f"o thing\ng a b\ns 1\n{t}"),
    "no line end at last": boxes().rstrip().encode(),
    "faces with empty fields": as_bytes(
        lambda t: "\n".join(
            "f " + " ".join(f"{c}//" for c in line.split()[1:]) if line.startswith("f") else line
            for line in t.splitlines()
        )
    ),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_every_notation_gives_the_same_three_boxes(tmp_path: Path, name: str) -> None:
    (tmp_path / "plain.obj").write_text(boxes())
    (tmp_path / "boxes.obj").write_bytes(WRITTEN[name])
    scene, plain = quiet(tmp_path / "boxes.obj"), quiet(tmp_path / "plain.obj")
    assert scene.bounds.tolist() == [[-55, -15, -15], [55, 15, 15]]
    assert volume(scene.objects[0].mesh) == pytest.approx(3 * 30**3)
    assert difference(scene, plain) == 0


L_SHAPE = [(0, 0), (40, 0), (40, 15), (15, 15), (15, 40), (0, 40)]


@pytest.mark.parametrize("start", range(6))
@pytest.mark.parametrize("plane", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_a_concave_polygon_covers_its_area(tmp_path: Path, start: int, plane: tuple[int, int, int]) -> None:
    """The faces of an L of six corners begin at any corner and face any axis."""
    outline = L_SHAPE[start:] + L_SHAPE[:start]
    points = [tuple(float(p) for p in np.array((*xy, z))[list(plane)]) for z in (0, 10) for xy in outline]
    sides = [(i + 1, (i + 1) % 6 + 1, (i + 1) % 6 + 7, i + 7) for i in range(6)]
    faces = [(7, 8, 9, 10, 11, 12), (6, 5, 4, 3, 2, 1), *sides]
    text = "\n".join(["v {} {} {}".format(*p) for p in points] + ["f " + " ".join(map(str, f)) for f in faces])
    (tmp_path / "l.obj").write_text(text)
    mesh = quiet(tmp_path / "l.obj").objects[0].mesh
    flat = 40 * 15 + 15 * 25
    assert mesh.area == pytest.approx(2 * flat + 10 * 160), "a fan from a wrong corner would have a larger area"
    assert volume(mesh) == pytest.approx(10 * flat)


# --- OBJ: textures ---------------------------------------------------------------------------------------------------


def ball_obj(mtl: str = "ball.mtl", without: float = 0.0) -> str:
    """Return the text of a ball, in mm. A share of its faces, `without`, has no texture coordinates."""
    points, uvs, faces = ball(50.0)
    lines = [f"mtllib {mtl}", "usemtl skin", *("v {} {} {}".format(*p) for p in points)]
    lines += [f"vt {u} {1 - v}" for u, v in uvs]
    for number, face in enumerate(faces + 1):
        bare = number < without * len(faces)
        lines.append("f " + " ".join(str(c) if bare else f"{c}/{c}" for c in face))
    return "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write a ball with a checker: an .obj file, its .mtl file, and an image in a subfolder."""
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "checker.png").write_bytes(encoded(checker()))
    (tmp_path / "ball.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd maps/checker.png\n")
    (tmp_path / "ball.obj").write_text(ball_obj())
    return tmp_path


@pytest.mark.parametrize(
    "name",
    [
        "maps/checker.png",
        "maps/Checker.PNG",
        "MAPS/CHECKER.png",
        "maps\\checker.png",
        ".\\maps\\Checker.png",
        "-clamp off maps/checker.png",
        "-s 1 1 1 -o 0 0 0 maps/checker.png",
        "C:\\work\\maps\\checker.png",
    ],
)
def test_a_texture_in_another_letter_case_or_with_other_slashes(folder: Path, name: str) -> None:
    """The texture is read or reported as missing."""
    plain = quiet(folder / "ball.obj")
    (folder / "ball.mtl").write_text(f"newmtl skin\nKd 1 1 1\nmap_Kd {name}\n")
    scene, lines = scene_and_notes(folder / "ball.obj")
    if scene.objects[0].material.maps.base_color is None:
        assert len(lines) == 1 and "checker.png" in lines[0].lower()
    else:
        assert difference(scene, plain) == 0
    if not name.startswith("C:"):
        assert scene.objects[0].material.maps.base_color is not None


def test_a_missing_texture_is_noted(folder: Path) -> None:
    (folder / "ball.mtl").write_text("newmtl skin\nmap_Kd maps/gone.png\n")
    scene, lines = scene_and_notes(folder / "ball.obj")
    assert len(lines) == 1 and "gone.png" in lines[0]
    assert scene.objects[0].material.maps.base_color is None


def test_a_missing_material_file_is_noted(folder: Path) -> None:
    (folder / "ball.mtl").unlink()
    assert any("'ball.mtl' does not exist" in line for line in scene_and_notes(folder / "ball.obj")[1])


def test_a_material_without_texture_has_its_colour(folder: Path) -> None:
    (folder / "ball.mtl").write_text("newmtl skin\nKd 0.2 0.4 0.8\n")
    assert quiet(folder / "ball.obj").objects[0].material.base_color != (1, 1, 1)


def test_half_of_the_faces_may_have_texture_coordinates(folder: Path) -> None:
    """These faces keep the texture, and the others are counted."""
    plain = quiet(folder / "ball.obj")
    (folder / "ball.obj").write_text(ball_obj(without=0.5))
    scene, lines = scene_and_notes(folder / "ball.obj")
    faces = len(ball()[2])
    assert [line for line in lines if f"{faces // 2} of {faces} faces" in line and "texture coordinates" in line]
    maps, mesh = scene.objects[0].material.maps, scene.objects[0].mesh
    assert maps.base_color is not None and mesh.corner_uvs is not None
    assert 0.1 < differing(scene, plain) < 0.5, "the lower half is unchanged"


def test_several_materials_are_several_bodies(folder: Path) -> None:
    """The upper half of a ball is red, and the lower half is blue."""
    for name, color in (("red", RED), ("blue", BLUE)):
        (folder / f"{name}.png").write_bytes(encoded(np.full((2, 2, 3), color, np.uint8)))
    (folder / "ball.mtl").write_text("newmtl red\nmap_Kd red.png\n\nnewmtl blue\nmap_Kd blue.png\n")
    lines = ball_obj().splitlines()
    faces = [line for line in lines if line.startswith("f")]
    rest = [line for line in lines if not line.startswith(("f", "usemtl"))]
    half = len(faces) // 2
    order = ball()[2].mean(axis=1).argsort().tolist()
    upper, lower = [faces[i] for i in order[:half]], [faces[i] for i in order[half:]]
    (folder / "ball.obj").write_text("\n".join([*rest, "usemtl red", *upper, "usemtl blue", *lower]))
    scene, lines = scene_and_notes(folder / "ball.obj")
    assert [o.mesh.name for o in scene.objects] == ["ball red", "ball blue"]
    assert all("boundary" in line for line in lines), "each half is open"
    seen = picture(scene)
    assert seen[14, 32, 0] > seen[14, 32, 2] and seen[50, 32, 2] > seen[50, 32, 0]


# --- PLY -------------------------------------------------------------------------------------------------------------


def ply(form: str, vertex: dict[str, tuple[str, Array]], extra_face: dict[str, tuple[str, int]] | None = None) -> bytes:
    """Write a ball as PLY. Its vertices have properties: the type and the values by name."""
    kinds = {"float": "f4", "double": "f8", "uchar": "u1", "ushort": "u2", "int": "i4", "float32": "f4", "uint8": "u1"}
    faces = ball()[2]
    order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}[form]
    rows = np.zeros(len(ball()[0]), [(name, order + kinds[kind]) for name, (kind, _) in vertex.items()])
    for name, (_, values) in vertex.items():
        rows[name] = values
    extra = extra_face or {}
    fields = [("count", "u1"), ("corners", order + "i4", (3,)), *((n, order + kinds[k]) for n, (k, _) in extra.items())]
    table = np.zeros(len(faces), fields)
    table["count"], table["corners"] = 3, faces
    for name, (_, value) in extra.items():
        table[name] = value
    head = ["ply", f"format {form} 1.0", "comment made by hand", f"element vertex {len(rows)}"]
    head += [f"property {kind} {name}" for name, (kind, _) in vertex.items()]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    head += [f"property {kind} {name}" for name, (kind, _) in extra.items()]
    text = "\n".join([*head, "end_header\n"]).encode()
    if form != "ascii":
        return text + rows.tobytes() + table.tobytes()
    lines = [" ".join(str(v) for v in row) for row in rows.tolist()]
    lines += [f"3 {' '.join(map(str, row[1]))} {' '.join(str(v) for v in row.tolist()[2:])}" for row in table]
    return text + "\n".join(lines).encode()


def places(kind: str = "float") -> dict[str, tuple[str, Array]]:
    return {axis: (kind, 50 * ball(1.0)[0][:, i]) for i, axis in enumerate("xyz")}


FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]


@pytest.fixture
def plain_ply(tmp_path: Path) -> Scene:
    (tmp_path / "plain.ply").write_bytes(ply("binary_little_endian", places()))
    return scene_and_notes(tmp_path / "plain.ply")[0]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["float", "double", "float32"])
def test_ply_of_every_format_and_type(tmp_path: Path, plain_ply: Scene, form: str, kind: str) -> None:
    (tmp_path / "ball.ply").write_bytes(ply(form, places(kind)))
    assert difference(scene_and_notes(tmp_path / "ball.ply")[0], plain_ply) == 0


@pytest.mark.parametrize("form", FORMS)
def test_unknown_properties_of_faces_are_named(tmp_path: Path, plain_ply: Scene, form: str) -> None:
    (tmp_path / "ball.ply").write_bytes(ply(form, places(), {"material_index": ("int", 7), "quality": ("float", 2)}))
    scene, lines = scene_and_notes(tmp_path / "ball.ply")
    assert difference(scene, plain_ply) == 0
    naming = [line for line in lines if "material_index" in line and "quality" in line]
    assert len(naming) == 1


@pytest.mark.parametrize(("kind", "top"), [("uchar", 255), ("ushort", 65535), ("float", 1.0)])
@pytest.mark.parametrize("form", ["ascii", "binary_big_endian"])
def test_vertex_colours_of_ply_are_the_base_colour(tmp_path: Path, form: str, kind: str, top: float) -> None:
    """Vertices are red above and blue below. Other properties are named in a note."""
    share = ball()[1][:, 1]
    shades = {"red": 1 - share, "green": 0 * share, "blue": share}
    colors = {name: (kind, np.round(top * s) if top > 1 else s) for name, s in shades.items()}
    vertex = {**places(), "quality": ("float", np.arange(len(share))), **colors}
    (tmp_path / "ball.ply").write_bytes(ply(form, vertex))
    scene, lines = scene_and_notes(tmp_path / "ball.ply")
    assert scene.objects[0].mesh.corner_colors is not None
    seen = picture(scene)
    assert seen[12, 32, 0] > 1.2 * seen[12, 32, 2] and seen[52, 32, 2] > 1.2 * seen[52, 32, 0]
    assert [line for line in lines if "quality" in line and "red" not in line]


def test_ply_faces_may_be_strips(tmp_path: Path) -> None:
    """The Stanford archive stores all faces as one list of strips, separated by -1."""
    text = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    text += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    text += "\n".join("{} {} {}".format(*c) for c in CORNERS)
    strips = [s for a, b, c, d in SIDES for s in (a - 1, b - 1, d - 1, c - 1, -1)]
    (tmp_path / "box.ply").write_text(f"{text}\n{len(strips)} {' '.join(map(str, strips))}\n")
    mesh = quiet(tmp_path / "box.ply").objects[0].mesh
    assert len(mesh.faces) == 12 and volume(mesh) == pytest.approx(30**3)


# --- STL -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("head", [b"solid made by a program that lies", b"solid", b"\0" * 80])
def test_binary_stl_with_any_header(tmp_path: Path, plain_ply: Scene, head: bytes) -> None:
    points, _, faces = ball(50.0)
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(points[face]), 0) for face in faces)
    (tmp_path / "ball.stl").write_bytes(head.ljust(80, b" ") + struct.pack("<I", len(faces)) + body)
    assert difference(quiet(tmp_path / "ball.stl"), plain_ply) <= 1


# --- shapes ----------------------------------------------------------------------------------------------------------


def test_a_third_face_at_an_edge_is_kept_and_noted(tmp_path: Path) -> None:
    (tmp_path / "fin.obj").write_text(boxes() + "v 0 40 0\nf 3 4 25\n")
    scene, lines = scene_and_notes(tmp_path / "fin.obj")
    assert len(scene.objects[0].mesh.faces) == 37 and scene.bounds[1, 1] == 40
    assert len(lines) == 1 and "1 edge of more than two faces" in lines[0]


def test_files_that_are_no_meshes_are_errors(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("hello\n")
    with pytest.raises(InputError, match=r"a\.obj: the mesh is empty"):
        load_scene(tmp_path / "a.obj")
