"""The lights and cameras of a glTF file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from gltfs import File

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.gltf import read_gltf

HALF = math.sqrt(0.5)
ABOUT_X = [-HALF, 0, 0, HALF]  # rotates -z to -y


def lit(*lights: dict[str, Any], **node: Any) -> File:
    file = File().with_tetrahedron()
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": list(lights)}}
    for number in range(len(lights)):
        file.node(extensions={"KHR_lights_punctual": {"light": number}}, **node)
    return file


def read(file: File, path: Path) -> Contents:
    return read_gltf(file.save(path / "lit.glb"))


def refused(file: File, path: Path) -> str:
    with pytest.raises(InputError) as raised:
        read(file, path)
    return str(raised.value).removeprefix(f"{path / 'lit.glb'}: ")


def test_lights_are_where_their_nodes_are(tmp_path: Path) -> None:
    sun = {"type": "directional", "color": [1, 0.5, 0], "intensity": 4, "name": "sun"}
    file = lit(sun, {"type": "point", "intensity": 3}, translation=[1, 2, 3], rotation=ABOUT_X, scale=[2, 3, 4])
    contents = read(file, tmp_path)
    first, second = contents.lights
    assert (first.name, first.kind, first.power) == ("light 0 (sun)", "directional", (4, 2, 0))
    assert first.direction == pytest.approx((0, -1, 0))
    assert (second.name, second.kind, second.power) == ("light 1", "point", (3, 3, 3))
    assert second.position == (1, 2, 3) and contents.notes == ()


def test_cones_ranges_and_lost_directions_of_lights_are_noted(tmp_path: Path) -> None:
    spot = {"type": "spot", "intensity": 5, "spot": {"outerConeAngle": 0.3}, "range": 10}
    contents = read(lit(spot), tmp_path)
    assert contents.lights[0].kind == "point" and contents.lights[0].power == (5, 5, 5)
    assert contents.notes == (
        "drawn as point lights, without their cones: 1 spot light",
        "range left out: used by 1 light",
    )
    flat = read(lit({"type": "directional"}, scale=[1, 1, 0]), tmp_path)
    assert flat.lights == () and flat.notes == ("left out because it has no direction: 1 light",)


def test_lights_of_hidden_nodes_and_of_other_scenes_are_dark(tmp_path: Path) -> None:
    file = lit({"type": "point"}, {"type": "point"})
    file.tree["nodes"][1]["extensions"]["KHR_node_visibility"] = {"visible": False}
    file.tree["scenes"][0]["nodes"].remove(2)
    assert read(file, tmp_path).lights == ()


@pytest.mark.parametrize(
    ("light", "message"),
    [
        ({}, "KHR_lights_punctual, light 0: type is missing"),
        ({"type": "moon"}, "light 0: type must be one of directional, point, spot, not moon"),
        ({"type": "point", "intensity": -1}, "light 0: intensity must be at least 0, not -1"),
        ({"type": "point", "color": [1, 1]}, "light 0: color must be 3 finite numbers"),
    ],
)
def test_a_bad_light_is_named(tmp_path: Path, light: dict[str, Any], message: str) -> None:
    assert refused(lit(light), tmp_path) == message.removeprefix("KHR_lights_punctual, ")


def test_a_missing_light_is_an_error(tmp_path: Path) -> None:
    file = lit({"type": "point"})
    file.tree["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 3
    assert refused(file, tmp_path) == "node 1: KHR_lights_punctual: there is no light 3"


def test_cameras_look_along_minus_z_of_their_nodes(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.add("cameras", type="perspective", perspective={"yfov": 0.5, "znear": 0.01}, name="front")
    file.add("cameras", type="orthographic", orthographic={"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9})
    file.node(camera=0, translation=[0, 0, 4])
    file.node(camera=1, rotation=ABOUT_X, extensions={"KHR_node_visibility": {"visible": False}}, scale=[3, 3, 3])
    contents = read(file, tmp_path)
    first, second = contents.cameras
    assert (first.name, first.eye, first.height) == ("camera 0 (front)", (0, 0, 4), None)
    assert first.fov == pytest.approx(math.degrees(0.5))
    assert first.forward == pytest.approx((0, 0, -1)) and first.up == pytest.approx((0, 1, 0))
    assert (second.name, second.fov, second.height) == ("camera 1", None, 4)
    assert second.forward == pytest.approx((0, -1, 0)) and second.up == pytest.approx((0, 0, -1))
    assert contents.notes == ()


def test_cameras_that_see_nothing_are_noted(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.add("cameras", type="perspective", perspective={"yfov": 0, "znear": 0.01})
    file.add("cameras", type="orthographic", orthographic={"xmag": 3, "ymag": 0})
    file.add("cameras", type="perspective", perspective={"yfov": 1})
    file.node(camera=0)
    file.node(camera=1)
    file.node(camera=2, scale=[0, 0, 0])
    contents = read(file, tmp_path)
    assert contents.cameras == () and contents.notes == ("left out because they see nothing: 3 cameras",)


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({}, "camera 0: type is missing"),
        ({"type": "fisheye"}, "camera 0: type must be one of perspective, orthographic, not fisheye"),
        ({"type": "perspective"}, "camera 0: perspective: yfov is missing"),
        ({"type": "perspective", "perspective": {"yfov": "1"}}, "camera 0: perspective: yfov must be at least 0"),
    ],
)
def test_a_bad_camera_is_named(tmp_path: Path, camera: dict[str, Any], message: str) -> None:
    file = File().with_tetrahedron()
    file.add("cameras", **camera)
    file.node(camera=0)
    assert refused(file, tmp_path).startswith(message)
