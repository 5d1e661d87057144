"""Files with absurd values give a scene, or one line that names the file."""

from __future__ import annotations

import copy
import random
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import ball, ball_primitive, checkered, colored, encoded, scene_and_notes, texture
from gltfs import File

from wgsss.cli.filetext import text_of
from wgsss.errors import InputError, Note
from wgsss.scene import load_scene
from wgsss.scene.describe import describe

VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 3, 0.5, 1e30, -1e30, 1e-30, 1e308, 10**20, "", "a", "MASK", "STEP"),
    *([], {}, [0], [1, 2, 3], [0, 0, 0], [1e30, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]),
)
FACTORS = (0, -1, 2, 1e6, 1e-6, 1e20)
OPTIONS: tuple[dict[str, Any], ...] = (
    *({}, {"size_mm": 20}, {"file_camera": True}, {"file_lights": True}, {"simplify": 50}, {"material": "skin"}),
)


def whole() -> File:
    """Make a file of two balls, one masked and animated, with a medium, a light and a camera."""
    file = File()
    leaf = np.dstack([np.full((8, 8, 3), 90, np.uint8), np.eye(8, dtype=np.uint8) * 200 + 50])
    base = {"index": texture(file, encoded(leaf), sampler=file.add("samplers", wrapS=33071, magFilter=9728))}
    medium = {"thicknessFactor": 1, "attenuationDistance": 0.01, "attenuationColor": [0.5, 0.4, 0.3]}
    masked = file.add(
        "materials",
        alphaMode="MASK",
        alphaCutoff=0.5,
        normalTexture={"index": texture(file), "scale": 0.5},
        pbrMetallicRoughness={"baseColorTexture": base, "roughnessFactor": 0.4, "metallicFactor": 0},
        extensions={
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_volume": medium,
            "KHR_materials_volume_scatter": {"multiscatterColor": [0.8, 0.7, 0.6], "scatterAnisotropy": 0.1},
        },
    )
    moved = {"extensions": {"KHR_texture_transform": {"scale": [2, 2], "rotation": 0.1}}}
    colors = {"COLOR_0": file.rows(np.full((len(ball()[0]), 3), 0.5), "VEC3")}
    file.node(mesh=file.mesh(ball_primitive(file, masked)), rotation=[0, 0, 0, 1], scale=[1, 1, 1])
    file.node(mesh=file.mesh(ball_primitive(file, colored(file, **moved), attributes=colors)), translation=[0.1, 0, 0])
    file.tree["extensions"] = {
        "KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1, "color": [1, 1, 1]}]}
    }
    file.node(extensions={"KHR_lights_punctual": {"light": 0}}, translation=[0, 0, 1])
    lens = {"yfov": 1, "znear": 0.1}
    file.node(camera=file.add("cameras", type="perspective", perspective=lens), translation=[0, 0, 1])
    times, scales = file.rows([0, 0.5, 1], "SCALAR"), file.rows([(1, 1, 1), (0, 0, 0), (1, 1, 1)], "VEC3")
    channel = {"sampler": 0, "target": {"node": 0, "path": "scale"}}
    sampler = {"input": times, "output": scales, "interpolation": "STEP"}
    file.add("animations", name="Blink", channels=[channel], samplers=[sampler])
    return file


def places(value: Any) -> list[tuple[Any, Any]]:
    """Yield each object or list of a tree with each of its keys or indices."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    return [place for key in keys for place in ((value, key), *places(value[key]))]


def spoilt(file: File, random_: random.Random) -> File:
    """Remove, scale or replace one to three values of a file, and in some cases change some bytes."""
    changed = copy.deepcopy(file)
    for _ in range(random_.choice((1, 1, 2, 3))):
        owner, key = random_.choice(places(changed.tree))
        value = owner[key] if isinstance(owner, list) or key in owner else None
        if random_.random() < 0.15:
            del owner[key]
        elif isinstance(value, int | float) and random_.random() < 0.7:
            owner[key] = value * random_.choice(FACTORS)
        else:
            owner[key] = copy.deepcopy(random_.choice(VALUES))
    for _ in range(random_.choice((0, 0, 0, 20))):
        changed.data[random_.randrange(len(changed.data))] = random_.randrange(256)
    return changed


@pytest.mark.parametrize("seed", range(4))
def test_modified_files_give_a_scene_or_one_line(tmp_path: Path, seed: int) -> None:
    file, random_, scenes = whole(), random.Random(seed), 0
    for number in range(40):
        path = spoilt(file, random_).save(tmp_path / "spoilt.glb")
        options = random_.choice(OPTIONS)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", Note)
            try:
                if number % 4:
                    scene = load_scene(path, **options)
                    assert np.isfinite(scene.bounds).all()
                else:
                    assert text_of(describe(path))
                scenes += 1
            except InputError as error:
                assert str(error).startswith(f"{path}: "), "it names the file"
                assert "\n" not in str(error) and len(str(error)) < 400
    assert scenes >= 4, "some modified files are read"


def test_the_unmodified_file_is_read(tmp_path: Path) -> None:
    scene, lines = scene_and_notes(whole(), tmp_path)
    assert len(scene.objects) == 2
    assert len(lines) == 4
    for words in ("boundary edge", "interpolation", "1 light", "1 camera"):
        assert [line for line in lines if words in line]


def test_a_part_too_small_to_be_seen_is_left_out(tmp_path: Path) -> None:
    file = checkered()
    tiny = file.add("materials", name="dust", pbrMetallicRoughness={"metallicFactor": 0, "roughnessFactor": 0.5})
    file.node(mesh=file.mesh(ball_primitive(file, tiny)), scale=[1e-12] * 3)
    scene, lines = scene_and_notes(file, tmp_path)
    assert len(scene.objects) == 1 and len(lines) == 1
    assert lines[0].startswith("dust: ") or lines[0].startswith("all ")
    assert "left out" in lines[0]


@pytest.mark.parametrize("kind", ["point", "directional"])
def test_a_light_that_is_not_finite_is_named(tmp_path: Path, kind: str) -> None:
    file = checkered()
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": kind, "intensity": 1e32, "name": "Sun"}]}}
    file.node(extensions={"KHR_lights_punctual": {"light": 0}})
    path = file.save(tmp_path / "ball.glb")
    assert scene_and_notes(path)[0].objects
    with pytest.raises(InputError, match=r"ball\.glb: light 0 \(Sun\): (intensity|irradiance) must be"):
        load_scene(path, file_lights=True)


def test_an_extreme_normal_scale_is_noted(tmp_path: Path) -> None:
    file = checkered()
    file.tree["materials"][0]["normalTexture"] = {"index": 0, "scale": -5000}
    scene, lines = scene_and_notes(file, tmp_path)
    assert lines == ["a normal scale of -5000 is replaced by -100"]
    assert scene.objects[0].material.maps.normal_scale == -100
