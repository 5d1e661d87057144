"""Each unused property of a file is noted once, and a file that is used completely gives no warning."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import RADIUS, ball, ball_primitive, checker, checkered, colored, encoded, loaded, scene_and_notes, texture
from gltfs import File

from wgsss.cli import main
from wgsss.errors import InputError
from wgsss.scene import load_scene

Array = np.ndarray[Any, Any]

FACTORS = {"metallicFactor": 1, "baseColorFactor": [2, 1, 1, 1]}
MATERIAL_EXTENSIONS: dict[str, dict[str, Any]] = {
    "KHR_materials_anisotropy": {},
    "KHR_materials_clearcoat": {"clearcoatFactor": 1},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5},
    "KHR_materials_dispersion": {},
    "KHR_materials_iridescence": {},
    "KHR_materials_sheen": {},
    "KHR_materials_transmission": {"transmissionFactor": 0.5},
    "KHR_materials_unlit": {},
    "KHR_materials_volume": {"thicknessFactor": 1},
    "VENDOR_coat": {},
}
HARMLESS = {"KHR_materials_emissive_strength": {"emissiveStrength": 2}, "KHR_xmp_json_ld": {}}


def everything() -> File:
    """Make a ball with all properties of glTF files that wgsss does not use."""
    file, (points, uvs, _) = File(), ball()
    count = len(points)
    textures = [texture(file, encoded(checker(size=8 + number))) for number in range(5)]
    material = file.add(
        "materials",
        name="skin",
        alphaMode="BLEND",
        emissiveFactor=[1, 0, 0],
        emissiveTexture={"index": textures[0]},
        occlusionTexture={"index": textures[1]},
        normalTexture={"index": textures[2], "texCoord": 1},
        pbrMetallicRoughness={
            **FACTORS,
            "baseColorTexture": {"index": textures[3]},
            "metallicRoughnessTexture": {"index": textures[4]},
        },
        extensions={
            **MATERIAL_EXTENSIONS,
            **HARMLESS,
            "KHR_materials_ior": {"ior": 0},
            "KHR_materials_specular": {"specularColorFactor": [1, 0, 0]},
        },
    )
    normals = np.where(np.arange(count)[:, None] == 3, np.nan, points / RADIUS)
    attributes = {
        "NORMAL": file.rows(normals, "VEC3"),
        "TANGENT": file.rows(np.tile((1, 0, 0, 1), (count, 1)), "VEC4"),
        "TEXCOORD_1": file.rows(uvs, "VEC2"),
        "TEXCOORD_2": file.rows(uvs * np.nan, "VEC2"),
        "COLOR_0": file.rows(np.tile((1, 0.5, 0.5, 0.5), (count, 1)), "VEC4"),
        "COLOR_1": file.rows(np.ones((count, 3)), "VEC3"),
        "_HEAT": file.rows(np.ones(count), "SCALAR"),
    }
    primitive = ball_primitive(file, material, attributes=attributes)
    primitive["extensions"] = {"VENDOR_hull": {}}
    zeros = file.rows(np.zeros((count, 3)), "VEC3")
    primitive["targets"] = [{"POSITION": zeros, "NORMAL": zeros, "COLOR_0": zeros}]
    spare = file.mesh()
    body = file.node(mesh=file.mesh(primitive, file.primitive(mode=1), file.primitive(mode=0)))
    lamp = file.node(extensions={"KHR_lights_punctual": {"light": 0}})
    file.node(extensions={"KHR_lights_punctual": {"light": 1}})
    file.node(camera=file.add("cameras", type="perspective", perspective={"yfov": 1, "znear": 0.1}))
    file.node(mesh=spare, extensions={"KHR_node_visibility": {"visible": False}})
    file.tree["scenes"].append({"nodes": [file.node(root=False, mesh=spare)]})
    file.mesh()
    file.tree["extensions"] = {
        "KHR_lights_punctual": {"lights": [{"type": "point"}, {"type": "spot", "range": 3}]},
        "VENDOR_sky": {},
    }
    times, places = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0), (0, 1, 0)], "VEC3")
    targets = (
        {"node": body, "path": "translation"},
        {"node": lamp, "path": "translation"},
        {"path": "translation"},
        {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0"}}},
    )
    channels = [{"sampler": 0, "target": target} for target in targets]
    for name, played in (("Walk", channels), ("Run", channels[:1])):
        file.add("animations", name=name, channels=played, samplers=[{"input": times, "output": places}])
    return file


EACH_ONCE: tuple[tuple[str, ...], ...] = (
    # of materials
    ("alphaMode is BLEND",),
    ("emission",),
    ("occlusion",),
    ("metallic-roughness textures",),
    ("metal ",),
    ("colours clipped",),
    ("index of refraction of 0",),
    ("the colour of KHR_materials_specular",),
    ("normal texture", "its texture coordinates differ"),
    *((f"{name} left out",) for name in MATERIAL_EXTENSIONS),
    # of vertices
    ("normals that are not finite", "1 vertex"),
    ("TEXCOORD_2", "not finite"),
    ("beyond COLOR_0",),
    ("alpha of vertex colours",),
    ("_HEAT",),
    ("COLOR_0 of morph targets",),
    # of meshes and nodes
    ("lines", "1 primitive"),
    ("points left out", "1 primitive"),
    ("KHR_node_visibility", "1 node"),
    ("the scene does not contain", "1 node"),
    ("no node uses", "1 mesh"),
    ("VENDOR_hull",),
    ("VENDOR_sky",),
    # of lights and cameras
    ("1 spot light",),
    ("range", "1 light"),
    ("2 lights", "--file-lights"),
    ("1 camera", "--file-camera"),
    # of animations
    ("plays Walk", "2 animations", "Run"),
    ("Walk: 1 channel moves nothing",),
    ("they have no node", "1 channel"),
    ("KHR_animation_pointer", "1 channel"),
)


def test_each_unused_property_is_noted_once(tmp_path: Path) -> None:
    lines = scene_and_notes(everything(), tmp_path)[1]
    for words in EACH_ONCE:
        naming = [line for line in lines if all(word in line for word in words)]
        assert len(naming) == 1, f"{words}: {naming}"
    assert len(lines) == len(EACH_ONCE), "there are no further notes"
    for name in (*HARMLESS, "TANGENT"):
        assert not any(name in line for line in lines), f"{name} does not change the picture"


def test_json_has_the_same_notes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = everything().save(tmp_path / "ball.glb")
    lines = [f"ball.glb: {line}" for line in scene_and_notes(path)[1]]
    assert main(["info", str(path), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["notes"] == lines
    assert err == "", "the notes are part of the result, and no warnings"
    picture = tmp_path / "ball.png"
    assert main(["render", str(path), "--json", "--method", "lambert", "--size", "8x8", "-o", str(picture)]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["warnings"] == lines
    assert err.splitlines() == [f"wgsss: warning: {line}" for line in lines]


def test_equal_losses_of_two_parts_are_one_note(tmp_path: Path) -> None:
    file = File()
    bumps = texture(file, encoded(np.full((2, 2, 3), 128, np.uint8)))
    base = {"baseColorTexture": {"index": texture(file)}, "metallicFactor": 0}
    material = file.add("materials", pbrMetallicRoughness=base, normalTexture={"index": bumps, "texCoord": 1})
    for shift in (0, 0.2, 0.4):
        attributes = {"TEXCOORD_1": file.rows(ball()[1] * 2, "VEC2")}
        file.node(mesh=file.mesh(ball_primitive(file, material, (shift, 0, 0), attributes=attributes)))
    assert len(scene_and_notes(file, tmp_path)[1]) == 1


# --- files that are used completely ----------------------------------------------------------------------------------


def bare() -> File:
    file = File()
    file.node(mesh=file.mesh(ball_primitive(file)))
    return file


def full() -> File:
    """Make a file with all properties that are used: two materials, textures, a transform, a medium, an animation."""
    file = File()
    uvs = file.rows(ball()[1], "VEC2")
    normal = texture(file, encoded(np.full((2, 2, 3), (128, 128, 255), np.uint8)))
    shine = texture(file, encoded(np.full((2, 2, 4), 200, np.uint8)))
    extensions = {
        "KHR_materials_ior": {"ior": 1.4},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularTexture": {"index": shine}},
        "KHR_materials_volume": {
            "thicknessFactor": 1,
            "attenuationDistance": 0.001,
            "attenuationColor": [0.5, 0.4, 0.3],
        },
        "KHR_materials_volume_scatter": {"multiscatterColor": [0.8, 0.7, 0.6]},
        "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 1},
    }
    skin = file.add(
        "materials",
        name="skin",
        doubleSided=True,
        normalTexture={"index": normal, "scale": 0.5},
        pbrMetallicRoughness={
            "baseColorTexture": {"index": texture(file)},
            "metallicFactor": 0,
            "roughnessFactor": 0.4,
        },
        extensions=extensions,
    )
    file.node(mesh=file.mesh(ball_primitive(file, skin, attributes={"TEXCOORD_0": uvs})))
    moved = {"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    colors = file.rows(np.clip(ball()[0] / RADIUS, 0, 1), "VEC3")
    second = ball_primitive(file, colored(file, **moved), attributes={"COLOR_0": colors})
    file.node(mesh=file.mesh(second), translation=[0.1, 0, 0])
    times, places = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0), (0, 0.1, 0)], "VEC3")
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    file.add("animations", name="Lift", channels=[channel], samplers=[{"input": times, "output": places}])
    return file


@pytest.mark.parametrize("make", [bare, checkered, full])
def test_a_file_that_is_used_completely_gives_no_warning(tmp_path: Path, make: Callable[[], File]) -> None:
    assert loaded(make(), tmp_path).objects


# --- extensions that a file requires ---------------------------------------------------------------------------------


def test_an_unknown_required_extension_is_an_error_that_names_it(tmp_path: Path) -> None:
    file = checkered()
    file.tree["extensionsUsed"] = file.tree["extensionsRequired"] = ["VENDOR_unknown"]
    with pytest.raises(InputError, match=r"ball\.glb: it requires VENDOR_unknown"):
        load_scene(file.save(tmp_path / "ball.glb"))


def test_an_unknown_optional_extension_in_use_is_a_warning(tmp_path: Path) -> None:
    file = checkered()
    file.tree["extensionsUsed"] = ["VENDOR_unknown", "VENDOR_nowhere"]
    file.tree["nodes"][0]["extensions"] = {"VENDOR_unknown": {}}
    lines = scene_and_notes(file, tmp_path)[1]
    assert len(lines) == 1 and "VENDOR_unknown" in lines[0]
