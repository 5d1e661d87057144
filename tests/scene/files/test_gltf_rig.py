"""Skins, morph targets and animations of glTF files, against values computed by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import FACES, TETRAHEDRON, File

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.gltf import read_gltf

Array = np.ndarray[Any, Any]

HALF = math.sqrt(0.5)
STILL, ABOUT_Z = (0, 0, 0, 1), (0, 0, HALF, HALF)
COUNTS = {"rotation": "VEC4", "weights": "SCALAR"}


def animate(file: File, *channels: tuple[int, str, Any, Any], kind: str | None = None, name: Any = None) -> None:
    """Add an animation to a file. A channel is node, path, times and values."""
    samplers, targets = [], []
    for node, path, times, values in channels:
        rows = np.ravel(values) if path == "weights" else values
        sampler = {"input": file.rows(times, "SCALAR"), "output": file.rows(rows, COUNTS.get(path, "VEC3"))}
        targets.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append(sampler | ({} if kind is None else {"interpolation": kind}))
    file.add("animations", samplers=samplers, channels=targets, **({} if name is None else {"name": name}))


def skinned(joints: str = "u1", weights: str = "f4") -> File:
    """Make a tetrahedron with two joints. All vertices except the origin follow the second joint, at x = 1."""
    file = File()
    top = {"f4": 1, "u1": 255, "u2": 65535}[weights]
    share = np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 1, 0, 0), (0.5, 0.5, 0, 0)])
    attributes = {
        "JOINTS_0": file.rows(np.tile((0, 1, 0, 0), (4, 1)), "VEC4", joints),
        "WEIGHTS_0": file.rows(
            np.floor(share * top) if top > 1 else share, "VEC4", weights, normalized=weights != "f4"
        ),
    }
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 0, 3] = -1
    inverse = file.rows(bind.transpose(0, 2, 1).reshape(2, 16), "MAT4")
    file.add("skins", joints=[1, 2], inverseBindMatrices=inverse)
    file.node(mesh=file.mesh(file.primitive(attributes=attributes)), skin=0, translation=[7, 0, 0], scale=[-1, 1, 1])
    file.node(children=[2])
    file.node(root=False, translation=[1, 0, 0])
    animate(file, (2, "rotation", (0, 1), (STILL, ABOUT_Z)), name="Bend")
    return file


def read(file: File, path: Path) -> Contents:
    return read_gltf(file.save(path / "arm.glb"))


def posed(contents: Contents, name: str, time_s: float) -> Array:
    """Return the positions of all parts at a time of an animation."""
    assert contents.rig is not None
    pose = contents.rig.nodes.rest.copy()
    for channel in contents.animations[name]():
        channel.put(pose, time_s)
    return contents.rig.positions(pose)


# --- skins -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("joints", ["u1", "u2"])
@pytest.mark.parametrize("weights", ["f4", "u1", "u2"])
def test_joints_move_a_skin_independently_of_its_node(tmp_path: Path, joints: str, weights: str) -> None:
    contents = read(skinned(joints, weights), tmp_path)
    assert posed(contents, "Bend", 0) == pytest.approx(TETRAHEDRON)
    # A rotation about (1, 0) keeps the second vertex, moves the third from (0, 1) to (0, -1), the fourth half as far.
    turned = [(0, 0, 0), (1, 0, 0), (0, -1, 0), (0.5, -0.5, 1)]
    assert posed(contents, "Bend", 1) == pytest.approx(np.array(turned), abs=1e-6 if weights == "f4" else 5e-3)
    assert contents.parts[0].matrix.tolist() == np.eye(4).tolist(), "the skin is not mirrored"
    assert contents.rig is not None and contents.rig.movers() == {1, 2}


def test_joints_without_inverse_matrices_start_from_the_mesh_itself(tmp_path: Path) -> None:
    file = skinned()
    del file.tree["skins"][0]["inverseBindMatrices"]
    assert posed(read(file, tmp_path), "Bend", 0)[1].tolist() == [2, 0, 0]


def test_vertices_without_weights_follow_the_first_joint_and_are_counted(tmp_path: Path) -> None:
    file = skinned()
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["WEIGHTS_0"] = file.rows([(0, 3, 0, 0)] + [(0, 0, 0, 0)] * 3, "VEC4")
    attributes["JOINTS_0"] = file.rows(np.tile((0, 1, 200, 0), (4, 1)), "VEC4", "u1")
    contents = read(file, tmp_path)
    expected = [(1, -1, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    assert posed(contents, "Bend", 1) == pytest.approx(np.array(expected), abs=1e-6)
    assert contents.notes == ("without joint weights, moved by the first joint of the skin: 3 vertices",)


def test_a_second_set_of_joints(tmp_path: Path) -> None:
    file = skinned()
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes |= {"JOINTS_1": attributes["JOINTS_0"], "WEIGHTS_1": attributes["WEIGHTS_0"]}
    assert posed(read(file, tmp_path), "Bend", 0) == pytest.approx(TETRAHEDRON), "weights are normalised"


def test_selected_vertices_keep_their_joints_and_targets(tmp_path: Path) -> None:
    file = File()
    joints = np.zeros((12, 4), int)
    joints[8:, 0] = 1
    attributes = {
        "POSITION": file.rows(np.concatenate([np.zeros((8, 3)), TETRAHEDRON]), "VEC3"),
        "JOINTS_0": file.rows(joints, "VEC4", "u1"),
        "WEIGHTS_0": file.rows(np.tile((1, 0, 0, 0), (12, 1)), "VEC4"),
    }
    target = file.rows(np.concatenate([np.zeros((8, 3)), np.ones((4, 3))]), "VEC3")
    primitive = file.primitive(faces=FACES + 8, attributes=attributes, targets=[{"POSITION": target}])
    file.node(mesh=file.mesh(primitive, weights=[2]), skin=0)
    file.add("skins", joints=[1, 2])
    file.node()
    file.node(translation=[0, 0, 9])
    rig = read(file, tmp_path).rig
    assert rig is not None
    assert rig.positions(rig.nodes.rest) == pytest.approx(TETRAHEDRON + np.array((2, 2, 11)))


# --- morph targets, nodes and instances ------------------------------------------------------------------------------


def test_morph_targets_add_up_dense_sparse_and_quantised(tmp_path: Path) -> None:
    file = File()
    sparse = {
        "count": 1,
        "indices": {"bufferView": file.view([2], "u1"), "componentType": 5121},
        "values": {"bufferView": file.view([(0, 0, 5)], "f4")},
    }
    targets = [
        {"POSITION": file.rows(TETRAHEDRON * 127, "VEC3", "i1", normalized=True)},
        {"POSITION": file.add("accessors", count=4, componentType=5126, type="VEC3", sparse=sparse), "NORMAL": 0},
        {},
    ]
    file.node(mesh=file.mesh(file.primitive(targets=targets), weights=[1, 0, 0]))
    file.node(mesh=0, weights=[0, 1, 1], translation=[9, 0, 0])
    animate(file, (0, "weights", (0, 2), ((0, 0, 0), (1, 2, 7))))
    contents = read(file, tmp_path)
    assert contents.rig is not None
    first, second = np.split(contents.rig.positions(contents.rig.nodes.rest), 2)
    raised = np.zeros((4, 3))
    raised[2, 2] = 5
    assert first == pytest.approx(2 * TETRAHEDRON) and second == pytest.approx(TETRAHEDRON + raised + (9, 0, 0))
    assert posed(contents, "0", 1)[:4] == pytest.approx(1.5 * TETRAHEDRON + raised)
    assert [part.positions.tolist() for part in contents.parts] == [TETRAHEDRON.tolist()] * 2, "in the modelled shape"


def test_parts_and_their_instances_move_with_their_nodes(tmp_path: Path) -> None:
    file = File()
    places = {"TRANSLATION": file.rows([(0, 0, 1), (0, 0, 2)], "VEC3")}
    file.node(mesh=file.mesh(), translation=[5, 0, 0])
    file.node(mesh=0, extensions={"EXT_mesh_gpu_instancing": {"attributes": places}})
    animate(file, (1, "scale", (0, 1), ((1, 1, 1), (1, 3, 3))))
    contents = read(file, tmp_path)
    still, first, second = np.split(posed(contents, "0", 1), 3)
    assert still == pytest.approx(TETRAHEDRON + np.array((5, 0, 0)))
    assert first == pytest.approx((TETRAHEDRON + np.array((0, 0, 1))) * (1, 3, 3))
    assert second == pytest.approx((TETRAHEDRON + np.array((0, 0, 2))) * (1, 3, 3))
    at_rest = [part.positions @ part.matrix[:3, :3].T + part.matrix[:3, 3] for part in contents.parts]
    assert np.concatenate(at_rest) == pytest.approx(posed(contents, "0", 0))


def test_a_mesh_with_sparse_positions_is_animated(tmp_path: Path) -> None:
    file = File()
    primitive = file.primitive()
    file.tree["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": file.view([1], "u2"), "componentType": 5123},
        "values": {"bufferView": file.view([(4, 0, 0)], "f4")},
    }
    file.node(mesh=file.mesh(primitive))
    animate(file, (0, "rotation", (0, 1), (STILL, ABOUT_Z)))
    assert posed(read(file, tmp_path), "0", 1)[1] == pytest.approx((0, 4, 0), abs=1e-6)


def test_a_file_without_motion_has_no_rig(tmp_path: Path) -> None:
    contents = read(File().with_tetrahedron(), tmp_path)
    assert contents.rig is None and contents.animations == {}


# --- animations ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "values", "between"),
    [
        (None, [(0, 0, 0), (8, 0, 0)], 4),
        ("LINEAR", [(0, 0, 0), (8, 0, 0)], 4),
        ("STEP", [(0, 0, 0), (8, 0, 0)], 0),
        ("CUBICSPLINE", [(0, 0, 0), (0, 0, 0), (0, 0, 0), (12, 0, 0), (8, 0, 0), (0, 0, 0)], 1),  # t^3
    ],
)
def test_interpolations(tmp_path: Path, kind: str | None, values: Any, between: float) -> None:
    file = File()
    file.node(mesh=file.mesh())
    animate(file, (0, "translation", (0, 2), values), kind=kind)
    assert posed(read(file, tmp_path), "0", 1)[0, 0] == pytest.approx(between)


def test_rotations_as_normalised_integers(tmp_path: Path) -> None:
    file = File()
    file.node(mesh=file.mesh())
    animate(file, (0, "rotation", (0, 1), (STILL, ABOUT_Z)))
    values = file.rows([(0, 0, 0, 32767), (0, 0, 23170, 23170)], "VEC4", "i2", normalized=True)
    file.tree["animations"][0]["samplers"][0]["output"] = values
    assert posed(read(file, tmp_path), "0", 1)[1] == pytest.approx((0, 1, 0), abs=1e-4)


def test_animations_are_named_or_numbered_and_read_on_demand(tmp_path: Path) -> None:
    file = skinned()
    for name in (None, "Bend", 5, "Worse"):
        animate(file, (2, "translation", (0, 1), ((1, 0, 0), (2, 0, 0))), name=name)
    file.tree["animations"][-1]["samplers"][0]["input"] = 99
    contents = read(file, tmp_path)
    assert list(contents.animations) == ["Bend", "1", "2", "3", "Worse"]
    assert contents.animations["Bend"]()[0].path == "rotation", "the first animation with this name"
    with pytest.raises(InputError) as raised:
        contents.animations["Worse"]()
    assert str(raised.value) == f"{tmp_path / 'arm.glb'}: animation Worse, channel 0: times: there is no accessor 99"


def test_channels_that_cannot_be_used_are_counted(tmp_path: Path) -> None:
    file = skinned()
    animate(file, (2, "translation", (0, 1), ((1, 0, 0), (2, 0, 0))), name="More")
    pointer = {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}
    for target in (
        {"path": "pointer", "extensions": {"KHR_animation_pointer": pointer}},
        {"path": "pointer", "extensions": {"KHR_animation_pointer": pointer}},
        {"path": "rotation"},
        {"node": 1, "path": "visibility"},
        {"node": 0, "path": "weights"},
    ):
        file.tree["animations"][1]["channels"].append({"sampler": 0, "target": target})
    contents = read(file, tmp_path)
    assert contents.notes == (
        "left out of animations because they use KHR_animation_pointer: 2 channels",
        "left out of animations because they have no node: 1 channel",
        "left out of animations because their path is unknown (visibility): 1 channel",
        "left out of animations because their node has no morph targets: 1 channel",
    )
    assert [channel.path for channel in contents.animations["More"]()] == ["translation"]


# --- bad input -------------------------------------------------------------------------------------------------------


def put(*path: Any, value: Any) -> Callable[[File], None]:
    """Return a function that sets a value in the tree of a file."""

    def change(file: File) -> None:
        at: Any = file.tree
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value(file) if callable(value) else value

    return change


PRIMITIVE = ("meshes", 0, "primitives", 0)
SAMPLER = ("animations", 0, "samplers", 0)
CHANNEL = ("animations", 0, "channels", 0)

BAD: dict[str, tuple[Callable[[File], None], str]] = {
    "no weights": (
        put(*PRIMITIVE, "attributes", "WEIGHTS_0", value=None),
        "mesh 0, primitive 0: JOINTS_0 without WEIGHTS_0",
    ),
    "no joints": (
        put(*PRIMITIVE, "attributes", "JOINTS_0", value=None),
        "mesh 0, primitive 0: it has skin 0, but no JOINTS_0 and WEIGHTS_0",
    ),
    "negative weight": (
        put(*PRIMITIVE, "attributes", "WEIGHTS_0", value=lambda f: f.rows(-np.ones((4, 4)), "VEC4")),
        "mesh 0, primitive 0: the weight of a joint is below 0",
    ),
    "weights not finite": (
        put(*PRIMITIVE, "attributes", "WEIGHTS_0", value=lambda f: f.rows(np.full((4, 4), np.nan), "VEC4")),
        "mesh 0, primitive 0: WEIGHTS_0: accessor 7 holds a number that is not finite",
    ),
    "joint out of range": (
        put(*PRIMITIVE, "attributes", "JOINTS_0", value=lambda f: f.rows(np.full((4, 4), 5), "VEC4", "u1")),
        "mesh 0, primitive 0: a vertex uses joint 5, but skin 0 has 2",
    ),
    "skin not there": (put("nodes", 0, "skin", value=3), "mesh 0, primitive 0: there is no skin 3"),
    "skin of text": (put("nodes", 0, "skin", value="a"), "mesh 0, primitive 0: there is no skin 'a'"),
    "joint not a node": (
        put("skins", 0, "joints", value=[1, 8]),
        "skin 0: its joints must be one or more of the 3 nodes",
    ),
    "no joint": (put("skins", 0, "joints", value=[]), "skin 0: its joints must be one or more of the 3 nodes"),
    "too few matrices": (
        put("skins", 0, "inverseBindMatrices", value=lambda f: f.rows(np.eye(4).reshape(1, 16), "MAT4")),
        "skin 0: 1 inverse bind matrices for 2 joints",
    ),
    "matrices of another kind": (
        put("skins", 0, "inverseBindMatrices", value=0),
        "skin 0: inverse bind matrices: accessor 0 must be MAT4, not 'VEC4'",
    ),
    "far too large": (
        lambda f: [put("nodes", n, "scale", value=[1e200] * 3)(f) for n in (1, 2)] and None,
        "node 2: its transform is not finite",
    ),
    "too few values": (
        put(*SAMPLER, "output", value=lambda f: f.rows(np.ones((3, 4)), "VEC4")),
        "animation Bend, channel 0: rotation: accessor 7 has 3 rows instead of 2",
    ),
    "values for a spline": (
        put(*SAMPLER, "interpolation", value="CUBICSPLINE"),
        "animation Bend, channel 0: rotation: accessor 6 has 2 rows instead of 6",
    ),
    "interpolation": (
        put(*SAMPLER, "interpolation", value="SMOOTH"),
        "animation Bend, channel 0: interpolation must be one of LINEAR, STEP, CUBICSPLINE, not SMOOTH",
    ),
    "zero rotation": (
        put(*SAMPLER, "output", value=lambda f: f.rows(np.zeros((2, 4)), "VEC4")),
        "animation Bend, channel 0: a rotation is zero",
    ),
    "falling times": (
        put(*SAMPLER, "input", value=lambda f: f.rows((1, 0), "SCALAR")),
        "animation Bend, channel 0: its times must be at least 0 and must not decrease",
    ),
    "times before the start": (
        put(*SAMPLER, "input", value=lambda f: f.rows((-1, 0), "SCALAR")),
        "animation Bend, channel 0: its times must be at least 0 and must not decrease",
    ),
    "no such node": (put(*CHANNEL, "target", "node", value=9), "animation Bend, channel 0: there is no node 9"),
    "no such sampler": (put(*CHANNEL, "sampler", value=9), "animation Bend, channel 0: there is no sampler 9"),
    "no target": (put(*CHANNEL, "target", value=None), "animation Bend, channel 0: target is missing"),
    "sampler of text": (put(*SAMPLER, value="a"), "animation Bend, sampler 0 must be an object, not 'a'"),
    "too few morphed": (
        put(*PRIMITIVE, "targets", value=lambda f: [{"POSITION": f.rows(np.ones((3, 3)), "VEC3")}]),
        "mesh 0, primitive 0, morph target 0: accessor 7 has 3 rows instead of 4",
    ),
    "weights of other targets": (
        put("meshes", 0, "weights", value=[1.0, 1.0]),
        "node 0: weights must be 0 finite numbers",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_errors_name_the_file_and_the_location(tmp_path: Path, name: str) -> None:
    change, message = BAD[name]
    file = skinned()
    change(file)
    path = file.save(tmp_path / "arm.glb")
    with pytest.raises(InputError) as raised:
        read_gltf(path).animations["Bend"]()
    assert str(raised.value) == f"{path}: {message}"


def test_primitives_of_one_mesh_have_the_same_targets(tmp_path: Path) -> None:
    file = File()
    file.node(mesh=file.mesh(file.primitive(), file.primitive(targets=[{}])))
    path = file.save(tmp_path / "arm.glb")
    with pytest.raises(InputError) as raised:
        read_gltf(path)
    assert str(raised.value) == f"{path}: mesh 0, primitive 1: it has 1 morph targets, but its mesh has 0"
