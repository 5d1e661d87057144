"""Meshes from files of every format: seams and hard edges are kept, repairs are counted, and errors name the file."""

from __future__ import annotations

import re
import struct
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from wgsss.errors import InputError
from wgsss.scene import LoadedMesh, Mesh, load_mesh

PLY_HEAD = """ply
format ascii 1.0
element vertex {vertices}
property float x
property float y
property float z
{extra}element face {faces}
property list uchar int vertex_indices
{corner}end_header
"""

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")


def quiet_load(path: Path, **options: Any) -> LoadedMesh:
    """Load a mesh. Any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_mesh(path, **options)


def load_with_warning(path: Path, **options: Any) -> tuple[LoadedMesh, str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        loaded = load_mesh(path, **options)
    assert len(caught) == 1, "all repairs are in one warning"
    text = str(caught[0].message)
    assert text.startswith(f"{path.name}: ") and "\n" not in text
    return loaded, text


def export(mesh: trimesh.Trimesh | trimesh.Scene, path: Path) -> Path:
    if path.suffix == ".gltf":
        for name, content in trimesh.Scene(mesh).export(file_type="gltf").items():
            (path.parent / (path.name if name == "model.gltf" else name)).write_bytes(content)
    else:
        mesh.export(path)
    return path


def write_off(path: Path, vertices: Any, faces: Any) -> Path:
    """Write an OFF file with these vertices and faces."""
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(f"{x:.9g}" for x in v) for v in vertices]
    lines += [" ".join(map(str, [len(f), *f])) for f in faces]
    path.write_text("\n".join(lines))
    return path


def box() -> trimesh.Trimesh:
    return trimesh.creation.box((2, 3, 4))


def ball(radius: float = 1.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(2, radius)


def edge_uses(mesh: Mesh) -> Counter:
    """Count the edges by their number of faces: {2: n} for a closed manifold."""
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, 1)], -1).reshape(-1, 2), 1)
    return Counter(np.unique(edges, axis=0, return_counts=True)[1].tolist())


def volume(mesh: Mesh) -> float:
    a, b, c = mesh.positions[mesh.faces].astype(float).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


# --- formats ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_all_formats_give_the_same_welded_mesh(tmp_path: Path, suffix: str) -> None:
    path = export(box(), tmp_path / f"box{suffix}")
    scale = 1000 if suffix in (".glb", ".gltf") else 1  # glTF is in metres
    mesh = quiet_load(path).mesh
    assert mesh.name == "box"
    assert (mesh.positions.shape, mesh.faces.shape) == ((8, 3), (12, 3))
    assert (mesh.positions.dtype, mesh.faces.dtype) == (np.float32, np.int32)
    assert mesh.area == pytest.approx(52 * scale**2)
    assert volume(mesh) == pytest.approx(24 * scale**3)
    np.testing.assert_allclose(mesh.bounds, np.array([[-1, -1.5, -2], [1, 1.5, 2]]) * scale)
    assert edge_uses(mesh) == {2: 18}


def test_a_file_extension_in_capitals(tmp_path: Path) -> None:
    assert len(quiet_load(export(box(), tmp_path / "box.ply").rename(tmp_path / "BOX.PLY")).mesh.faces) == 12


def test_units_and_size(tmp_path: Path) -> None:
    ply, glb = export(box(), tmp_path / "box.ply"), export(box(), tmp_path / "box.glb")
    assert np.ptp(quiet_load(ply, mm_per_unit=10).mesh.bounds, axis=0).tolist() == [20, 30, 40]
    assert np.ptp(quiet_load(glb, mm_per_unit=10).mesh.bounds, axis=0).tolist() == [20, 30, 40]
    for path in (ply, glb):
        sized = quiet_load(path, size_mm=200, mm_per_unit=7).mesh
        np.testing.assert_allclose(np.ptp(sized.bounds, axis=0), [100, 150, 200], rtol=1e-6)


def test_quads_and_larger_faces_are_triangulated(tmp_path: Path) -> None:
    path = tmp_path / "prism.obj"
    corners = [(np.cos(a), np.sin(a), z) for z in (0, 2) for a in np.arange(6) * np.pi / 3]
    sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
    faces = [tuple(range(5, -1, -1)), tuple(range(6, 12)), *sides]
    path.write_text(
        "\n".join(["v {} {} {}".format(*c) for c in corners] + ["f " + " ".join(str(i + 1) for i in f) for f in faces])
    )
    mesh = quiet_load(path).mesh
    assert len(mesh.faces) == 2 * 4 + 6 * 2
    assert volume(mesh) == pytest.approx(2 * 1.5 * 3**0.5, rel=1e-6)


@pytest.mark.parametrize("form", ["off", "ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("sizes", [(3, 4), (4, 5), (3, 4, 5), (5,)])
def test_faces_of_different_sizes_are_triangulated(tmp_path: Path, form: str, sizes: tuple[int, ...]) -> None:
    """A file has prisms over polygons: triangles, quads and pentagons in every combination."""
    vertices: list[tuple] = []
    faces: list[list[int]] = []
    for i, n in enumerate(sizes):
        at, turns = len(vertices), np.arange(n) * 2 * np.pi / n
        vertices += [(3 * i + np.cos(a), np.sin(a), z) for z in (0, 1) for a in turns]
        faces += [[at + j for j in reversed(range(n))], [at + n + j for j in range(n)]]
        faces += [[at + j, at + (j + 1) % n, at + n + (j + 1) % n, at + n + j] for j in range(n)]
    if form == "off":
        path = write_off(tmp_path / "prisms.off", vertices, faces)
    else:
        path = tmp_path / "prisms.ply"
        head = PLY_HEAD.format(vertices=len(vertices), faces=len(faces), extra="", corner="").replace("ascii", form)
        if form == "ascii":
            body = "\n".join(" ".join(map(str, row)) for row in [*vertices, *([len(f), *f] for f in faces)]).encode()
        else:
            order = "<" if "little" in form else ">"
            body = b"".join(struct.pack(f"{order}3f", *v) for v in vertices)
            body += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
        path.write_bytes(head.encode() + body)
    mesh = quiet_load(path).mesh
    assert len(mesh.faces) == sum(4 * n - 4 for n in sizes)
    assert volume(mesh) == pytest.approx(sum(n / 2 * np.sin(2 * np.pi / n) for n in sizes), rel=1e-5)


def test_scene_graph_places_and_mirrors_the_parts(tmp_path: Path) -> None:
    mirror = np.diag([-2.0, 1, 1, 1])
    mirror[:3, 3] = 10, 0, 0
    scene = trimesh.Scene()
    scene.add_geometry(box(), geom_name="a")
    scene.add_geometry(ball(), geom_name="b", transform=mirror)
    mesh = quiet_load(export(scene, tmp_path / "two.glb"), mm_per_unit=1).mesh
    assert len(mesh.faces) == 12 + 320
    np.testing.assert_allclose(mesh.bounds, [[-1, -1.5, -2], [12, 1.5, 2]], atol=1e-6)
    assert volume(mesh) == pytest.approx(24 + 2 * ball().volume, rel=1e-5), "a mirrored part is not inside out"


def test_touching_parts_are_welded_in_any_placement(tmp_path: Path) -> None:
    ring, matrix = ball(), trimesh.transformations.euler_matrix(0.3, 1.1, -0.7)
    matrix[:3, 3] = 0.123, 4.56, -7.89
    scene = trimesh.Scene()
    for name, keep in (("upper", ring.triangles_center[:, 2] > 0), ("lower", ring.triangles_center[:, 2] <= 0)):
        half = trimesh.Trimesh(ring.vertices, ring.faces[keep], process=False)
        half.remove_unreferenced_vertices()
        scene.add_geometry(half, geom_name=name, transform=matrix)
    mesh = quiet_load(export(scene, tmp_path / "halves.glb")).mesh
    assert len(mesh.positions) == len(ring.vertices)
    assert edge_uses(mesh) == {2: 480}


# --- texture coordinates and normals ---------------------------------------------------------------------------------

# Two squares share an edge, and have different texture coordinates on its two sides.
SEAM = """
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 1 0 -1
v 1 1 -1
vt 0.0 0.0
vt 0.4 0.0
vt 0.4 0.25
vt 0.0 0.25
vt 0.6 0.5
vt 1.0 0.5
vt 1.0 1.0
vt 0.6 1.0
f 1/1 2/2 3/3 4/4
f 2/5 5/6 6/7 3/8
"""
SEAM_UVS = {  # (face normal, position) -> u right, v down
    ("z", (0, 0, 0)): (0.0, 1.0),
    ("z", (1, 0, 0)): (0.4, 1.0),
    ("z", (1, 1, 0)): (0.4, 0.75),
    ("z", (0, 1, 0)): (0.0, 0.75),
    ("x", (1, 0, 0)): (0.6, 0.5),
    ("x", (1, 0, -1)): (1.0, 0.5),
    ("x", (1, 1, -1)): (1.0, 0.0),
    ("x", (1, 1, 0)): (0.6, 0.0),
}


def check_seam(mesh: Mesh) -> None:
    assert (len(mesh.positions), len(mesh.faces)) == (6, 4)
    assert edge_uses(mesh) == {1: 6, 2: 3}, "the two squares stay connected at the seam"
    assert mesh.corner_uvs is not None and mesh.corner_uvs.dtype == np.float32
    for normal, face, uvs in zip(mesh.face_normals, mesh.faces, mesh.corner_uvs, strict=True):
        side = "z" if abs(normal[2]) > 0.5 else "x"
        for position, uv in zip(mesh.positions[face], uvs, strict=True):
            np.testing.assert_allclose(uv, SEAM_UVS[side, tuple(position.astype(int).tolist())], atol=1e-6)


def test_obj_keeps_its_texture_seams(tmp_path: Path) -> None:
    path = tmp_path / "seam.obj"
    path.write_text(SEAM)
    check_seam(load_with_warning(path)[0].mesh)


@pytest.mark.parametrize("suffix", [".glb", ".ply"])
def test_other_formats_keep_texture_seams(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "seam.obj").write_text(SEAM)
    source = trimesh.load_mesh(tmp_path / "seam.obj", process=False)
    check_seam(load_with_warning(export(source, tmp_path / f"seam{suffix}"), mm_per_unit=1)[0].mesh)


def test_ply_with_texture_coordinates_per_corner(tmp_path: Path) -> None:
    corner = "property list uchar float texcoord\n"
    path = tmp_path / "seam.ply"
    path.write_text(
        PLY_HEAD.format(vertices=6, faces=4, extra="", corner=corner)
        + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n1 0 -1\n1 1 -1\n"
        + "3 0 1 2 6 0 0 .4 0 .4 .25\n3 0 2 3 6 0 0 .4 .25 0 .25\n"
        + "3 1 4 5 6 .6 .5 1 .5 1 1\n3 1 5 2 6 .6 .5 1 1 .6 1\n"
    )
    check_seam(load_with_warning(path)[0].mesh)


def test_ply_normals_stay_with_their_vertices_if_there_are_texture_coordinates(tmp_path: Path) -> None:
    """The order of the vertices differs from that of their texture coordinates."""
    normals = trimesh.creation.box().face_normals
    rows, faces = [], []
    for i, triangle in enumerate(reversed(trimesh.creation.box().triangles)):
        faces.append(f"3 {3 * i} {3 * i + 1} {3 * i + 2}")
        rows += [[*p, *normals[11 - i], (37 * i % 12) / 12, j / 3] for j, p in enumerate(triangle)]
    extra = "".join(f"property float {name}\n" for name in ("nx", "ny", "nz", "s", "t"))
    path = tmp_path / "box.ply"
    text = [" ".join(map(str, row)) for row in rows] + faces
    path.write_text(PLY_HEAD.format(vertices=36, faces=12, extra=extra, corner="") + "\n".join(text) + "\n")
    mesh = quiet_load(path).mesh
    assert len(mesh.positions) == 8 and mesh.corner_uvs is not None
    own = mesh.face_normals / np.linalg.norm(mesh.face_normals, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.shading_normals, np.repeat(own[:, None], 3, 1), atol=1e-6)


def test_hard_edges_of_the_file_are_kept(tmp_path: Path) -> None:
    flat = box()
    flat.unmerge_vertices()
    flat.vertex_normals = np.repeat(flat.face_normals, 3, axis=0)
    for path in (tmp_path / "box.glb", tmp_path / "box.ply", tmp_path / "box.obj"):
        if path.suffix == ".glb":
            flat.export(path, include_normals=True)
        else:
            flat.export(path, **({"vertex_normal": True} if path.suffix == ".ply" else {"include_normals": True}))
        mesh = quiet_load(path).mesh
        assert len(mesh.positions) == 8 and mesh.corner_normals is not None, path.suffix
        own = mesh.face_normals / np.linalg.norm(mesh.face_normals, axis=1, keepdims=True)
        np.testing.assert_allclose(mesh.corner_normals, np.repeat(own[:, None], 3, 1), atol=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_hard_edges_of_flipped_faces_are_kept(tmp_path: Path, sign: int) -> None:
    """Normals of the file may point outwards or follow the winding. The result has hard edges in both cases."""
    flat = box()
    flat.unmerge_vertices()
    normals = sign * np.repeat(flat.face_normals, 3, axis=0)
    lines = ["v {} {} {}".format(*v) for v in flat.vertices] + ["vn {} {} {}".format(*n) for n in normals]
    lines += ["f " + " ".join(f"{c}//{c}" for c in face[::-1] + 1) for face in flat.faces]
    (tmp_path / "box.obj").write_text("\n".join(lines))
    loaded, text = load_with_warning(tmp_path / "box.obj")
    assert text == "box.obj: 12 faces wound inwards, turned over"
    mesh = loaded.mesh
    own = mesh.face_normals / np.linalg.norm(mesh.face_normals, axis=1, keepdims=True)
    assert mesh.corner_normals is not None and volume(mesh) == pytest.approx(24)
    np.testing.assert_allclose(mesh.corner_normals, np.repeat(own[:, None], 3, 1), atol=1e-6)


def test_smooth_normals_of_the_file_are_replaced(tmp_path: Path) -> None:
    path = tmp_path / "ball.ply"
    sphere = ball()
    sphere.vertex_normals = sphere.vertices
    sphere.export(path, vertex_normal=True)
    mesh = quiet_load(path).mesh
    assert mesh.corner_normals is None
    assert np.einsum("ij,ij->i", mesh.normals, mesh.positions).min() > 0.999


# --- textures --------------------------------------------------------------------------------------------------------


def textured(image: Any, **more: Any) -> trimesh.Trimesh:
    mesh = box()
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image, **more)
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.random.default_rng(3).random((8, 2)), material=material)
    return mesh


def image(*color: int) -> Any:
    pil = pytest.importorskip("PIL.Image")
    return pil.fromarray(np.full((4, 6, 3), color, np.uint8))


def test_gltf_textures(tmp_path: Path) -> None:
    path = export(textured(image(200, 100, 50), normalTexture=image(128, 128, 255)), tmp_path / "box.glb")
    maps = quiet_load(path).maps
    assert maps.base_color is not None and maps.normal is not None and maps.specular is None
    assert maps.base_color.shape == (4, 6, 3) and maps.base_color[0, 0].tolist() == [200, 100, 50]
    assert maps.normal[0, 0].tolist() == [128, 128, 255]


def test_obj_textures(tmp_path: Path) -> None:
    image(10, 20, 30).save(tmp_path / "color map.png")
    image(40, 40, 40).save(tmp_path / "shine.png")
    (tmp_path / "seam.mtl").write_text("newmtl skin\nmap_Kd color map.png\nmap_Ks shine.png\n")
    (tmp_path / "seam.obj").write_text("mtllib seam.mtl\nusemtl skin\n" + SEAM)
    maps = load_with_warning(tmp_path / "seam.obj")[0].maps
    assert maps.base_color is not None and maps.base_color[0, 0].tolist() == [10, 20, 30]
    assert maps.specular is not None and maps.specular.shape == (4, 6) and maps.specular[0, 0] == 40
    assert maps.normal is None


def test_a_texture_that_is_missing_or_damaged_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "box.mtl").write_text("newmtl skin\nmap_Ks shine.png\n")
    (tmp_path / "seam.obj").write_text("mtllib box.mtl\nusemtl skin\n" + SEAM)
    with pytest.warns(UserWarning) as caught:
        loaded = load_mesh(tmp_path / "seam.obj")
    losses = [str(warning.message) for warning in caught if "boundary" not in str(warning.message)]
    assert len(losses) == 1 and losses[0].startswith("seam.obj: ") and "shine.png" in losses[0]
    assert loaded.maps.specular is None and loaded.mesh.corner_uvs is not None

    path = export(textured(image(1, 2, 3)), tmp_path / "box.glb")
    content = path.read_bytes()
    at = content.index(b"IDAT")
    path.write_bytes(content[: at + 8] + bytes(8) + content[at + 16 :])
    loaded, text = load_with_warning(path)
    assert text == "box.glb: base_color texture left out: image 0: damaged, or not an image"
    assert loaded.maps.base_color is None


def test_a_mesh_without_textures_gets_none(tmp_path: Path) -> None:
    (tmp_path / "seam.obj").write_text(SEAM)
    maps = load_with_warning(tmp_path / "seam.obj")[0].maps
    assert maps.base_color is None and maps.normal is None and maps.specular is None


def test_a_texture_must_be_shared_by_all_parts(tmp_path: Path) -> None:
    def two(first: Any, second: Any) -> trimesh.Scene:
        scene = trimesh.Scene(textured(first))
        scene.add_geometry(textured(second), transform=trimesh.transformations.translation_matrix((9, 0, 0)))
        return scene

    shared = image(1, 2, 3)
    assert quiet_load(export(two(shared, shared), tmp_path / "same.glb")).maps.base_color is not None
    loaded, text = load_with_warning(export(two(shared, image(4, 5, 6)), tmp_path / "two.glb"))
    assert loaded.maps.base_color is None
    assert text == "two.glb: base_color textures left out: the parts do not all have the same one"
    assert loaded.mesh.corner_uvs is not None


# --- repairs ---------------------------------------------------------------------------------------------------------


def test_holes_are_counted(tmp_path: Path) -> None:
    sphere = ball()
    near = np.linalg.norm(sphere.triangles_center[:, None] - [[1, 0, 0], [-1, 0, 0]], axis=2).min(axis=1)
    faces = sphere.faces[near > 0.4]
    used = np.unique(faces)
    mesh, text = load_with_warning(
        write_off(tmp_path / "holes.off", sphere.vertices[used], np.searchsorted(used, faces))
    )
    rims = edge_uses(mesh.mesh)[1]
    assert rims > 0 and text == f"holes.off: {rims} boundary edges (2 holes)"
    assert len(mesh.mesh.faces) == len(faces)


def test_degenerate_and_duplicate_faces_and_unused_and_duplicate_vertices(tmp_path: Path) -> None:
    b = box()
    vertices = [*b.vertices, (9, 9, 9), b.vertices[0], (b.vertices[0] + b.vertices[1]) / 2]
    a, c = b.faces[0][0], b.faces[0][1]
    faces = [*b.faces.tolist(), [a, a, c], [a, c, a], [0, 1, 10], np.roll(b.faces[3], 1).tolist()]
    faces[0] = [9 if i == 0 else i for i in faces[0]]  # the face may refer to the copy
    faces[1] = [9 if i == 0 else i for i in faces[1]]
    loaded, text = load_with_warning(write_off(tmp_path / "messy.off", vertices, faces))
    assert text == (
        "messy.off: 1 duplicate vertex welded; 3 degenerate faces removed; 1 duplicate face removed; "
        "1 unused vertex dropped"
    )
    assert loaded.mesh.positions.shape == (8, 3) and edge_uses(loaded.mesh) == {2: 18}
    assert loaded.mesh.area == pytest.approx(52)


def test_welding_is_not_noted_if_the_format_splits_vertices(tmp_path: Path) -> None:
    assert len(quiet_load(export(ball(), tmp_path / "ball.stl")).mesh.positions) == 162


def test_an_inverted_mesh_is_flipped(tmp_path: Path) -> None:
    sphere = ball()
    loaded, text = load_with_warning(write_off(tmp_path / "ball.off", sphere.vertices, sphere.faces[:, ::-1]))
    assert text == "ball.off: 320 faces wound inwards, turned over"
    assert volume(loaded.mesh) == pytest.approx(sphere.volume)


def test_an_inverted_mesh_with_a_small_hole_is_flipped(tmp_path: Path) -> None:
    sphere = ball()
    loaded, text = load_with_warning(write_off(tmp_path / "ball.off", sphere.vertices + 5, sphere.faces[1:, ::-1]))
    assert text == "ball.off: 319 faces wound inwards, turned over; 3 boundary edges (1 hole)"
    outwards = np.einsum("ij,ij->i", loaded.mesh.face_normals, loaded.mesh.positions[loaded.mesh.faces[:, 0]] - 5)
    assert (outwards > 0).all()


def test_faces_that_disagree_with_their_neighbours_are_flipped_with_their_texture(tmp_path: Path) -> None:
    (tmp_path / "seam.obj").write_text(SEAM.replace("f 2/5 5/6 6/7 3/8", "f 3/8 6/7 5/6 2/5"))
    loaded, text = load_with_warning(tmp_path / "seam.obj")
    assert "2 faces wound inwards, turned over" in text
    check_seam(loaded.mesh)

    sphere = ball()
    faces = sphere.faces.copy()
    faces[::5] = faces[::5, ::-1]
    loaded, text = load_with_warning(write_off(tmp_path / "ball.off", sphere.vertices, faces))
    assert text == "ball.off: 64 faces wound inwards, turned over"
    assert volume(loaded.mesh) == pytest.approx(sphere.volume)


def test_inverted_bodies_are_flipped_but_not_cavities(tmp_path: Path) -> None:
    outer, other, inner = ball(2), ball(1), ball(1)
    apart = trimesh.Trimesh(
        np.concatenate([outer.vertices, other.vertices + 5]),
        np.concatenate([outer.faces, other.faces[:, ::-1] + len(outer.vertices)]),
        process=False,
    )
    loaded, text = load_with_warning(write_off(tmp_path / "two.off", apart.vertices, apart.faces))
    assert text == "two.off: 320 faces wound inwards, turned over"
    assert volume(loaded.mesh) == pytest.approx(outer.volume + other.volume, rel=1e-5)

    hollow = write_off(
        tmp_path / "hollow.off",
        np.concatenate([outer.vertices, inner.vertices]),
        np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    assert volume(quiet_load(hollow).mesh) == pytest.approx(outer.volume - inner.volume, rel=1e-5)


def test_defects_without_repair_are_counted_and_kept(tmp_path: Path) -> None:
    fan = write_off(tmp_path / "fan.off", [(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, -1, 0)], [
        (0, 1, 2), (0, 1, 3), (0, 1, 4),
    ])  # fmt: skip
    loaded, text = load_with_warning(fan)
    assert text == "fan.off: 6 boundary edges (1 hole); 1 edge of more than two faces" and len(loaded.mesh.faces) == 3

    turns = np.arange(12) * np.pi / 12  # a Moebius strip
    centre = np.stack([np.cos(2 * turns), np.sin(2 * turns), 0 * turns], 1)
    across = np.stack([np.cos(turns) * centre[:, 0], np.cos(turns) * centre[:, 1], np.sin(turns)], 1) * 0.3
    strip = [[2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1] for i in range(11)] + [[22, 1, 0, 23]]
    vertices = np.stack([centre - across, centre + across], 1).reshape(-1, 3)
    loaded, text = load_with_warning(write_off(tmp_path / "moebius.off", vertices, strip))
    assert "24 boundary edges (1 hole); 1 edge whose faces disagree on the outside" in text
    assert len(loaded.mesh.faces) == 24


# --- bad input -------------------------------------------------------------------------------------------------------

TRIANGLE = ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])


def bad(path: Path, **options: Any) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError) as raised:
            load_mesh(path, **options)
    message = str(raised.value)
    assert message.startswith(f"{path}: ") and "\n" not in message and raised.value.__suppress_context__ is not None
    return message.removeprefix(f"{path}: ")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_with_a_wrong_extension_are_errors(
    tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / f"thing{suffix}"
    assert bad(path) == "no such file"
    path.mkdir()
    assert bad(path) == "this is a folder"
    path.rmdir()
    path.write_bytes(b"")
    assert bad(path) == "the file is empty"
    for content in (
        b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
        b"hello, world\n" * 20,
        b"{}",
        b"glTF" + struct.pack("<2I", 2, 9) + bytes(40),
    ):
        path.write_bytes(content)
        assert any(words in bad(path) for words in ("damaged", "truncated", "not ", "the mesh is empty"))
    assert capfd.readouterr() == ("", "") and not caplog.records


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".off", ".glb"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_truncated_files_are_errors(tmp_path: Path, suffix: str, share: float) -> None:
    path = export(ball(), tmp_path / f"ball{suffix}")
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])
    assert re.match("damaged|truncated", bad(path))


def test_faces_without_vertices_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "far.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    assert bad(path) == "line 4: vertex 9 does not exist (the file has 3)"
    path = tmp_path / "far.ply"
    path.write_text(PLY_HEAD.format(vertices=3, faces=1, extra="", corner="") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    assert bad(path) == "row 1 of element face: vertex 7 does not exist (there are 3)"


def test_damaged_numbers_in_text_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "typo.obj"
    path.write_text("v 0 0 0\nv 1 zero 0\nv 0 1 0\nf 1 2 3\n")
    assert bad(path) == "line 2: 'zero' is not a number"


@pytest.mark.parametrize("value", ["nan", "inf", "1e39"])
@pytest.mark.parametrize("suffix", [".obj", ".off"])
def test_positions_that_are_not_finite_are_errors(tmp_path: Path, value: str, suffix: str) -> None:
    path = tmp_path / f"bad{suffix}"
    if suffix == ".obj":
        path.write_text(f"v 0 0 0\nv 1 {value} 0\nv 0 1 0\nf 1 2 3\n")
    else:
        path.write_text(f"OFF\n3 1 0\n0 0 0\n1 {value} 0\n0 1 0\n3 0 1 2\n")
    assert bad(path) in (
        "1 of 3 positions are not finite numbers",
        "a size of 1e+39 mm is out of range (1e-06 to 1e+09)",
    )


def test_meshes_without_faces_are_errors(tmp_path: Path) -> None:
    assert "the mesh is empty" in bad(write_off(tmp_path / "points.off", TRIANGLE[0], []))
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\n")
    assert "the mesh is empty" in bad(tmp_path / "points.obj")
    assert bad(write_off(tmp_path / "spot.off", [(1, 2, 3)] * 3, [(0, 1, 2)])) == "the mesh has zero size"
    line = write_off(tmp_path / "line.off", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])
    assert bad(line) == "the mesh has no area: all 1 faces are degenerate"


def test_bad_scales_and_file_extensions_are_errors(tmp_path: Path) -> None:
    path = write_off(tmp_path / "one.off", *TRIANGLE)
    assert bad(path, size_mm=0) == "size_mm must be a number above 0, not 0"
    assert bad(path, mm_per_unit=-1) == "mm_per_unit must be a number above 0, not -1"
    assert "mm_per_unit must be" in bad(path, mm_per_unit=float("nan"))
    assert "size_mm must be" in bad(path, size_mm="10")
    assert bad(path, mm_per_unit=1e-9) == "a size of 1e-09 mm is out of range (1e-06 to 1e+09)"
    assert bad(path.rename(tmp_path / "one.fbx")) == (
        "not a mesh format that can be read (.ply .obj .stl .off .glb .gltf)"
    )


# --- the mesh itself -------------------------------------------------------------------------------------------------


def cube(**fields: Any) -> Mesh:
    b = trimesh.creation.box((2, 2, 2))
    return Mesh(b.vertices, b.faces, **fields)


def test_normals_are_weighted_by_angle() -> None:
    mesh = cube()
    np.testing.assert_allclose(mesh.normals, mesh.positions / np.sqrt(3), atol=1e-6)
    assert mesh.normals.dtype == np.float32
    np.testing.assert_array_equal(mesh.shading_normals, mesh.normals[mesh.faces])


def test_normals_have_unit_length_even_if_faces_cancel_out() -> None:
    sheet = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 1)])
    np.testing.assert_allclose(np.linalg.norm(sheet.normals, axis=1), 1)


def test_deformed_keeps_topology_and_texture_and_smooths_the_normals() -> None:
    uvs = np.random.default_rng(4).random((12, 3, 2))
    mesh = cube(corner_uvs=uvs, corner_normals=np.tile((0, 0, 1), (12, 3, 1)))
    wide = mesh.deformed(mesh.positions * [3, 1, 1])
    assert wide.faces is mesh.faces or np.array_equal(wide.faces, mesh.faces)
    np.testing.assert_array_equal(wide.corner_uvs, mesh.corner_uvs)
    assert wide.corner_normals is None
    assert wide.area == pytest.approx(2 * (6 * 2 * 2 + 2 * 2)) and mesh.area == pytest.approx(24)
    with pytest.raises(InputError, match="must keep 8 positions"):
        mesh.deformed(mesh.positions[:-1])


def test_arrays_are_read_only_copies() -> None:
    positions = np.eye(3, dtype=np.float32)
    mesh = Mesh(positions, [(0, 1, 2)])
    with pytest.raises(ValueError, match="read-only"):
        mesh.positions[0, 0] = 5
    positions[0, 0] = 1  # the array of the caller is still writable


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"positions": np.zeros((8, 2))}, "thing: positions must be N x 3, not 8 x 2"),
        ({"faces": [(0, 1, 8)]}, "a face refers to a vertex that does not exist"),
        ({"faces": np.zeros((0, 3), int)}, "the mesh has no faces"),
        ({"positions": np.full((8, 3), np.nan)}, "positions holds a number that is not finite"),
        ({"corner_uvs": np.zeros((8, 2))}, "corner_uvs must be 12 x 3 x 2, not 8 x 2"),
        ({"corner_normals": np.full((12, 3, 3), np.inf)}, "corner_normals holds a number that is not finite"),
    ],
)
def test_inconsistent_arrays_are_refused(fields: dict, message: str) -> None:
    b = box()
    with pytest.raises(InputError, match=message):
        Mesh(**{"positions": b.vertices, "faces": b.faces, "name": "thing", **fields})


# --- real data -------------------------------------------------------------------------------------------------------

REAL = {  # triangles, boundary edges, has texture coordinates, has hard edges
    "lee_perry_smith/LeePerrySmith.obj": (17684, 0, True, False),
    "lee_perry_smith/LeePerrySmith.glb": (17684, 0, True, False),
    "bunny_hr.obj": (59664, 0, False, False),
    "bunny_stanford.ply": (69451, 223, False, False),
    "stanford_dragon_100k.obj": (100000, 0, False, False),
    "happy_buddha_100k.obj": (99997, 0, False, False),  # 100,000 minus 3 duplicates
    "spot.obj": (5856, 0, True, False),
    "anim/Fox.glb": (576, 0, True, False),
    "anim/AnimatedMorphSphere.glb": (960, 0, False, False),
    "thin/GlassVaseFlowers.glb": (14036, 2132, True, True),
    "gltf_materials/ExtVolumeScatterDiffuseTransmission.gltf": (12, 0, True, True),
    "fluid/double_dam_break_26_surface.ply": (181808, 0, False, False),
}


@pytest.mark.parametrize("name", REAL)
@pytest.mark.filterwarnings("ignore::wgsss.errors.Note")
def test_real_meshes(data: Path, name: str) -> None:
    triangles, boundary, has_uvs, has_edges = REAL[name]
    mesh = load_mesh(data / name, size_mm=100).mesh
    assert len(mesh.faces) == triangles
    assert edge_uses(mesh)[1] == boundary
    assert (mesh.corner_uvs is not None, mesh.corner_normals is not None) == (has_uvs, has_edges)
    assert len(np.unique(mesh.positions, axis=0)) == len(mesh.positions), "welded"
    source = trimesh.load_scene(data / name, process=False).to_mesh()
    assert mesh.area == pytest.approx(source.area * (100 / np.ptp(source.bounds, axis=0).max()) ** 2, rel=1e-4)
    np.testing.assert_allclose(np.linalg.norm(mesh.shading_normals, axis=2), 1, atol=1e-5)


def test_the_head_has_the_size_of_a_head(data: Path) -> None:
    head = load_mesh(data / "lee_perry_smith" / "LeePerrySmith.obj", mm_per_unit=950).mesh
    np.testing.assert_allclose(np.ptp(head.bounds, axis=0), [430.6, 400.0, 260.9], atol=0.1)
    assert len(head.positions) == 8844


def test_the_bunny_has_five_holes(data: Path) -> None:
    text = load_with_warning(data / "bunny_stanford.ply")[1]
    assert text == "bunny_stanford.ply: 1113 unused vertices dropped; 223 boundary edges (5 holes)"


def test_the_texture_of_the_fox_is_upright(data: Path) -> None:
    fox = load_mesh(data / "anim" / "Fox.glb")
    assert fox.maps.base_color is not None and fox.mesh.corner_uvs is not None
    height, width = fox.maps.base_color.shape[:2]
    u, v = fox.mesh.corner_uvs.mean(axis=1).T
    color = fox.maps.base_color[(v % 1 * height).astype(int), (u % 1 * width).astype(int)]
    assert (color[:, 0] >= color[:, 2]).mean() > 0.9, "the texture is red, white and black"
