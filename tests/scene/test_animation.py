"""Animations of glTF files: skins, morph targets and moving nodes, against values computed by hand."""

from __future__ import annotations

import base64
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as g
import pytest
import trimesh

from wgsss.errors import InputError
from wgsss.scene import LoadedMesh, load_mesh, load_scene
from wgsss.scene.keyframes import Channel

Array = np.ndarray[Any, Any]

HALF = math.sqrt(0.5)
ABOUT_Z = (0.0, 0.0, HALF, HALF)  # a quarter turn, as a quaternion
COMPONENTS = {"i1": g.BYTE, "u1": g.UNSIGNED_BYTE, "i2": g.SHORT, "u2": g.UNSIGNED_SHORT, "u4": 5125, "f4": g.FLOAT}


class File:
    """A glTF file under construction: its tree, and the data of its accessors."""

    def __init__(self) -> None:
        self.tree = g.GLTF2(scene=0, scenes=[g.Scene(nodes=[])])
        self.data = bytearray()

    def view(self, values: Any, dtype: str) -> int:
        array = np.ascontiguousarray(values, "<" + dtype)
        self.data += bytes(-len(self.data) % 4)
        self.tree.bufferViews.append(g.BufferView(buffer=0, byteOffset=len(self.data), byteLength=array.nbytes))
        self.data += array.tobytes()
        return len(self.tree.bufferViews) - 1

    def add(self, values: Any, kind: str, dtype: str = "f4", *, normalized: bool = False) -> int:
        accessor = g.Accessor(bufferView=self.view(values, dtype), componentType=COMPONENTS[dtype], type=kind)
        accessor.count, accessor.normalized = len(values), normalized
        self.tree.accessors.append(accessor)
        return len(self.tree.accessors) - 1

    def mesh(self, vertices: Any, faces: Any, targets: Any = (), **more: int) -> int:
        attributes = g.Attributes(POSITION=self.add(vertices, "VEC3"), **more)
        primitive = g.Primitive(attributes=attributes, indices=self.add(np.ravel(faces), "SCALAR", "u2"))
        primitive.targets = [{"POSITION": t} for t in targets]
        self.tree.meshes.append(g.Mesh(primitives=[primitive]))
        return len(self.tree.meshes) - 1

    def node(self, *, root: bool = True, **fields: Any) -> int:
        self.tree.nodes.append(g.Node(**fields))
        if root:
            self.tree.scenes[0].nodes.append(len(self.tree.nodes) - 1)
        return len(self.tree.nodes) - 1

    def animate(self, *channels: tuple[int, str, Any, Any], kind: str = "LINEAR", name: str | None = None) -> None:
        animation = g.Animation(name=name)
        for node, path, times, values in channels:
            shape = {"weights": "SCALAR", "rotation": "VEC4"}.get(path, "VEC3")
            values = np.ravel(values) if shape == "SCALAR" else values
            sampler = g.AnimationSampler(input=self.add(times, "SCALAR"), output=self.add(values, shape))
            sampler.interpolation = kind
            target = g.AnimationChannelTarget(node=node, path=path)
            animation.channels.append(g.AnimationChannel(sampler=len(animation.samplers), target=target))
            animation.samplers.append(sampler)
        self.tree.animations.append(animation)

    def save(self, path: Path, uri: str | None = None) -> Path:
        """Save as .glb, or as .gltf with its data at `uri`, by default a .bin file."""
        self.tree.buffers = [g.Buffer(byteLength=len(self.data))]
        if path.suffix == ".glb":
            self.tree.set_binary_blob(bytes(self.data))
        else:
            self.tree.buffers[0].uri = uri or f"{path.stem}.bin"
            path.with_suffix(".bin").write_bytes(bytes(self.data))
        self.tree.save(str(path))
        return path


def box(low: Any = (-0.5, 0, -0.5), high: Any = (0.5, 2, 0.5)) -> tuple[Array, Array]:
    """Return the eight vertices and twelve faces of a box."""
    mesh = trimesh.creation.box(bounds=[low, high])
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def bar() -> tuple[Array, Array]:
    """Return a square bar from y 0 to 2 with a ring of vertices at y 1."""
    ring = np.array([(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)])
    vertices = np.array([(x, y, z) for y in (0, 1, 2) for x, z in ring])
    faces = [(0, 2, 1), (0, 3, 2), (8, 9, 10), (8, 10, 11)]
    for start in (0, 4):
        for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
            faces += [(start + a, start + b, start + b + 4), (start + a, start + b + 4, start + a + 4)]
    return vertices, np.array(faces)


def arm(joints: str = "u1", weights: str = "f4") -> File:
    """Make the bar with two joints, at y 0 and 1. The middle ring follows both, and the top follows the upper joint.

    The upper joint rotates by a quarter turn to the left in one second, and back in another.
    """
    file, (vertices, faces) = File(), bar()
    share = np.repeat([(1, 0, 0, 0), (0.5, 0.5, 0, 0), (0, 1, 0, 0)], 4, axis=0)
    top = {"f4": 1, "u1": 255, "u2": 65535}[weights]
    more = {
        "JOINTS_0": file.add(np.tile((0, 1, 0, 0), (12, 1)), "VEC4", joints),
        "WEIGHTS_0": file.add(np.round(share * top, 1), "VEC4", weights, normalized=weights != "f4"),
    }
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 1, 3] = -1
    bound = file.add(inverse.transpose(0, 2, 1).reshape(2, 16), "MAT4")
    file.node(mesh=file.mesh(vertices, faces, **more), skin=0, translation=[7, 0, 0])
    file.node(children=[2])
    file.node(root=False, translation=[0, 1, 0])
    file.tree.skins.append(g.Skin(joints=[1, 2], inverseBindMatrices=bound))
    file.animate((2, "rotation", (0, 1, 2), ((0, 0, 0, 1), ABOUT_Z, (0, 0, 0, 1))), name="Bend")
    return file


def bent(rest: Array, turn: float) -> Array:
    """Compute the positions of the arm with its upper joint rotated by an angle."""
    x, y, z = rest.T
    cos, sin = math.cos(turn), math.sin(turn)
    turned = np.stack([x * cos - (y - 1) * sin, 1 + x * sin + (y - 1) * cos, z], axis=1)
    return rest + (y / 2)[:, None] * (turned - rest)


def load(file: File, path: Path, **options: Any) -> LoadedMesh:
    """Save and load a file in its own unit. Any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_mesh(file.save(path), **{"mm_per_unit": 1, **options})


def at(loaded: LoadedMesh, time_s: float) -> Array:
    assert loaded.motion is not None
    return loaded.motion.apply(loaded.mesh.positions, time_s)


# --- skins -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("joints", ["u1", "u2"])
@pytest.mark.parametrize("weights", ["f4", "u1", "u2"])
def test_a_skin_bends_an_arm(tmp_path: Path, joints: str, weights: str) -> None:
    loaded = load(arm(joints, weights), tmp_path / "arm.glb")
    rest = loaded.mesh.positions
    assert len(rest) == 12 and rest.min(axis=0).tolist() == [-0.5, 0, -0.5], "the place of its node has no effect"
    near = 1e-6 if weights == "f4" else 5e-3  # 127.5 / 255 is not exact in a byte
    for time_s, turn in ((0, 0), (0.5, 45), (1, 90), (1.5, 45), (2.5, 45), (101, 90)):
        assert at(loaded, time_s) == pytest.approx(bent(rest, math.radians(turn)), abs=near)
    top = rest[:, 1] == 2
    assert at(loaded, 1)[top][:, 0] == pytest.approx(-1, abs=1e-6)
    assert loaded.motion is not None and loaded.motion.period_s == 2


def test_lengths_are_measured_at_rest(tmp_path: Path) -> None:
    for options, scale in (({"size_mm": 50}, 25), ({"mm_per_unit": None}, 1000)):
        loaded = load(arm(), tmp_path / "arm.glb", **options)
        assert loaded.mesh.bounds.tolist() == [[-0.5 * scale, 0, -0.5 * scale], [0.5 * scale, 2 * scale, 0.5 * scale]]
        assert at(loaded, 0) == pytest.approx(loaded.mesh.positions)
        assert at(loaded, 1) == pytest.approx(scale * bent(loaded.mesh.positions / scale, math.pi / 2), abs=1e-4)


def test_joints_without_inverse_matrices_start_from_the_mesh_itself(tmp_path: Path) -> None:
    file = arm()
    file.tree.skins[0].inverseBindMatrices = None
    rest = load(file, tmp_path / "arm.glb").mesh.positions
    assert rest[:, 1].max() == 3, "the upper joint raises it by one"


def test_a_mesh_at_rest_is_posed_by_its_skin(tmp_path: Path) -> None:
    """Joints may have moved since the mesh was bound. A mirrored parent of the mesh does not affect the skin."""
    file = arm()
    file.tree.nodes[0].scale, file.tree.nodes[2].rotation = [-1, 1, 1], list(ABOUT_Z)
    file.tree.meshes[0].primitives[0].indices = file.add(bar()[1][:-2].ravel(), "SCALAR", "u2")
    with pytest.warns(UserWarning, match=r"4 boundary edges \(1 hole\)$"):
        mesh = load_mesh(file.save(tmp_path / "arm.glb"), mm_per_unit=1, animation="none").mesh
    assert sorted(mesh.positions.tolist()) == pytest.approx(np.array(sorted(bent(bar()[0], math.pi / 2).tolist())))
    lowest = mesh.face_normals[(mesh.positions[mesh.faces, 1] == 0).all(axis=1)]
    assert len(lowest) == 2 and (lowest[:, 1] < 0).all()


def test_seams_stay_closed_although_their_weights_differ(tmp_path: Path) -> None:
    file = arm()
    vertices, faces = bar()
    primitive = file.tree.meshes[0].primitives[0]
    share = np.repeat([(1, 0, 0, 0), (0.3, 0.7, 0, 0), (0, 1, 0, 0)], 4, axis=0)
    primitive.attributes.POSITION = file.add(np.concatenate([vertices, vertices[4:8]]), "VEC3")
    primitive.attributes.JOINTS_0 = file.add(np.tile((0, 1, 0, 0), (16, 1)), "VEC4", "u1")
    primitive.attributes.WEIGHTS_0 = file.add(np.concatenate([share, share[8:]]), "VEC4")
    upper = (faces >= 8).any(axis=1)
    split = np.where(upper[:, None] & (faces >= 4) & (faces < 8), faces + 8, faces)
    primitive.indices = file.add(split.ravel(), "SCALAR", "u2")
    file.tree.nodes[2].rotation = list(ABOUT_Z)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a warning that two vertices are welded
        loaded = load_mesh(file.save(tmp_path / "arm.glb"), mm_per_unit=1)
    assert len(loaded.mesh.positions) == 12
    assert at(loaded, 1) == pytest.approx(loaded.mesh.positions, abs=1e-6)


def test_weights_are_normalised_and_joints_without_weight_are_ignored(tmp_path: Path) -> None:
    file = arm()
    attributes = primitive(file).attributes
    attributes.JOINTS_0 = file.add(np.tile((0, 1, 200, 0), (12, 1)), "VEC4", "u1")
    attributes.WEIGHTS_0 = file.add(np.repeat([(3, 0, 0, 0), (3, 3, 0, 0), (0, 3, 0, 0)], 4, axis=0), "VEC4")
    loaded = load(file, tmp_path / "arm.glb")
    assert at(loaded, 1) == pytest.approx(bent(loaded.mesh.positions, math.pi / 2), abs=1e-6)


def test_normals_follow_the_posed_surface(tmp_path: Path) -> None:
    """The hard edges of the file belong to another pose than the rest pose."""
    file = arm()
    outwards = bar()[0] * (1, 0, 1)
    primitive(file).attributes.NORMAL = file.add(outwards / np.linalg.norm(outwards, axis=1, keepdims=True), "VEC3")
    file.tree.nodes[2].rotation = list(ABOUT_Z)
    mesh = load(file, tmp_path / "arm.glb", animation="none").mesh
    assert mesh.corner_normals is None


def test_two_skins_move_one_mesh_in_two_places(tmp_path: Path) -> None:
    """In the modelled shape both copies coincide. One must not be dropped as a duplicate."""
    file = arm()
    upper = file.node(root=False, translation=[0, 1, 0])
    lower = file.node(children=[upper], translation=[30, 0, 0])
    file.tree.skins.append(g.Skin(joints=[lower, upper], inverseBindMatrices=file.tree.skins[0].inverseBindMatrices))
    file.node(mesh=0, skin=1, translation=[7, 0, 0])
    loaded = load(file, tmp_path / "arms.glb")
    rest = loaded.mesh.positions
    left = rest[:, 0] < 15
    assert len(rest) == 24 and left.sum() == 12
    assert at(loaded, 1)[left] == pytest.approx(bent(rest[left], math.pi / 2), abs=1e-6)
    assert at(loaded, 1)[~left] == pytest.approx(rest[~left])


def test_vertices_without_weights_follow_the_first_joint_and_are_counted(tmp_path: Path) -> None:
    file = arm()
    share = np.zeros((12, 4))
    share[:8, 1] = 1
    file.tree.meshes[0].primitives[0].attributes.WEIGHTS_0 = file.add(share, "VEC4")
    with pytest.warns(UserWarning, match=r"^arm\.glb: without joint weights.*: 4 vertices$"):
        loaded = load_mesh(file.save(tmp_path / "arm.glb"), mm_per_unit=1)
    still = loaded.mesh.positions[:, 1] == 2
    assert at(loaded, 1)[still] == pytest.approx(loaded.mesh.positions[still])
    assert at(loaded, 1)[~still] != pytest.approx(loaded.mesh.positions[~still], abs=0.1)


# --- morph targets and nodes -----------------------------------------------------------------------------------------


def test_morph_targets_add_up(tmp_path: Path) -> None:
    file, (vertices, faces) = File(), box()
    wide, tall = np.zeros((8, 3)), np.zeros((8, 3))
    wide[:, 0], tall[vertices[:, 1] == 2, 1] = 2 * vertices[:, 0], 4
    sparse = g.Accessor(componentType=g.FLOAT, type="VEC3", count=8)  # zeros except for the upper four
    rows = np.flatnonzero(vertices[:, 1] == 2)
    sparse.sparse = g.Sparse(
        count=4,
        indices=g.AccessorSparseIndices(bufferView=file.view(rows, "u1"), componentType=COMPONENTS["u1"]),
        values=g.AccessorSparseValues(bufferView=file.view(tall[rows], "f4")),
    )
    file.tree.accessors.append(sparse)
    mesh = file.mesh(vertices, faces, targets=[0, file.add(wide, "VEC3")])
    file.tree.meshes[mesh].weights = [0.25, 0.0]
    file.node(mesh=mesh, translation=[0, 1, 0])
    file.animate((0, "weights", (1, 3), ((0, 0.5), (1, 0))))
    loaded = load(file, tmp_path / "box.glb")
    rest = loaded.mesh.positions
    assert rest[:, 1].max() == 1 + 2 + 0.25 * 4, "the weights at rest are those of the mesh"
    upper = rest[:, 1] > 2
    for time_s, grown, up in ((0, 2, 0), (1, 2, 0), (2, 1.5, 0.5), (2.5, 1.25, 0.75)):
        expected = rest * (grown, 1, 1)
        expected[upper, 1] = 3 + 4 * up
        assert at(loaded, time_s) == pytest.approx(expected)


def test_weights_of_a_node_replace_those_of_its_mesh(tmp_path: Path) -> None:
    file, (vertices, faces) = File(), box()
    target = file.add(np.tile((0, 3, 0), (8, 1)), "VEC3")
    for shift in (0, 9):
        file.node(mesh=0, translation=[shift, 0, 0])
    file.mesh(vertices, faces, targets=[target])
    path = file.save(tmp_path / "box.gltf")
    path.write_text(path.read_text().replace('"mesh": 0', '"weights": [1.0], "mesh": 0', 1))
    rest = load_mesh(path, mm_per_unit=1).mesh.positions
    assert rest[rest[:, 0] < 5, 1].min() == 3 and rest[rest[:, 0] > 5, 1].min() == 0


def test_parts_move_with_their_nodes(tmp_path: Path) -> None:
    """One mesh at two nodes, a mirrored node and a child node, with repairs of the mesh."""
    file, (vertices, faces) = File(), box((0, 0, 0), (1, 1, 1))
    spoiled = np.concatenate([[(9, 9, 9)], vertices, vertices])  # one is unused, and all others occur twice
    seamed = np.concatenate(
        [[(1, 1, 2)], faces[:6] + 1, faces[6:] + 9, faces[:1] + 9]
    )  # a degenerate face and a duplicate
    twice = file.mesh(spoiled, seamed)
    file.node(mesh=twice, translation=[10, 0, 0])
    file.node(children=[2], translation=[0, 20, 0])
    file.node(root=False, mesh=twice, scale=[-1, 1, 1])
    file.node(mesh=file.mesh(vertices, faces), matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 30, 1])
    file.animate(
        (0, "translation", (0, 1, 2), ((10, 0, 0), (13, 0, 0), (10, 0, 0))),
        (1, "scale", (0, 1, 2), ((1, 1, 1), (1, 3, 1), (1, 1, 1))),
        (2, "rotation", (0, 1, 2), ((0, 0, 0, 1), ABOUT_Z, (0, 0, 0, 1))),
    )
    with pytest.warns(
        UserWarning, match="2 degenerate faces removed; 2 duplicate faces removed; 4 unused vertices dropped"
    ):
        loaded = load_mesh(file.save(tmp_path / "boxes.glb"), mm_per_unit=1)
    rest = loaded.mesh.positions
    assert len(rest) == 24 and len(loaded.mesh.faces) == 36
    right, high, far = rest[:, 0] >= 10, rest[:, 1] >= 20, rest[:, 2] >= 30
    moved = at(loaded, 1)
    assert moved[right] == pytest.approx(rest[right] + (3, 0, 0))
    assert moved[far] == pytest.approx(rest[far])
    x, y, z = rest[high].T  # the mirrored copy: rotated by a quarter turn, then three times as high
    assert moved[high] == pytest.approx(np.stack([-(y - 20), 20 + 3 * x, z], axis=1), abs=1e-5)


def test_meshes_at_the_same_place_stay_separate(tmp_path: Path) -> None:
    """One of them faces inwards, and is flipped when it is read."""
    file, (small, faces), (large, _) = File(), box(), box((5, 0, 0), (9, 4, 4))
    file.node(mesh=file.mesh(small, faces[:, ::-1]))
    file.node(mesh=file.mesh(large, faces))
    moved = ((0, 0, 0), (0, 0, 8), (0, 0, 0))
    file.animate((1, "translation", (0, 1, 2), moved), (0, "scale", (0, 1, 2), ((1, 1, 1), (1, 1, 5), (1, 1, 1))))
    with pytest.warns(UserWarning, match="12 faces wound inwards, turned over"):
        loaded = load_mesh(file.save(tmp_path / "boxes.glb"), mm_per_unit=1)
    rest = loaded.mesh.positions
    expected = np.where(rest[:, :1] < 5, rest * (1, 1, 5), rest + np.array((0, 0, 8)))
    assert at(loaded, 1) == pytest.approx(expected)


# --- between keys ----------------------------------------------------------------------------------------------------


def channel(path: str, kind: str, times: Any, values: Any) -> Channel:
    rows = 3 if kind == "CUBICSPLINE" else 1
    return Channel(0, path, kind, np.array(times, float), np.reshape(np.array(values, float), (len(times), rows, -1)))


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("LINEAR", {0: 5, 1: 5, 2: 10, 3: 15, 9: 15}), ("STEP", {0: 5, 1: 5, 2.9: 5, 3: 15, 9: 15})],
)
def test_interpolation_between_two_keys(kind: str, expected: dict[float, float]) -> None:
    result = channel("translation", kind, (1, 3), ((5, 0, 0), (15, 0, 0)))
    assert {time_s: result.at(time_s)[0] for time_s in expected} == expected


def test_a_cubic_spline_reproduces_a_cubic() -> None:
    times = (1, 3, 4)
    values = [((9 if t == 1 else 3 * t**2), t**3, (3 * t**2 if t < 4 else 9)) for t in times]  # 9 is never used
    result = channel("weights", "CUBICSPLINE", times, values)
    for time_s in (1, 1.5, 2.5, 3, 3.25, 4):
        assert result.at(time_s)[0] == pytest.approx(time_s**3)
    assert (result.at(0)[0], result.at(7)[0]) == (1, 64)


@pytest.mark.parametrize("sign", [1, -1])
def test_rotations_take_the_shorter_way_at_constant_speed(sign: float) -> None:
    result = channel("rotation", "LINEAR", (0, 3), ((0, 0, 0, 2), sign * np.array(ABOUT_Z)))
    for time_s in (0, 1, 2, 3):
        half = math.radians(15 * time_s)
        value = result.at(time_s) / np.linalg.norm(result.at(time_s))
        assert abs(value @ (0, 0, math.sin(half), math.cos(half))) == pytest.approx(1, abs=1e-9)


def test_equal_rotations_give_no_motion() -> None:
    result = channel("rotation", "LINEAR", (0, 1), (ABOUT_Z, ABOUT_Z))
    assert result.at(0.3) == pytest.approx(ABOUT_Z)


@pytest.mark.parametrize("kind", ["STEP", "CUBICSPLINE"])
def test_interpolation_is_chosen_by_the_file(tmp_path: Path, kind: str) -> None:
    file, (vertices, faces) = File(), box()
    file.node(mesh=file.mesh(vertices, faces))
    values = np.array([(0, 0, 0), (8, 0, 0)], float)
    if kind == "CUBICSPLINE":  # x is t^3 as well
        values = np.array([(0, 0, 0), (0, 0, 0), (0, 0, 0), (12, 0, 0), (8, 0, 0), (0, 0, 0)], float)
    file.animate((0, "translation", (0, 2), values), kind=kind)
    loaded = load(file, tmp_path / "box.glb")
    shift = 0 if kind == "STEP" else 1
    assert at(loaded, 1) == pytest.approx(loaded.mesh.positions + np.array((shift, 0, 0)))


# --- which animation -------------------------------------------------------------------------------------------------


def two_animations() -> File:
    file = arm()
    file.animate((1, "translation", (0, 1), ((0, 0, 0), (4, 0, 0))), name="Walk")
    file.animate((1, "translation", (0, 1), ((0, 0, 0), (0, 0, 4))))
    return file


def test_the_first_animation_or_a_named_one_plays(tmp_path: Path) -> None:
    path = two_animations().save(tmp_path / "arm.glb")

    def shift(**options: Any) -> list[float]:
        loaded = load_mesh(path, mm_per_unit=1, **options)
        low = loaded.mesh.positions[:, 1] == 0
        return (at(loaded, 0.5)[low] - loaded.mesh.positions[low]).mean(axis=0).tolist()

    assert shift() == [0, 0, 0] == shift(animation="Bend")
    assert shift(animation="Walk") == [2, 0, 0]
    assert shift(animation="2") == [0, 0, 2]
    assert load_mesh(path, animation="none").motion is None
    assert np.array_equal(load_mesh(path, animation="none").mesh.positions, load_mesh(path).mesh.positions)
    with pytest.raises(InputError) as raised:
        load_mesh(path, animation="Wak")
    assert str(raised.value) == (f"{path}: unknown animation 'Wak'; did you mean 'Walk'? (known: 2, Bend, Walk, none)")
    trimesh.creation.box().export(tmp_path / "box.ply")
    with pytest.raises(InputError, match=r"box\.ply: it has no animations, so none named 'Walk'$"):
        load_mesh(tmp_path / "box.ply", animation="Walk")
    assert load_mesh(tmp_path / "box.ply", animation="none").motion is None


def test_a_single_key_is_a_pose(tmp_path: Path) -> None:
    file = arm()
    file.tree.animations.clear()
    file.animate((2, "rotation", (0,), (ABOUT_Z,)))
    loaded = load(file, tmp_path / "arm.glb")
    for time_s in (0, 1):
        assert at(loaded, time_s) == pytest.approx(bent(loaded.mesh.positions, math.pi / 2), abs=1e-6)


def test_an_animation_that_does_not_move_the_mesh_is_none(tmp_path: Path) -> None:
    file = arm()
    file.tree.animations.clear()
    file.animate((file.node(), "translation", (0, 1), ((0, 0, 0), (4, 0, 0))))
    with pytest.warns(UserWarning, match=r"^arm\.glb: animation 0: 1 channel moves nothing that is drawn$"):
        assert load_mesh(file.save(tmp_path / "arm.glb"), mm_per_unit=1).motion is None


def test_scene_files_choose_an_animation(tmp_path: Path) -> None:
    two_animations().save(tmp_path / "arm.glb")

    def scene(more: str) -> Any:
        (tmp_path / "scene.toml").write_text(f'[[object]]\nmesh = "arm.glb"\nmm_per_unit = 1\n{more}\n')
        return load_scene(tmp_path / "scene.toml").objects[0].motion

    assert scene("").clip.name == "Bend" and scene('animation = "Walk"').clip.name == "Walk"
    assert scene('animation = "none"') is None
    bend = 'motion = { kind = "bend_and_swell" }'
    assert scene(bend).bend == 75 and scene(f'animation = "none"\n{bend}').bend == 75
    for more, message in (
        (f'animation = "Walk"\n{bend}', "give either motion or the animation of the mesh"),
        ("animation = 1", "animation must be text, not 1"),
        ('animation = "Run"', "unknown animation 'Run'"),
    ):
        with pytest.raises(InputError, match=message) as raised:
            scene(more)
        assert str(raised.value).startswith(f"{tmp_path / 'scene.toml'}: [[object]] 1: ")


def test_an_animated_mesh_is_in_view_of_the_camera(tmp_path: Path) -> None:
    file = arm()
    file.tree.animations.clear()
    file.animate((1, "translation", (0, 1, 2), ((0, 0, 0), (40, 10, 0), (0, 0, 0))))
    scene = load_scene(file.save(tmp_path / "arm.glb"), size_mm=20)
    assert scene.at(1).bounds[1, 0] == pytest.approx(405), "20 mm for two units"
    for time_s in (0, 1, 1.5):
        x, y, _, w = (
            scene.camera.projection(1, 1, 9999) @ scene.camera.view() @ [*scene.at(time_s).bounds.mean(axis=0), 1]
        )
        assert abs(x) < w and abs(y) < w


# --- how it is stored ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("inside", [True, False])
def test_buffers_in_files_or_data_uris(tmp_path: Path, inside: bool) -> None:
    expected = at(load(arm(), tmp_path / "arm.glb"), 1)
    file = arm()
    data = base64.b64encode(bytes(file.data)).decode()
    path = file.save(tmp_path / "arm.gltf", uri=f"data:application/gltf-buffer;base64,{data}" if inside else None)
    assert np.array_equal(at(load_mesh(path, mm_per_unit=1), 1), expected)


# --- bad input -------------------------------------------------------------------------------------------------------


def spoil(change: Callable[[File], Any]) -> File:
    file = arm()
    change(file)
    return file


def primitive(file: File) -> Any:
    return file.tree.meshes[0].primitives[0]


def sampler(file: File) -> Any:
    return file.tree.animations[0].samplers[0]


BAD: dict[str, tuple[Callable[[File], Any], str]] = {
    "no weights": (
        lambda f: setattr(primitive(f).attributes, "WEIGHTS_0", None),
        "mesh 0, primitive 0: JOINTS_0 without WEIGHTS_0",
    ),
    "no joints": (
        lambda f: setattr(primitive(f), "attributes", g.Attributes(POSITION=primitive(f).attributes.POSITION)),
        "mesh 0, primitive 0: it has skin 0, but no JOINTS_0 and WEIGHTS_0",
    ),
    "too few weights": (
        lambda f: setattr(primitive(f).attributes, "WEIGHTS_0", f.add(np.ones((11, 4)), "VEC4")),
        "mesh 0, primitive 0: WEIGHTS_0: accessor 7 has 11 rows instead of 12",
    ),
    "negative weight": (
        lambda f: setattr(primitive(f).attributes, "WEIGHTS_0", f.add(-np.ones((12, 4)), "VEC4")),
        "mesh 0, primitive 0: the weight of a joint is below 0",
    ),
    "weights not finite": (
        lambda f: setattr(primitive(f).attributes, "WEIGHTS_0", f.add(np.full((12, 4), np.nan), "VEC4")),
        "mesh 0, primitive 0: WEIGHTS_0: accessor 7 holds a number that is not finite",
    ),
    "joint out of range": (
        lambda f: setattr(primitive(f).attributes, "JOINTS_0", f.add(np.full((12, 4), 5), "VEC4", "u1")),
        "mesh 0, primitive 0: a vertex uses joint 5, but skin 0 has 2",
    ),
    "skin not there": (lambda f: setattr(f.tree.nodes[0], "skin", 3), "mesh 0, primitive 0: there is no skin 3"),
    "joint not a node": (
        lambda f: setattr(f.tree.skins[0], "joints", [1, 8]),
        "skin 0: its joints must be one or more of the 3 nodes",
    ),
    "too few matrices": (
        lambda f: setattr(f.tree.skins[0], "inverseBindMatrices", f.add(np.eye(4).reshape(1, 16), "MAT4")),
        "skin 0: 1 inverse bind matrices for 2 joints",
    ),
    "matrices of another kind": (
        lambda f: setattr(f.tree.skins[0], "inverseBindMatrices", 0),
        "skin 0: inverse bind matrices: accessor 0 must be MAT4, not 'VEC4'",
    ),
    "matrix not finite": (
        lambda f: setattr(f.tree.skins[0], "inverseBindMatrices", f.add(np.full((2, 16), np.inf), "MAT4")),
        "skin 0: inverse bind matrices: accessor 7 holds a number that is not finite",
    ),
    "accessor not there": (
        lambda f: setattr(f.tree.skins[0], "inverseBindMatrices", 77),
        "skin 0: inverse bind matrices: there is no accessor 77",
    ),
    "no rotation": (lambda f: setattr(f.tree.nodes[2], "rotation", [0, 0, 0, 0]), "node 2: rotation is zero"),
    "two parents": (lambda f: setattr(f.tree.nodes[0], "children", [2]), "node 2 is a child of two nodes"),
    "own ancestor": (
        lambda f: (f.node(root=False, children=[4]), f.node(root=False, children=[3])),
        "node 3 is its own ancestor",
    ),
    "far too large": (
        lambda f: (setattr(f.tree.nodes[1], "scale", [1e200] * 3), setattr(f.tree.nodes[2], "scale", [1e200] * 3)),
        "node 2: its transform is not finite",
    ),
    "too few values": (
        lambda f: setattr(sampler(f), "output", f.add(np.ones((2, 4)), "VEC4")),
        "animation Bend, channel 0: rotation: accessor 7 has 2 rows instead of 3",
    ),
    "values for a spline": (
        lambda f: setattr(sampler(f), "interpolation", "CUBICSPLINE"),
        "animation Bend, channel 0: rotation: accessor 6 has 3 rows instead of 9",
    ),
    "interpolation": (
        lambda f: setattr(sampler(f), "interpolation", "SMOOTH"),
        "animation Bend, channel 0: interpolation must be one of LINEAR, STEP, CUBICSPLINE, not SMOOTH",
    ),
    "zero rotation": (
        lambda f: setattr(sampler(f), "output", f.add(np.zeros((3, 4)), "VEC4")),
        "animation Bend, channel 0: a rotation is zero",
    ),
    "falling times": (
        lambda f: setattr(sampler(f), "input", f.add((0, 2, 1), "SCALAR")),
        "animation Bend, channel 0: its times must be at least 0 and must not decrease",
    ),
    "times before the start": (
        lambda f: setattr(sampler(f), "input", f.add((-1, 0, 1), "SCALAR")),
        "animation Bend, channel 0: its times must be at least 0 and must not decrease",
    ),
    "no such node": (
        lambda f: setattr(f.tree.animations[0].channels[0].target, "node", 9),
        "animation Bend, channel 0: there is no node 9",
    ),
    "no such sampler": (
        lambda f: setattr(f.tree.animations[0].channels[0], "sampler", 9),
        "animation Bend, channel 0: there is no sampler 9",
    ),
    "too few morphed": (
        lambda f: setattr(primitive(f), "targets", [{"POSITION": f.add(np.ones((11, 3)), "VEC3")}]),
        "mesh 0, primitive 0, morph target 0: accessor 7 has 11 rows instead of 12",
    ),
    "weights of other targets": (
        lambda f: setattr(f.tree.meshes[0], "weights", [1.0, 1.0]),
        "node 0: weights must be 0 finite numbers",
    ),
    "not what it should be": (
        lambda f: setattr(f.tree.animations[0].channels[0], "target", None),
        "animation Bend, channel 0: target is missing",
    ),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning:trimesh")
@pytest.mark.parametrize("name", BAD)
def test_errors_name_the_file_and_the_location(tmp_path: Path, name: str) -> None:
    change, message = BAD[name]
    path = spoil(change).save(tmp_path / "arm.glb")
    with pytest.raises(InputError) as raised:
        load_mesh(path)
    assert str(raised.value) == f"{path}: {message}"


def test_a_transform_that_is_not_finite(tmp_path: Path) -> None:
    file = arm()
    file.tree.nodes[2].scale = [2.5, 1, 1]
    path = file.save(tmp_path / "arm.gltf")
    path.write_text(path.read_text().replace("2.5", "NaN"))
    with pytest.raises(InputError, match=r"arm\.gltf: node 2: scale must be 3 finite numbers$"):
        load_mesh(path)


def test_a_mesh_is_scaled_to_nothing_for_a_while(tmp_path: Path) -> None:
    file = arm()
    file.animate((1, "scale", (0, 1, 2), ((1, 1, 1), (0, 0, 0), (1, 1, 1))), name="Blink")
    file.tree.animations.reverse()
    body = load_scene(file.save(tmp_path / "arm.glb"), size_mm=100).objects[0]
    assert [body.at(time_s).mesh.shrunk for time_s in (0.0, 0.5, 1.0, 1.5, 2.0)] == [False, False, True, False, False]


def test_a_mesh_with_another_number_of_vertices_is_refused(tmp_path: Path) -> None:
    loaded = load(arm(), tmp_path / "arm.glb")
    assert loaded.motion is not None
    with pytest.raises(InputError, match="animation Bend: it moves 12 vertices, and no others"):
        loaded.motion.apply(np.zeros((7, 3)), 0)


def test_the_command_line_writes_no_file_for_a_bad_animation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from wgsss.cli import main

    path = spoil(BAD["joint out of range"][0]).save(tmp_path / "arm.glb")
    assert main(["render", str(path), "--frames", "2", "-o", str(tmp_path / "arm.mp4")]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"wgsss: error: {path}: mesh 0") and message.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["arm.glb"]


# --- real files ------------------------------------------------------------------------------------------------------


def test_the_fox_looks_round_walks_and_runs(data: Path) -> None:
    path = data / "anim" / "Fox.glb"
    for name, period in (("Survey", 3.417), ("Walk", 0.708), ("Run", 1.158)):
        loaded = load_mesh(path, mm_per_unit=1, animation=name)
        mesh = loaded.mesh
        assert loaded.motion is not None and loaded.motion.period_s == pytest.approx(period, abs=1e-3)
        ends = mesh.faces[:, [0, 1]]
        for time_s in np.linspace(0, period, 8):
            moved = mesh.deformed(at(loaded, time_s))
            length = [np.linalg.norm(np.diff(m.positions[ends], axis=1)[:, 0], axis=1) for m in (mesh, moved)]
            least, most = np.quantile(length[1] / length[0], [0.01, 0.99])
            assert least > 0.5 and most < 3, "no edge becomes too long"
            assert moved.area == pytest.approx(mesh.area, rel=0.1)
            assert moved.bounds[0, 1] > -8, "the fox stays above the ground"
    feet = mesh.positions[:, 1] < 5
    assert np.ptp([at(loaded, t)[feet].mean(axis=0) for t in (0.1, 0.4, 0.8)], axis=0).max() > 10


def test_a_sphere_is_morphed_to_a_blob_and_a_ship(data: Path) -> None:
    loaded = load_mesh(data / "anim" / "AnimatedMorphSphere.glb", mm_per_unit=1)
    assert np.linalg.norm(at(loaded, 0), axis=1) == pytest.approx(1, abs=1e-5)
    assert np.ptp(at(loaded, 4.3), axis=0) == pytest.approx((6.1, 2, 5.8), abs=0.1)
    assert at(loaded, 7.2 + 1.0) == pytest.approx(at(loaded, 1.0), abs=1e-3)
