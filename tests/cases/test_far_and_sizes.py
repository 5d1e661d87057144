"""Scenes far from the origin, meshes too small or too large for their material, and meshes with many faces."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import RADIUS, ball, ball_primitive, checkered, colored, difference, loaded, picture, scene_and_notes
from gltfs import File

from wgsss import render
from wgsss.errors import InputError
from wgsss.scene import Mesh, PerspectiveCamera, Scene, bodies, load_scene

Array = np.ndarray[Any, Any]


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return loaded(checkered(), tmp_path_factory.mktemp("near"))


def surface(scene: Scene, offset: Any = (0, 0, 0)) -> Array:
    """Render the normals from a camera moved by an offset, mm. (Shadows are coarse in scenes of a kilometre.)"""
    camera = scene.camera
    eye, target = (tuple(np.add(point, offset).tolist()) for point in (camera.eye, camera.target))
    seen = replace(scene, camera=replace(camera, eye=eye, target=target))
    return render(seen, "lambert", (64, 64), aovs=("normal",)).aovs["normal"]


# --- far from the origin ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", [(1000, 0, 0), (-3000, 2000, -500), (0, -2e5, 0), (6371000, 0, 0)])
def test_a_mesh_far_away_is_drawn_like_one_at_the_origin(tmp_path: Path, near: Scene, offset: Any) -> None:
    """A node translates the mesh, in metres."""
    scene = loaded(checkered(node={"translation": list(offset)}), tmp_path)
    np.testing.assert_allclose(scene.bounds.mean(axis=0), np.multiply(offset, 1000), atol=1)
    assert difference(scene, near) <= 1


def test_positions_of_a_mesh_may_be_far_from_the_origin(tmp_path: Path) -> None:
    """Positions are float32 and 1000 m away. The precision of the file, 0.06 mm, is kept."""
    file = File()
    file.node(mesh=file.mesh(ball_primitive(file, colored(file), (1000, 0, 0))))
    scene = loaded(file, tmp_path)
    rounded = np.float32(ball()[0] + (1000, 0, 0)).astype(float) - (1000, 0, 0)
    expected = File()
    attributes = {"POSITION": expected.rows(rounded, "VEC3")}
    expected.node(mesh=expected.mesh(ball_primitive(expected, colored(expected), attributes=attributes)))
    assert difference(scene, loaded(expected, tmp_path)) <= 1


def test_a_far_mesh_is_scaled_to_a_length(tmp_path: Path) -> None:
    near_one, far_one = (
        loaded(checkered(node=node), tmp_path, size_mm=30) for node in ({}, {"translation": [1000, -50, 20]})
    )
    assert np.ptp(far_one.bounds, axis=0).max() == pytest.approx(30, rel=1e-3)
    assert difference(far_one, near_one) <= 1


@pytest.mark.parametrize("same", [True, False])
def test_a_far_part_and_a_near_part(tmp_path: Path, near: Scene, same: bool) -> None:
    """A camera near the part 1 km away sees it like one at the origin, with the same or another material."""
    file = File()
    first = colored(file)
    second = first if same else colored(file)
    file.node(mesh=file.mesh(ball_primitive(file, first)))
    file.node(mesh=file.mesh(ball_primitive(file, second)), translation=[1000, 0, 0])
    scene, lines = scene_and_notes(file, tmp_path)
    assert np.ptp(scene.bounds, axis=0)[0] == pytest.approx(1e6, rel=1e-3)
    assert all("long and light spreads" in line for line in lines)
    expected = surface(near)
    for offset in ((0, 0, 0), (1e6, 0, 0)):
        assert np.abs(surface(replace(scene, camera=near.camera), offset) - expected).max() < 2e-3


def test_a_far_part_that_moves(tmp_path: Path) -> None:
    """A rotating node moves the part."""
    scenes = []
    for offset in ((0, 0, 0), (1000, 0, -2000)):
        file = checkered(node={"translation": list(offset)})
        half = np.sqrt(0.5)
        times, turns = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0, 1), (0, 0, half, half)], "VEC4")
        channel = {"sampler": 0, "target": {"node": 0, "path": "rotation"}}
        file.add("animations", channels=[channel], samplers=[{"input": times, "output": turns}])
        scenes.append(loaded(file, tmp_path))
    for time_s in (0.0, 0.5, 0.99):
        assert difference(*scenes, time=time_s) <= 1


def test_a_far_mesh_in_a_scene_file(tmp_path: Path) -> None:
    """The scene file rotates the mesh about the origin and translates it back."""
    checkered(node={"translation": [1000, 0, 0]}).save(tmp_path / "far.glb")
    checkered().save(tmp_path / "near.glb")
    place = "rotate = [0, 0, 90]\ntranslate = [{}, {}, 7]\n"
    (tmp_path / "far.toml").write_text(f'[[object]]\nmesh = "far.glb"\n{place.format(0, -1e6)}')
    (tmp_path / "near.toml").write_text(f'[[object]]\nmesh = "near.glb"\n{place.format(0, 0)}')
    far_one, near_one = load_scene(tmp_path / "far.toml"), load_scene(tmp_path / "near.toml")
    np.testing.assert_allclose(far_one.bounds, near_one.bounds, atol=1e-3)
    assert difference(far_one, near_one) <= 1


# --- sizes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("size_mm", "effect"),
    [
        (0.1, "glows as a whole"),
        (1.8, "glows as a whole"),
        (3, ""),
        (200, ""),
        (18000, ""),
        (30000, "looks as if opaque"),
    ],
)
def test_a_mesh_too_large_or_too_small_for_the_light_in_it(tmp_path: Path, size_mm: float, effect: str) -> None:
    """Light spreads 19.5 mm in marble. The limits are a tenth and a thousand times that length."""
    scene, lines = scene_and_notes(checkered(), tmp_path, size_mm=size_mm)
    if not effect:
        assert lines == []
        return
    assert len(lines) == 1 and effect in lines[0] and "marble" in lines[0] and "--size-mm" in lines[0]
    fit = float(re.search(r"--size-mm (\S+) ", lines[0])[1])
    assert scene_and_notes(tmp_path / "ball.glb", size_mm=fit)[1] == [], "the advised size is accepted"
    assert scene.objects


def test_the_size_warning_is_about_the_chosen_material(tmp_path: Path) -> None:
    path = checkered().save(tmp_path / "ball.glb")
    assert scene_and_notes(path)[1] == []
    dense = {"sigma_a": [10, 10, 10], "sigma_s_prime": [1000, 1000, 1000]}
    assert len(scene_and_notes(path, material=dense)[1]) == 1
    assert scene_and_notes(path, material=dense, size_mm=0.1)[1] == []


def test_the_size_warning_of_a_scene_file_names_the_mesh(tmp_path: Path) -> None:
    checkered().save(tmp_path / "ball.glb")
    (tmp_path / "scene.toml").write_text('[[object]]\nmesh = "ball.glb"\nsize_mm = 90000\n')
    with pytest.warns(UserWarning, match=r"^ball\.glb: the mesh is .*opaque"):
        load_scene(tmp_path / "scene.toml")


# --- many faces ------------------------------------------------------------------------------------------------------


def counts(mesh: Mesh) -> tuple[int, int]:
    return len(mesh.positions), len(mesh.faces)


def test_a_mesh_too_large_for_a_device_is_refused_with_advice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = checkered().save(tmp_path / "ball.glb")
    vertices, faces = counts(load_scene(path).objects[0].mesh)
    monkeypatch.setattr(bodies, "MOST_VERTICES", vertices - 20)
    with pytest.raises(InputError, match=rf"ball\.glb: .*{faces} faces.* --simplify \d+") as raised:
        load_scene(path)
    advised = int(re.search(r"--simplify (\d+)", str(raised.value))[1])
    scene, lines = scene_and_notes(path, simplify=advised)
    assert len(scene.objects[0].mesh.faces) <= advised and any("simplified" in line for line in lines)


def test_split_vertices_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each corner of a mesh with hard edges is a separate vertex on the device."""
    points, _, faces = ball(RADIUS, 6, 4)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    file = File()
    attributes = {"NORMAL": file.rows(np.repeat(normals, 3, axis=0), "VEC3")}
    file.node(mesh=file.mesh(file.primitive(corners.reshape(-1, 3), None, attributes=attributes)))
    path = file.save(tmp_path / "ball.glb")
    assert load_scene(path).objects[0].mesh.corner_normals is not None
    monkeypatch.setattr(bodies, "MOST_VERTICES", 2 * len(faces))
    with pytest.raises(InputError, match=r"--simplify \d+") as raised:
        load_scene(path)
    advised = int(re.search(r"--simplify (\d+)", str(raised.value))[1])
    assert len(scene_and_notes(path, simplify=advised)[0].objects[0].mesh.faces) <= advised < len(faces)


def test_duplicate_vertices_are_not_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Triangles without shared vertices, as in STL files, are welded first."""
    points, _, faces = ball()
    file = File()
    file.node(mesh=file.mesh(file.primitive(points[faces].reshape(-1, 3), None)))
    monkeypatch.setattr(bodies, "MOST_VERTICES", len(faces))
    assert len(scene_and_notes(file, tmp_path)[0].objects[0].mesh.faces) == len(faces)


@pytest.mark.parametrize("faces", [100, 200])
def test_a_simplified_ball_is_still_a_ball(tmp_path: Path, near: Scene, faces: int) -> None:
    scene, lines = scene_and_notes(checkered(), tmp_path, simplify=faces)
    mesh = scene.objects[0].mesh
    assert abs(len(mesh.faces) - faces) <= 2
    without = "without textures, texture coordinates"
    assert lines == [f"simplified to {len(mesh.faces)} of {len(ball()[2])} faces, {without}"]
    assert scene.objects[0].material.maps.base_color is None, "textures are left out without texture coordinates"
    assert np.linalg.norm(mesh.positions, axis=1) == pytest.approx(50, abs=4)
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    assert (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
    outline = picture(scene)[..., 3] > 0, picture(near)[..., 3] > 0
    assert (outline[0] != outline[1]).mean() < 0.05


def test_simplify_keeps_meshes_with_few_faces(tmp_path: Path, near: Scene) -> None:
    assert difference(loaded(checkered(), tmp_path, simplify=100000), near) == 0


def test_simplify_applies_to_each_part_and_notes_losses(tmp_path: Path) -> None:
    """A large part has all attributes of a part. A small part keeps its texture."""
    file = File()
    material = colored(file)
    points, uvs, faces = ball(RADIUS, 6, 5)
    attributes = {"TEXCOORD_0": file.rows(uvs, "VEC2")}
    small = file.primitive(points, faces, material=material, attributes=attributes)
    file.node(mesh=file.mesh(small), translation=[0.2, 0, 0])
    colors = np.full((len(ball()[0]), 3), 0.5)
    colors[0] = 1
    large = {"COLOR_0": file.rows(colors, "VEC3"), "TEXCOORD_0": None}
    bare = file.add("materials", name="large", pbrMetallicRoughness={"metallicFactor": 0, "roughnessFactor": 0.7})
    node = file.node(mesh=file.mesh(ball_primitive(file, bare, attributes=large)))
    times, places = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0), (0, 0.1, 0)], "VEC3")
    channel = {"sampler": 0, "target": {"node": node, "path": "translation"}}
    file.add("animations", channels=[channel], samplers=[{"input": times, "output": places}])
    scene, lines = scene_and_notes(file, tmp_path, simplify=80)
    unchanged, reduced = scene.objects
    assert unchanged.material.maps.base_color is not None and unchanged.mesh.corner_uvs is not None
    assert reduced.motion is None and reduced.mesh.corner_colors is None and len(reduced.mesh.faces) <= 82
    assert len(lines) == 1 and lines[0].startswith("large: simplified to ")
    assert "vertex colours" in lines[0] and "motion" in lines[0] and isinstance(scene.camera, PerspectiveCamera)
