"""Lights and cameras of glTF files are used on request, and otherwise counted."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import checkered, difference, loaded, picture, scene_and_notes
from gltfs import File

from wgsss.cli import main
from wgsss.errors import InputError
from wgsss.scene import DirectionalLight, OrthographicCamera, PerspectiveCamera, PointLight, load_scene

HALF = math.sqrt(0.5)


def with_lights(*lights: tuple[dict[str, Any], dict[str, Any]], parent: dict[str, Any] | None = None) -> File:
    """Make a file of a ball with lights, each at its own node, below an optional parent node."""
    file = checkered()
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [light for light, _ in lights]}}
    nodes = []
    for number, (_, node) in enumerate(lights):
        reference = {"KHR_lights_punctual": {"light": number}}
        nodes.append(file.node(root=parent is None, extensions=reference, **node))
    if parent is not None:
        file.node(children=nodes, **parent)
    return file


def with_camera(*cameras: tuple[dict[str, Any], dict[str, Any]], parent: dict[str, Any] | None = None) -> File:
    file = checkered()
    nodes = []
    for camera, node in cameras:
        nodes.append(file.node(root=parent is None, camera=file.add("cameras", **camera), **node))
    if parent is not None:
        file.node(children=nodes, **parent)
    return file


SUN = {"type": "directional", "intensity": 3, "color": [1, 0.5, 0.25]}
LENS = {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.01}}
FLAT = {"type": "orthographic", "orthographic": {"xmag": 0.3, "ymag": 0.08, "znear": 0, "zfar": 1}}


# --- lights ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("light", "node", "expected"),
    [
        (SUN, {}, DirectionalLight((0, 0, -1), (3, 1.5, 0.75))),
        (SUN, {"rotation": [-HALF, 0, 0, HALF]}, DirectionalLight((0, -1, 0), (3, 1.5, 0.75))),
        (
            {"type": "point", "intensity": 0.02},
            {"translation": [0.1, 0.2, 0.1]},
            PointLight((100, 200, 100), (0.02, 0.02, 0.02)),
        ),
        ({"type": "directional"}, {"scale": [3, 3, 3]}, DirectionalLight((0, 0, -1), (1, 1, 1))),
    ],
)
def test_a_light_of_the_file_is_like_a_given_light(tmp_path: Path, light: Any, node: Any, expected: Any) -> None:
    """1 lx is read as 1 W/m^2, and 1 cd as 1 W/sr."""
    path = with_lights((light, node)).save(tmp_path / "ball.glb")
    own, lines = scene_and_notes(path, file_lights=True)
    assert lines == [] and len(own.lights) == 1
    by_hand, _ = scene_and_notes(path, lights=[expected])
    assert difference(own, by_hand) <= 1
    by_default, lines = scene_and_notes(path)
    assert lines == ["1 light of the file is not used (--file-lights uses it)"]
    assert difference(by_default, loaded(checkered(), tmp_path)) == 0, "the default lights are used"


def test_lights_below_rotated_and_scaled_nodes(tmp_path: Path) -> None:
    """The parent rotates by a quarter turn about y and scales by 2, which moves x to -z, twice as far."""
    parent = {"rotation": [0, HALF, 0, HALF], "scale": [2, 2, 2], "translation": [0, 0.1, 0]}
    file = with_lights((SUN, {}), ({"type": "point", "intensity": 2}, {"translation": [0.2, 0, 0]}), parent=parent)
    sun, lamp = loaded(file, tmp_path, file_lights=True).lights
    assert isinstance(sun, DirectionalLight) and sun.direction == pytest.approx((-1, 0, 0), abs=1e-9)
    assert sun.irradiance == pytest.approx((3, 1.5, 0.75)), "colour and power are not scaled"
    assert isinstance(lamp, PointLight) and lamp.position == pytest.approx((0, 100, -400), abs=1e-6)


def test_two_suns_add_up(tmp_path: Path) -> None:
    file = with_lights((SUN, {}), (SUN, {"rotation": [-HALF, 0, 0, HALF]}))
    scene = loaded(file, tmp_path, file_lights=True)
    assert [light.direction for light in scene.lights] == [pytest.approx((0, 0, -1)), pytest.approx((0, -1, 0))]
    assert picture(scene).mean() > picture(loaded(with_lights((SUN, {})), tmp_path, file_lights=True)).mean()
    _, lines = scene_and_notes(file, tmp_path)
    assert lines == ["2 lights of the file are not used (--file-lights uses them)"]


def test_unused_properties_of_a_light_are_noted(tmp_path: Path) -> None:
    spot = {"type": "spot", "intensity": 1, "range": 2, "spot": {"outerConeAngle": 0.3}}
    scene, lines = scene_and_notes(with_lights((spot, {"translation": [0, 0, 1]})), tmp_path, file_lights=True)
    assert isinstance(scene.lights[0], PointLight)
    assert sorted("cone" in line or "range" in line for line in lines) == [True, True]


def test_a_light_without_a_node_is_not_used(tmp_path: Path) -> None:
    file = checkered()
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [SUN]}}
    with pytest.raises(InputError, match=r"ball\.glb: it holds no lights$"):
        load_scene(file.save(tmp_path / "ball.glb"), file_lights=True)


@pytest.mark.parametrize("size_mm", [10.0, 500.0])
def test_a_point_light_is_scaled_with_the_mesh(tmp_path: Path, size_mm: float) -> None:
    """A scale of the mesh also scales the position and power of the light, so that the irradiance is the same."""
    lamp = {"type": "point", "intensity": 0.05}
    path = with_lights((lamp, {"translation": [0.1, 0.05, 0.15]}), (SUN, {})).save(tmp_path / "ball.glb")
    plain, scaled = (
        scene_and_notes(path, file_lights=True)[0],
        scene_and_notes(path, file_lights=True, size_mm=size_mm)[0],
    )
    assert difference(plain, scaled) <= 1


# --- cameras ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("camera", "node", "expected"),
    [
        (LENS, {"translation": [0, 0, 0.4]}, PerspectiveCamera((0, 0, 400), (0, 0, 0), fov=math.degrees(0.5))),
        (
            LENS,
            {"translation": [0.4, 0, 0], "rotation": [0, HALF, 0, HALF]},
            PerspectiveCamera((400, 0, 0), (0, 0, 0), fov=math.degrees(0.5)),
        ),
        (
            LENS,
            {"translation": [0, 0, 0.4], "rotation": [0, 0, HALF, HALF]},
            PerspectiveCamera((0, 0, 400), (0, 0, 0), up=(-1, 0, 0), fov=math.degrees(0.5)),
        ),
        (
            LENS,
            {"translation": [0, 0, 0.4], "scale": [2, 3, 0.5]},
            PerspectiveCamera((0, 0, 400), (0, 0, 0), fov=math.degrees(0.5)),
        ),
        (FLAT, {"translation": [0.02, 0, 0.4]}, OrthographicCamera((20, 0, 400), (20, 0, 0), height=160)),
    ],
)
def test_the_camera_of_the_file_is_like_a_given_camera(tmp_path: Path, camera: Any, node: Any, expected: Any) -> None:
    path = with_camera((camera, node)).save(tmp_path / "ball.glb")
    own, lines = scene_and_notes(path, file_camera=True)
    assert lines == []
    assert difference(own, scene_and_notes(path, camera=expected)[0]) <= 1
    by_default, lines = scene_and_notes(path)
    assert lines == ["1 camera of the file is not used (--file-camera uses it)"]
    assert difference(by_default, loaded(checkered(), tmp_path)) == 0


def test_the_first_of_several_cameras_is_used(tmp_path: Path) -> None:
    path = with_camera((FLAT, {"translation": [0, 0, 1]}), (LENS, {"translation": [0, 0, 0.4]})).save(
        tmp_path / "a.glb"
    )
    scene, lines = scene_and_notes(path, file_camera=True)
    assert isinstance(scene.camera, OrthographicCamera) and scene.camera.height == pytest.approx(160)
    assert lines == ["1 camera of the file is not used: the first one is"]
    assert scene_and_notes(path)[1] == ["2 cameras of the file are not used (--file-camera uses the first)"]


def test_a_camera_below_a_rotated_node(tmp_path: Path) -> None:
    parent = {"rotation": [0, HALF, 0, HALF], "translation": [0, 0.05, 0]}
    camera = loaded(with_camera((LENS, {"translation": [0, 0, 0.4]}), parent=parent), tmp_path, file_camera=True).camera
    assert camera.eye == pytest.approx((400, 50, 0), abs=1e-6)
    gaze = np.subtract(camera.target, camera.eye)
    assert gaze / np.linalg.norm(gaze) == pytest.approx((-1, 0, 0), abs=1e-9)


@pytest.mark.parametrize("camera", [LENS, FLAT])
@pytest.mark.parametrize("size_mm", [10.0, 500.0])
def test_a_camera_shows_the_same_picture_of_a_scaled_mesh(tmp_path: Path, camera: Any, size_mm: float) -> None:
    path = with_camera((camera, {"translation": [0.02, 0, 0.3]})).save(tmp_path / "ball.glb")
    assert (
        difference(
            scene_and_notes(path, file_camera=True)[0], scene_and_notes(path, file_camera=True, size_mm=size_mm)[0]
        )
        <= 1
    )


def test_a_camera_that_sees_nothing_is_noted(tmp_path: Path) -> None:
    path = with_camera((LENS, {"scale": [1, 1, 0]})).save(tmp_path / "ball.glb")
    assert any("see nothing" in line for line in scene_and_notes(path)[1])
    with pytest.raises(InputError, match=r"ball\.glb: it holds no camera$"):
        load_scene(path, file_camera=True)


def test_a_file_without_lights_and_cameras(tmp_path: Path) -> None:
    path = checkered().save(tmp_path / "ball.glb")
    with pytest.raises(InputError, match=r"ball\.glb: it holds no camera$"):
        load_scene(path, file_camera=True)
    with pytest.raises(InputError, match=r"ball\.glb: it holds no lights$"):
        load_scene(path, file_lights=True)
    with pytest.raises(InputError, match="exclude each other"):
        load_scene(path, file_lights=True, lights=[DirectionalLight((0, 0, -1), (1, 1, 1))])


def test_lights_and_cameras_in_a_scene_file_are_counted(tmp_path: Path) -> None:
    """A scene file defines its own lights and camera."""
    file = with_lights((SUN, {}))
    file.node(camera=file.add("cameras", **LENS))
    file.save(tmp_path / "ball.glb")
    (tmp_path / "scene.toml").write_text('[[object]]\nmesh = "ball.glb"\n')
    with pytest.warns(UserWarning) as caught:
        load_scene(tmp_path / "scene.toml")
    lines = sorted(str(warning.message) for warning in caught)
    assert lines == [
        "ball.glb: 1 camera of the file is not used: a scene file has its own",
        "ball.glb: 1 light of the file is not used: a scene file has its own",
    ]


def test_the_command_line_uses_lights_and_camera_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command renders with the lights and the camera of the file, a chosen animation, and fewer faces."""
    file = with_lights((SUN, {}))
    file.node(camera=file.add("cameras", **LENS), translation=[0, 0, 0.4])
    times, places = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0), (0.2, 0, 0)], "VEC3")
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    for name in ("Rest", "Walk"):
        file.add("animations", name=name, channels=[channel], samplers=[{"input": times, "output": places}])
    path = file.save(tmp_path / "ball.glb")
    picture_of = [
        "render",
        str(path),
        "--method",
        "lambert",
        "--size",
        "8x8",
        "-o",
        str(tmp_path / "ball.png"),
        "--json",
    ]
    assert main([*picture_of, "--file-lights", "--file-camera", "--animation", "Walk"]) == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == []
    assert main([*picture_of, "--simplify", "100", "--animation", "none"]) == 0
    lines = json.loads(capsys.readouterr().out)["warnings"]
    assert [line.split(": ")[1].split()[0] for line in lines] == ["simplified", "1", "1"]
    for options, words in (
        (["--animation", "Run"], "unknown animation 'Run'"),
        (["--file-camera", "--camera", "{kind = 'perspective', eye = [0, 0, 9], target = [0, 0, 0]}"], "exclude"),
        (["--simplify", "3"], "simplify"),
    ):
        assert main([*picture_of, *options]) == 2
        err = capsys.readouterr().err.splitlines()
        assert words in err[-1] and err[-1].startswith("wgsss: error: ")
