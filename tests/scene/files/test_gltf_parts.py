"""The triangles that a glTF file shows, and their places: primitives, nodes, scenes and instances."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import FACES, TETRAHEDRON, File

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents, Part
from wgsss.scene.files.gltf import read_gltf

Array = np.ndarray[Any, Any]


def read(file: File, path: Path) -> Contents:
    return read_gltf(file.save(path / "box.glb"))


def refused(file: File, path: Path) -> str:
    with pytest.raises(InputError) as raised:
        read(file, path)
    return str(raised.value).removeprefix(f"{path / 'box.glb'}: ")


def placed(part: Part) -> Array:
    """Return the positions of a part in the space of the file."""
    return part.positions @ part.matrix[:3, :3].T + part.matrix[:3, 3]


# --- primitives ------------------------------------------------------------------------------------------------------

STRIP = [(0, 1, 2), (1, 3, 2), (2, 3, 4)]
FAN = [(1, 2, 0), (2, 3, 0), (3, 4, 0)]
PENTAGON = np.array([(math.cos(a), math.sin(a), 0) for a in np.linspace(0, 5, 5)])


@pytest.mark.parametrize(("mode", "expected"), [(5, STRIP), (6, FAN)])
@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", None])
def test_strips_and_fans(tmp_path: Path, mode: int, expected: Any, dtype: str | None) -> None:
    file = File()
    primitive = file.primitive(PENTAGON, None, mode=mode)
    if dtype is not None:
        primitive["indices"] = file.rows(np.arange(5), "SCALAR", dtype)
    file.node(mesh=file.mesh(primitive))
    assert read(file, tmp_path).parts[0].faces.tolist() == [list(face) for face in expected]


def test_degenerate_triangles_that_join_strips_are_left_out(tmp_path: Path) -> None:
    file = File()
    file.node(mesh=file.mesh(file.primitive(PENTAGON, (0, 1, 2, 2, 3, 3, 4, 1), mode=5)))
    contents = read(file, tmp_path)
    assert contents.parts[0].faces.tolist() == [[0, 1, 2], [3, 1, 4]] and contents.notes == ()


def test_triangles_without_indices(tmp_path: Path) -> None:
    file = File()
    file.node(mesh=file.mesh(file.primitive(TETRAHEDRON[FACES].reshape(-1, 3), None)))
    assert read(file, tmp_path).parts[0].faces.tolist() == np.arange(12).reshape(4, 3).tolist()


def test_points_lines_and_leftover_indices_are_counted(tmp_path: Path) -> None:
    file = File()
    spare = file.primitive(faces=(0, 1, 2, 3, 0))
    file.node(mesh=file.mesh(spare, *(file.primitive(mode=mode) for mode in (0, 1, 2, 3)), {"attributes": {}}))
    contents = read(file, tmp_path)
    assert len(contents.parts) == 1 and contents.parts[0].faces.tolist() == [[0, 1, 2]]
    assert contents.notes == (
        "indices that make no triangle left out: 2 indices",
        "points left out: 1 primitive",
        "lines left out: 3 primitives",
        "triangles without positions left out: 1 primitive",
    )


def test_a_file_without_triangles_is_refused(tmp_path: Path) -> None:
    file = File()
    assert refused(file, tmp_path) == "the mesh is empty: it has no faces"
    file.node(mesh=file.mesh(file.primitive(mode=1)))
    assert refused(file, tmp_path) == "the mesh is empty: it has no faces; lines left out: 1 primitive"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"mode": 7}, "mode must be a whole number from 0 to 6, not 7"),
        ({"indices": 50}, "indices: there is no accessor 50"),
        ({"indices": 0}, "indices: accessor 0 must be SCALAR, not 'VEC3'"),
        ({"faces": (0, 1, 4)}, "a face has vertex 4, which does not exist (there are 4)"),
        ({"faces": (0, 1, 65535)}, "a face has vertex 65535, which does not exist (there are 4)"),
        ({"attributes": {"POSITION": "a"}}, "POSITION: there is no accessor 'a'"),
        ({"attributes": {"NORMAL": 1}}, "NORMAL: accessor 1 must be VEC3, not 'SCALAR'"),
        ({"attributes": {"TEXCOORD_0": 0}}, "TEXCOORD_0: accessor 0 must be VEC2, not 'VEC3'"),
        ({"material": 3}, "there is no material 3"),
    ],
)
def test_a_bad_primitive_is_named(tmp_path: Path, fields: Any, message: str) -> None:
    file = File()
    file.node(mesh=file.mesh(file.primitive(**fields)))
    assert refused(file, tmp_path) == f"mesh 0, primitive 0: {message}"


def test_attributes_of_another_length_are_refused(tmp_path: Path) -> None:
    file = File()
    short = file.rows(np.ones((3, 3)), "VEC3")
    file.node(mesh=file.mesh(file.primitive(attributes={"NORMAL": short})))
    assert refused(file, tmp_path) == "mesh 0, primitive 0: NORMAL: accessor 0 has 3 rows instead of 4"


def test_quantised_positions_normals_and_coordinates(tmp_path: Path) -> None:
    file = File()
    attributes = {
        "POSITION": file.rows(TETRAHEDRON * 65535, "VEC3", "u2", normalized=True),
        "NORMAL": file.rows(TETRAHEDRON * -127, "VEC3", "i1", normalized=True),
        "TEXCOORD_0": file.rows(TETRAHEDRON[:, :2] * 255, "VEC2", "u1", normalized=True),
        "TEXCOORD_3": file.rows(TETRAHEDRON[:, :2] * 1000, "VEC2", "i2"),
    }
    file.node(mesh=file.mesh(file.primitive(attributes=attributes)))
    file.tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    part = read(file, tmp_path).parts[0]
    assert part.positions.tolist() == TETRAHEDRON.tolist()
    assert part.normals is not None and part.normals.tolist() == (-TETRAHEDRON).tolist()
    assert part.uvs[0].tolist() == TETRAHEDRON[:, :2].tolist()
    assert part.uvs[3].tolist() == (1000 * TETRAHEDRON[:, :2]).tolist() and sorted(part.uvs) == [0, 3]


@pytest.mark.parametrize("kind", ["VEC3", "VEC4"])
@pytest.mark.parametrize(("dtype", "top"), [("f4", 1.0), ("u1", 255), ("u2", 65535)])
@pytest.mark.parametrize("normalized", [True, False])
def test_vertex_colours(tmp_path: Path, kind: str, dtype: str, top: float, normalized: bool) -> None:
    file = File()
    shades = np.array([(1, 0.2, 0, 1), (0.6, 0, 1, 1), (1, 1, 1, 1), (0, 0, 0, 1)])[:, : int(kind[3])]
    colors = file.rows(shades * top, kind, dtype, normalized=normalized)
    file.node(mesh=file.mesh(file.primitive(attributes={"COLOR_0": colors, "COLOR_1": colors})))
    contents = read(file, tmp_path)
    assert contents.parts[0].colors == pytest.approx(shades[:, :3], abs=1e-7)
    assert contents.notes == ("vertex colours beyond COLOR_0 left out: 1 primitive",)


def test_white_vertex_colours_are_none_and_their_alpha_is_noted(tmp_path: Path) -> None:
    file = File()
    colors = file.rows([(1, 1, 1, 0.5)] * 4, "VEC4")
    file.node(mesh=file.mesh(file.primitive(attributes={"COLOR_0": colors})))
    contents = read(file, tmp_path)
    assert contents.parts[0].colors is None
    assert contents.notes == ("alpha of vertex colours left out: 1 primitive",)


def test_numbers_that_are_not_finite(tmp_path: Path) -> None:
    file, spoilt = File(), TETRAHEDRON.copy()
    spoilt[2] = np.nan
    attributes = {
        "NORMAL": file.rows(spoilt, "VEC3"),
        "TEXCOORD_0": file.rows(spoilt[:, :2], "VEC2"),
        "TEXCOORD_1": file.rows(TETRAHEDRON[:, :2], "VEC2"),
        "COLOR_0": file.rows(spoilt, "VEC3"),
    }
    file.node(mesh=file.mesh(file.primitive(attributes=attributes)))
    contents = read(file, tmp_path)
    part = contents.parts[0]
    assert part.normals is not None and part.normals.tolist() == np.nan_to_num(spoilt).tolist()
    assert sorted(part.uvs) == [1] and part.colors is None
    assert contents.notes == (
        "normals that are not finite left out in mesh 0, primitive 0: 1 vertex",
        "TEXCOORD_0 of mesh 0, primitive 0 left out, not finite at 1 vertex",
        "COLOR_0 of mesh 0, primitive 0 left out, not finite at 1 vertex",
    )
    file.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = attributes["NORMAL"]
    message = "mesh 0, primitive 0: POSITION: accessor 0 holds a number that is not finite"
    assert refused(file, tmp_path) == message


def test_primitives_keep_only_the_shared_vertices_that_they_use(tmp_path: Path) -> None:
    file = File()
    shared = file.rows(np.concatenate([np.full((9, 3), 5.0), TETRAHEDRON, np.full((9, 3), 6.0)]), "VEC3")
    uvs = file.rows(np.arange(44).reshape(22, 2), "VEC2")
    primitive = file.primitive(faces=FACES + 9, attributes={"POSITION": shared, "TEXCOORD_0": uvs})
    file.node(mesh=file.mesh(primitive))
    part = read(file, tmp_path).parts[0]
    assert part.positions.tolist() == TETRAHEDRON.tolist() and part.faces.tolist() == FACES.tolist()
    assert part.uvs[0].tolist() == np.arange(18, 26).reshape(4, 2).tolist()


# --- nodes -----------------------------------------------------------------------------------------------------------


def test_a_mesh_is_placed_by_each_of_its_nodes(tmp_path: Path) -> None:
    file = File()
    file.mesh()
    half = math.sqrt(0.5)
    file.node(mesh=0, translation=[5, 0, 0])
    file.node(mesh=0, matrix=[-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 9, 0, 1])
    file.node(children=[3], scale=[2, 1, 1])
    file.node(root=False, mesh=0, rotation=[0, 0, half, half])
    plain, mirrored, sheared = read(file, tmp_path).parts
    assert placed(plain).tolist() == (TETRAHEDRON + np.array((5, 0, 0))).tolist()
    assert placed(mirrored).tolist() == (TETRAHEDRON * (-1, 1, 1) + (0, 9, 0)).tolist()
    x, y, z = TETRAHEDRON.T
    assert placed(sheared) == pytest.approx(np.stack([-2 * y, x, z], axis=1), abs=1e-12)
    assert plain.positions is mirrored.positions and np.linalg.det(mirrored.matrix) < 0


def test_only_nodes_of_the_scene_are_shown(tmp_path: Path) -> None:
    file = File()
    for number in range(4):
        file.node(mesh=file.mesh(), translation=[number, 0, 0], root=False)
    file.tree["nodes"][1]["children"] = [2]
    shown: dict[Any, list[float]] = {}
    for scene, scenes in (
        (1, [{"nodes": [0]}, {"nodes": [3, 1, 1, 2]}]),
        (None, [{"nodes": [0]}, {"nodes": [3]}]),
        (None, None),
    ):
        file.tree |= {"scene": scene, "scenes": scenes}
        parts = read(file, tmp_path).parts
        shown[len(shown)] = [part.matrix[0, 3] for part in parts]
    assert shown == {0: [3, 1, 3], 1: [0], 2: [0, 1, 3, 3]}, "each node once, below its parent"


def test_hidden_nodes_and_their_children_are_left_out(tmp_path: Path) -> None:
    file = File()
    for number in range(4):
        file.node(mesh=file.mesh(), translation=[number, 0, 0], root=number < 2)
    file.tree["nodes"][1] |= {"children": [2], "extensions": {"KHR_node_visibility": {"visible": False}}}
    file.tree["nodes"][2] |= {"children": [3], "extensions": {"KHR_node_visibility": {"visible": True}}}
    contents = read(file, tmp_path)
    assert [part.name for part in contents.parts] == ["mesh 0, primitive 0"]
    assert contents.notes == ("left out because KHR_node_visibility hides them: 3 nodes",)


def test_a_chain_of_ten_thousand_nodes(tmp_path: Path) -> None:
    file, count = File(), 10_000
    file.tree["nodes"] = [{"translation": [1, 0, 0], "children": [i + 1]} for i in range(count)]
    file.tree["nodes"].append({"mesh": file.mesh()})
    file.tree["scenes"][0]["nodes"] = [0]
    file.add("animations", samplers=[], channels=[])
    start = time.perf_counter()
    contents = read(file, tmp_path)
    assert contents.rig is not None and len(contents.rig.movers()) == count + 1
    assert contents.parts[0].matrix[0, 3] == count
    assert time.perf_counter() - start < 5


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([{"children": [1]}, {"children": [2]}, {"children": [1]}], "node 1 is a child of two nodes"),
        ([{}, {"children": [2]}, {"children": [1]}, {"children": [1]}], "node 1 is a child of two nodes"),
        ([{}, {"children": [2]}, {"children": [3]}, {"children": [1]}], "node 1 is its own ancestor"),
        ([{"children": [0]}], "node 0 is its own ancestor"),
        ([{"children": [7]}], "node 0: its child, node 7, does not exist"),
        ([{"children": [True]}], "node 0: its child, node true, does not exist"),
        ([{"children": 7}], "node 0: children must be a list, not 7"),
        ([{"rotation": [0, 0, 0, 0]}], "node 0: rotation is zero"),
        ([{"scale": [1, 1]}], "node 0: scale must be 3 finite numbers"),
        ([{"translation": [1, "a", 2]}], "node 0: translation must be 3 finite numbers"),
        ([{"matrix": [1] * 15}], "node 0: matrix must be 16 finite numbers"),
        ([{"mesh": 5}], "node 0: there is no mesh 5"),
        (
            [{"mesh": 0, "scale": [1e200] * 3, "children": [1]}, {"mesh": 0, "scale": [1e200] * 3}],
            "node 1: its transform is not finite",
        ),
        ([5], "node 0 must be an object, not 5"),
        ([{"extensions": 5}], "node 0: extensions must be an object, not 5"),
        ({"a": 1}, "nodes must be a list, not an object"),
    ],
)
def test_a_bad_node_is_named(tmp_path: Path, nodes: Any, message: str) -> None:
    file = File()
    file.mesh()
    file.tree |= {"nodes": nodes, "scenes": [{"nodes": [0]}]}
    assert refused(file, tmp_path).startswith(message)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"scene": 3}, "scene: there is no scene 3"),
        ({"scenes": [{"nodes": [9]}]}, "scene 0: there is no node 9"),
        ({"scenes": [{"nodes": ["a"]}]}, "scene 0: there is no node 'a'"),
        ({"scenes": [{"nodes": {}}]}, "scene 0: nodes must be a list, not an object"),
    ],
)
def test_a_bad_scene_is_named(tmp_path: Path, fields: Any, message: str) -> None:
    file = File().with_tetrahedron()
    file.tree |= fields
    assert refused(file, tmp_path) == message


# --- instances -------------------------------------------------------------------------------------------------------


def test_instances_are_placed_in_the_space_of_their_node(tmp_path: Path) -> None:
    file, half = File(), 23170
    attributes = {
        "TRANSLATION": file.rows([(0, 0, 1), (0, 0, 2)], "VEC3"),
        "ROTATION": file.rows([(0, 0, 0, 32767), (0, 0, half, half)], "VEC4", "i2", normalized=True),
        "SCALE": file.rows([(1, 1, 1), (2, 3, 4)], "VEC3"),
        "_ID": 77,
    }
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    file.node(mesh=file.mesh(), extensions=extensions, translation=[5, 0, 0])
    first, second = read(file, tmp_path).parts
    assert placed(first) == pytest.approx(TETRAHEDRON + np.array((5, 0, 1)))
    x, y, z = TETRAHEDRON.T
    assert placed(second) == pytest.approx(np.stack([5 - 3 * y, 2 * x, 2 + 4 * z], axis=1), abs=1e-4)


def test_bad_instances_are_named(tmp_path: Path) -> None:
    file = File()
    attributes: dict[str, Any] = {"TRANSLATION": file.rows(np.ones((2, 3)), "VEC3")}
    file.node(mesh=file.mesh(), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    for more, message in (
        ({"SCALE": file.rows(np.ones((3, 3)), "VEC3")}, "SCALE: accessor 3 has 3 rows instead of 2"),
        ({"SCALE": 50}, "SCALE: there is no accessor 50"),
        ({"SCALE": None, "ROTATION": file.rows(np.zeros((2, 4)), "VEC4")}, "a rotation is zero"),
    ):
        attributes.update(more)
        assert refused(file, tmp_path) == f"node 0: EXT_mesh_gpu_instancing: {message}"


def test_a_small_file_cannot_request_too_many_triangles(tmp_path: Path) -> None:
    file = File()
    zeros = file.add("accessors", count=1_000_000, componentType=5126, type="VEC3")
    file.node(mesh=file.mesh(), extensions={"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": zeros}}})
    assert refused(file, tmp_path) == (
        "node 0: EXT_mesh_gpu_instancing: it has 1000000 instances; at most 100000 can be read"
    )
    file = File()
    mesh = file.mesh(*[file.primitive()] * 1000)
    for _ in range(101):
        file.node(mesh=mesh)
    assert refused(file, tmp_path) == "its scene has more than 100000 parts or 100000000 triangles"
