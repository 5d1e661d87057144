"""Primitives, nodes and instances of glTF files: all are drawn once and at the right place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import (
    BLUE,
    RADIUS,
    RED,
    ball,
    ball_primitive,
    checkered,
    colored,
    difference,
    differing,
    encoded,
    loaded,
    picture,
    scene_and_notes,
)
from gltfs import File

from wgsss import render
from wgsss.scene import Mesh, Scene, load_mesh, load_scene

Array = np.ndarray[Any, Any]
HALF = math.sqrt(0.5)


def is_closed(mesh: Mesh) -> bool:
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return bool((np.unique(ends, axis=0, return_counts=True)[1] == 2).all())


def volume(mesh: Mesh) -> float:
    a, b, c = mesh.positions[mesh.faces].astype(float).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


# --- modes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("indexed", [False, True])
def test_a_fan_and_triangles_are_drawn(tmp_path: Path, indexed: bool) -> None:
    """A disc of 14 vertices, 100 mm wide, is to the right of a ball."""
    turns = np.linspace(0, 2 * np.pi, 13)
    rim = np.stack([0.1 + RADIUS * np.cos(turns), RADIUS * np.sin(turns), 0 * turns], axis=1)
    disc = np.concatenate([[(0.1, 0, 0)], rim[:-1], rim[:1]])
    file = File()
    order = np.arange(14)
    fan = file.primitive(disc[::-1], 13 - order, mode=6) if indexed else file.primitive(disc, None, mode=6)
    file.node(mesh=file.mesh(ball_primitive(file), fan))
    scene, lines = scene_and_notes(file, tmp_path)
    assert scene.bounds[1, 0] == pytest.approx(150)
    whole, disc_mesh = (o.mesh for o in scene.objects)
    assert whole.corner_uvs is not None and disc_mesh.corner_uvs is None, "the two parts do not share vertices"
    assert disc_mesh.area == pytest.approx(12 * 0.5 * 50**2 * math.sin(np.pi / 6), rel=1e-5)
    assert (disc_mesh.face_normals[:, 2] > 0).all(), "the winding defines the front of the disc"
    assert lines == ["12 boundary edges (1 hole)"]


def test_a_ball_may_be_a_triangle_strip(tmp_path: Path) -> None:
    """The rows of the ball form one strip, joined by triangles without area."""
    columns, rows = 17, 15
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    turn, fall = 2 * np.pi * u, np.pi * v
    points = RADIUS * np.stack([np.cos(turn) * np.sin(fall), np.cos(fall), -np.sin(turn) * np.sin(fall)], axis=-1)
    points[:, -1], points[0], points[-1] = points[:, 0], (0, RADIUS, 0), (0, -RADIUS, 0)
    order: list[int] = []
    for row in range(rows):
        upper = np.arange(columns + 1) + row * (columns + 1)
        strip = np.stack([upper, upper + columns + 1], axis=1).ravel().tolist()
        order += [order[-1], strip[0], *strip] if order else strip
    faces = [
        (a, c, b) if i % 2 else (a, b, c)
        for i, (a, b, c) in enumerate(zip(order[:-2], order[1:-1], order[2:], strict=True))
    ]
    pictures = []
    for indices, mode in ((order, 5), ([face for face in faces if len(set(face)) == 3], 4)):
        file = File()
        attributes = {"TEXCOORD_0": file.rows(np.stack([u, v], axis=-1).reshape(-1, 2), "VEC2")}
        look = {"material": colored(file), "attributes": attributes}
        file.node(mesh=file.mesh(file.primitive(points.reshape(-1, 3), indices, mode=mode, **look)))
        scene, _ = scene_and_notes(file, tmp_path)
        mesh = scene.objects[0].mesh
        assert is_closed(mesh)
        assert volume(mesh) == pytest.approx(4 / 3 * np.pi * 50**3, rel=0.05)
        pictures.append(scene)
    assert difference(*pictures) == 0


def test_lines_and_points_are_noted(tmp_path: Path) -> None:
    file = checkered()
    points = file.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    for mode in (0, 1, 3):
        file.tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": points}, "mode": mode})
    scene, lines = scene_and_notes(file, tmp_path)
    assert len(lines) == 2 and any("points" in line for line in lines) and any("lines" in line for line in lines)
    assert difference(scene, loaded(checkered(), tmp_path)) == 0


# --- several primitives ----------------------------------------------------------------------------------------------


def halves(file: File, upper: int | None, lower: int | None) -> list[dict[str, Any]]:
    """Make the ball as two primitives that meet at a row of vertices."""
    points, uvs, faces = ball()
    above = points[faces].mean(axis=1)[:, 1] > 0
    primitives = []
    for material, chosen in ((upper, above), (lower, ~above)):
        attributes = {"TEXCOORD_0": file.rows(uvs, "VEC2")}
        more = {} if material is None else {"material": material}
        primitives.append(file.primitive(points, faces[chosen], attributes=attributes, **more))
    return primitives


def test_primitives_of_one_material_are_one_closed_body(tmp_path: Path) -> None:
    file = File()
    material = colored(file)
    file.node(mesh=file.mesh(*halves(file, material, material)))
    scene, _ = scene_and_notes(file, tmp_path)
    assert len(scene.objects) == 1 and is_closed(scene.objects[0].mesh)
    assert difference(scene, loaded(checkered(), tmp_path)) <= 1


def test_equal_materials_with_different_names_are_one_body(tmp_path: Path) -> None:
    """Some programs write a copy of the material for each primitive. This does not split a body."""
    file = File()
    materials = [
        file.add(
            "materials", name=name, pbrMetallicRoughness={"baseColorFactor": [1, 0.5, 0.5, 1], "metallicFactor": 0}
        )
        for name in ("skin", "skin.001")
    ]
    file.node(mesh=file.mesh(*halves(file, *materials)))
    scene, _ = scene_and_notes(file, tmp_path)
    assert len(scene.objects) == 1 and is_closed(scene.objects[0].mesh)


def solid(file: File, color: Any, name: str) -> int:
    """Add a material with a texture of one colour."""
    image = file.add("images", bufferView=file.view(encoded(np.full((2, 2, 3), color, np.uint8))), mimeType="image/png")
    base = {"baseColorTexture": {"index": file.add("textures", source=image)}, "metallicFactor": 0}
    return file.add("materials", name=name, pbrMetallicRoughness=base)


def head(path: Path) -> Path:
    """Make a file of three balls along x: a red head, a blue eye and a green tooth."""
    file = File()
    for number, (name, color) in enumerate((("head", RED), ("eyes", BLUE), ("teeth", (20, 180, 40)))):
        file.node(mesh=file.mesh(ball_primitive(file, solid(file, color, name))), translation=[0.1 * number, 0, 0])
    return file.save(path / "head.glb")


def colors_of(scene: Scene) -> list[list[int]]:
    return [o.material.maps.base_color[0, 0].tolist() for o in scene.objects]


def test_several_materials_are_several_bodies_with_their_textures(tmp_path: Path) -> None:
    scene, lines = scene_and_notes(head(tmp_path))
    assert lines == []
    assert [o.mesh.name for o in scene.objects] == ["head head", "head eyes", "head teeth"]
    assert colors_of(scene) == [list(RED), list(BLUE), [20, 180, 40]]
    seen = picture(scene, size=96)[48]
    strongest = [int(seen[x, :3].argmax()) for x in (20, 48, 76)]
    assert strongest == [0, 2, 1], "red, blue and green from left to right"


def test_a_chosen_material_applies_to_all_bodies_and_keeps_their_textures(tmp_path: Path) -> None:
    path = head(tmp_path)
    scene, _ = scene_and_notes(path, material="skin")
    assert {o.material.name for o in scene.objects} == {"skin"} and len(scene.objects) == 3
    assert colors_of(scene) == [list(RED), list(BLUE), [20, 180, 40]]
    assert all(o.material.base_color == (1, 1, 1) for o in scene.objects), "textures replace the colour of skin"
    tinted, _ = scene_and_notes(path, material={"preset": "skin", "base_color": [0.5, 1, 1]})
    assert all(o.material.base_color == (0.5, 1, 1) for o in tinted.objects)


def test_bodies_of_a_mesh_in_a_scene_file_are_placed_together(tmp_path: Path) -> None:
    """Each body is an object, and all have the same placement."""
    head(tmp_path)
    table = '[[object]]\nmesh = "head.glb"\ntranslate = [0, 500, 0]\nrotate = [0, 0, 90]\n'
    (tmp_path / "scene.toml").write_text(table)
    (tmp_path / "waxy.toml").write_text(table + 'material = "ketchup"\n')
    scene = load_scene(tmp_path / "scene.toml")
    assert len(scene.objects) == 3 and colors_of(scene) == [list(RED), list(BLUE), [20, 180, 40]]
    np.testing.assert_allclose(scene.bounds, [[-50, 450, -50], [50, 750, 50]], atol=2)
    assert [round(o.placed.mean(axis=0)[1]) for o in scene.objects] == [500, 600, 700], "x is rotated to y"
    assert {o.material.name for o in load_scene(tmp_path / "waxy.toml").objects} == {"ketchup"}


def test_joining_parts_notes_the_differences(tmp_path: Path) -> None:
    """`load_mesh` joins all parts of a file into one mesh."""
    path = head(tmp_path)
    with pytest.warns(UserWarning, match="base_color textures left out: the parts do not all have the same one"):
        joined = load_mesh(path)
    assert joined.maps.base_color is None and joined.mesh.corner_uvs is not None
    assert np.ptp(joined.mesh.bounds, axis=0)[0] == pytest.approx(300, abs=2)


# --- where parts stand -----------------------------------------------------------------------------------------------


def test_instances_are_drawn_like_nodes(tmp_path: Path) -> None:
    places = np.array([(0, 0, 0), (0.12, 0, 0), (0, 0.12, 0)])
    turns = np.array([(0, 0, 0, 1), (0, HALF, 0, HALF), (HALF, 0, 0, HALF)])
    scales = np.array([(1, 1, 1), (1, 2, 1), (0.5, 0.5, -0.5)])
    file = checkered()
    attributes = {
        "TRANSLATION": file.rows(places, "VEC3"),
        "ROTATION": file.rows(turns * 32767, "VEC4", "i2", normalized=True),
        "SCALE": file.rows(scales, "VEC3"),
    }
    file.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    file.tree["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    nodes = checkered()
    nodes.tree["nodes"].clear()
    nodes.tree["scenes"][0]["nodes"].clear()
    for place, turn, scale in zip(places, turns, scales, strict=True):
        nodes.node(mesh=0, translation=place.tolist(), rotation=turn.tolist(), scale=scale.tolist())
    scene, expected = loaded(file, tmp_path), loaded(nodes, tmp_path)
    assert len(scene.objects) == 1 and len(scene.objects[0].mesh.faces) == 3 * len(ball()[2])
    np.testing.assert_allclose(scene.bounds, expected.bounds, atol=0.01)
    assert differing(scene, expected) < 0.01


def test_a_negative_scale_mirrors_without_inverting_faces(tmp_path: Path) -> None:
    file = checkered(node={"scale": [-1, 1, 1]})
    mirrored = checkered()
    for name, sign in (("POSITION", [-1, 1, 1]),):
        values = ball()[0] * sign
        primitive = mirrored.tree["meshes"][0]["primitives"][0]
        primitive["attributes"][name] = mirrored.rows(values, "VEC3")
        primitive["indices"] = mirrored.rows(ball()[2][:, ::-1].ravel(), "SCALAR", "u2")
    assert difference(loaded(file, tmp_path), loaded(mirrored, tmp_path)) == 0


def test_one_mesh_is_shown_plain_and_mirrored(tmp_path: Path) -> None:
    file = File()
    mesh = file.mesh(ball_primitive(file))
    file.node(mesh=mesh, translation=[-0.06, 0, 0])
    file.node(mesh=mesh, translation=[0.06, 0, 0], scale=[-1, 1, 1])
    mesh_of = loaded(file, tmp_path).objects[0].mesh
    one = volume(load_mesh(checkered().save(tmp_path / "one.glb")).mesh)
    assert volume(mesh_of) == pytest.approx(2 * one, rel=1e-5)
    outward = mesh_of.positions - np.where(mesh_of.positions[:, :1] > 0, [[60, 0, 0]], [[-60, 0, 0]])
    assert (np.einsum("ij,ij->i", outward, mesh_of.normals) > 45).all()


def test_a_rotated_child_of_a_scaled_node_is_sheared(tmp_path: Path) -> None:
    """This matrix is not a product of translation, rotation and scale. The ball becomes an ellipsoid."""
    file = checkered(node={"rotation": [0, 0, math.sin(math.pi / 8), math.cos(math.pi / 8)]})
    primitive = file.tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["NORMAL"] = file.rows(ball()[0] / RADIUS, "VEC3")
    file.tree["scenes"][0]["nodes"] = [file.node(root=False, children=[0], scale=[3, 1, 0.4])]
    scene = loaded(file, tmp_path)
    np.testing.assert_allclose(np.ptp(scene.bounds, axis=0), [300, 100, 40], rtol=0.02)
    mesh = scene.objects[0].mesh
    gradient = mesh.positions / np.square([3, 1, 0.4])
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    corners = mesh.shading_normals
    assert np.einsum("ijk,ijk->ij", corners, gradient[mesh.faces]).mean() > 0.99


def test_normals_of_the_file_that_point_inwards_are_kept(tmp_path: Path) -> None:
    """Normals define the shading. The triangles define the outside."""
    file = checkered()
    normals = file.rows(-ball()[0] / RADIUS, "VEC3")
    file.tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals
    mesh = loaded(file, tmp_path).objects[0].mesh
    assert volume(mesh) > 0 and mesh.corner_normals is not None
    np.testing.assert_allclose(mesh.corner_normals, -mesh.positions[mesh.faces] / 50, atol=1e-5)


def test_a_skin_ignores_the_transform_of_its_node(tmp_path: Path) -> None:
    """The joint of a skinned mesh is scaled by 2. The node of the mesh is scaled by 0.01 and rotated."""
    file = checkered()
    count = len(ball()[0])
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = file.rows(np.zeros((count, 4)), "VEC4", "u1")
    attributes["WEIGHTS_0"] = file.rows(np.tile((0.5, 0.5, 0, 0), (count, 1)), "VEC4")
    joint = file.node(scale=[2, 2, 2])
    file.add("skins", joints=[joint, joint])
    file.tree["nodes"][0].update(skin=0, scale=[0.01] * 3, rotation=[HALF, 0, 0, HALF])
    scene = loaded(file, tmp_path)
    assert np.ptp(scene.bounds, axis=0)[1] == pytest.approx(200)
    assert differing(scene, loaded(checkered(node={"scale": [2, 2, 2]}), tmp_path)) < 0.01


@pytest.mark.parametrize("method", ["deon07", "sam"])
def test_methods_that_bake_draw_two_materials(tmp_path: Path, method: str) -> None:
    """Each body looks as it does alone, with the same light and camera."""
    file = File()
    materials = [solid(file, color, name) for name, color in (("left", RED), ("right", BLUE))]
    for number, material in enumerate(materials):
        file.node(mesh=file.mesh(ball_primitive(file, material)), translation=[0.12 * number, 0, 0])
    scene, _ = scene_and_notes(file, tmp_path, size_mm=22.0)
    knobs = {"map_size": 64} if method == "deon07" else {"surface": "screen"}
    pixels = render(scene, method, (48, 48), **knobs).pixels
    left, right = (pixels[20:28, x].mean(axis=0) for x in (12, 36))
    assert left[0] > 3 * left[2] and right[2] > 3 * right[0]
