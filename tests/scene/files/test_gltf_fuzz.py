"""Damaged glTF files are read, or refused in one line that names them."""

from __future__ import annotations

import copy
import json
import random
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import CODES, TETRAHEDRON, File, png

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.gltf import read_gltf

SEED, COUNT = 15, 25  # number of changes of the JSON, and of the bytes, of each file
MEMORY = 64e6
"""bytes that no file of a few thousand may take"""

STRANGE: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 7, 255, 65536, 2**31, 2**63, 10**400, -0.5, 1e300, float("nan"), float("inf"),
    "", "a", "0", "\ud800\n", "data:,", "../..", "/dev/zero", [], {}, [[]], [{}], [None], {"extensions": []}, [0, 0],
    ["a"], [-1], [10**9] * 3, {"index": 0}, "MAT4", "VEC3", "weights",
)  # fmt: skip


def plain() -> File:
    """Make a file with textures, colours, strips, sparse accessors and a material with all properties that are read."""
    file = File()
    for _ in range(2):
        file.add("textures", source=file.add("images", bufferView=file.view(png()), mimeType="image/png"), sampler=0)
    file.add("samplers", wrapS=33071, magFilter=9728)
    sparse = {
        "count": 1,
        "indices": {"bufferView": file.view([1], "u2"), "componentType": CODES["u2"]},
        "values": {"bufferView": file.view([(2, 0, 0)], "f4")},
    }
    attributes = {
        "POSITION": file.rows(TETRAHEDRON, "VEC3", sparse=sparse),
        "NORMAL": file.rows(TETRAHEDRON * 127, "VEC3", "i1", normalized=True),
        "TEXCOORD_0": file.rows(TETRAHEDRON[:, :2] * 255, "VEC2", "u1", normalized=True),
        "COLOR_0": file.rows(np.ones((4, 4)) / 2, "VEC4"),
    }
    transform = {"KHR_texture_transform": {"offset": [0, 1], "rotation": 1, "scale": [1, 2], "texCoord": 0}}
    file.add(
        "materials",
        pbrMetallicRoughness={
            "baseColorFactor": [1, 0.5, 0.5, 1],
            "baseColorTexture": {"index": 0, "extensions": transform},
            "roughnessFactor": 0.5,
        },
        normalTexture={"index": 1, "scale": 2},
        alphaMode="MASK",
        alphaCutoff=0.3,
        extensions={
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularTexture": {"index": 1}},
            "KHR_materials_volume": {"attenuationDistance": 0.01, "attenuationColor": [0.5, 0.5, 0.9]},
            "KHR_materials_volume_scatter": {"multiscatterColor": [0.5, 0.6, 0.7], "scatterAnisotropy": 0.1},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5},
        },
    )
    strip = file.primitive(TETRAHEDRON, (0, 1, 2, 3), mode=5, attributes=attributes, material=0)
    file.node(mesh=file.mesh(strip, file.primitive(mode=6)), matrix=np.eye(4).ravel().tolist(), children=[1])
    file.node(mesh=0, rotation=[0, 0, 0, 1], scale=[1, 2, 3], translation=[0, 0, 1], root=False)
    return file


def moving() -> File:
    """Make a file with a skin, morph targets, instances, an animation, lights and a camera."""
    file = File()
    attributes = {
        "JOINTS_0": file.rows(np.zeros((4, 4)), "VEC4", "u1"),
        "WEIGHTS_0": file.rows(np.ones((4, 4)), "VEC4"),
    }
    targets = [{"POSITION": file.rows(TETRAHEDRON, "VEC3")}]
    file.mesh(file.primitive(attributes=attributes, targets=targets), weights=[0.5])
    file.node(mesh=0, skin=0, camera=0)
    places = {"TRANSLATION": file.rows(np.ones((2, 3)), "VEC3"), "SCALE": file.rows(np.ones((2, 3)), "VEC3")}
    file.node(mesh=0, extensions={"EXT_mesh_gpu_instancing": {"attributes": places}})
    file.node(extensions={"KHR_lights_punctual": {"light": 0}, "KHR_node_visibility": {"visible": True}})
    file.add("skins", joints=[2, 1], inverseBindMatrices=file.rows(np.tile(np.eye(4).ravel(), (2, 1)), "MAT4"))
    file.add("cameras", type="perspective", perspective={"yfov": 1, "znear": 1})
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "color": [1, 1, 1]}]}}
    samplers = [
        {"input": file.rows((0, 1), "SCALAR"), "output": file.rows(np.ones((2, 4)), "VEC4"), "interpolation": "LINEAR"},
        {"input": file.rows((0, 1), "SCALAR"), "output": file.rows((0, 1), "SCALAR")},
    ]
    channels = [
        {"sampler": 0, "target": {"node": 2, "path": "rotation"}},
        {"sampler": 1, "target": {"node": 0, "path": "weights"}},
    ]
    file.add("animations", samplers=samplers, channels=channels, name="Move")
    file.tree["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    return file


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Yield all containers in a tree, with each of their keys."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        yield tree, key
        if isinstance(value, dict | list):
            yield from places(value)


def change_json(file: File, dice: random.Random) -> bytes:
    """Replace, remove or move up to three values of the JSON."""
    changed = copy.deepcopy(file)
    for _ in range(dice.randint(1, 3)):
        fields = list(places(changed.tree))
        container, key = dice.choice(fields)
        kind = dice.random()
        if kind < 0.75:
            container[key] = dice.choice(STRANGE)
        elif kind < 0.9:
            other, place = dice.choice(fields)
            container[key] = copy.deepcopy(other[place])
        else:
            del container[key]
    return changed.glb()


def change_bytes(file: File, dice: random.Random) -> bytes:
    """Change, cut off or insert some bytes."""
    data = bytearray(file.glb())
    for _ in range(dice.choice((1, 3, 30))):
        data[dice.randrange(len(data))] = dice.randrange(256)
    kind, at = dice.randrange(4), dice.randrange(len(data))
    if kind == 0:
        del data[at:]
    elif kind == 1:
        data[at:at] = dice.randbytes(dice.randint(1, 40))
    elif kind == 2:
        del data[at : at + dice.randint(1, 40)]
    return bytes(data)


def use(contents: Contents) -> None:
    """Access all contents, as a caller of the reader would."""
    assert contents.parts and all("\n" not in note for note in contents.notes)
    for part in contents.parts:
        assert part.faces.shape[1:] == (3,) and len(part.faces)
        assert 0 <= part.faces.min() <= part.faces.max() < len(part.positions)
        assert np.isfinite(part.positions).all() and np.isfinite(part.matrix).all()
        assert all(len(uv) == len(part.positions) and np.isfinite(uv).all() for uv in part.uvs.values())
        if part.look.medium is not None:
            assert np.isfinite([part.look.medium.sigma_a, part.look.medium.sigma_s_prime]).all()
    for read in contents.animations.values():
        read()
    if contents.rig is not None:
        assert len(contents.rig.parts) == len(contents.parts)
        contents.rig.positions(contents.rig.nodes.rest)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("make", [plain, moving])
@pytest.mark.parametrize("change", [change_json, change_bytes])
def test_a_damaged_file_is_read_or_refused_in_one_line(
    tmp_path: Path, make: Callable[[], File], change: Callable[[File, random.Random], bytes]
) -> None:
    dice, file, path = random.Random(SEED), make(), tmp_path / "damaged.glb"
    path.write_bytes(file.glb())
    use(read_gltf(path))
    count = 3 * COUNT if change is change_json else COUNT
    outcomes = []
    tracemalloc.start()
    for _ in range(count):
        path.write_bytes(change(file, dice))
        try:
            use(read_gltf(path))
            outcomes.append("")
        except InputError as error:
            message = str(error)
            assert message.startswith(f"{path}: ") and "\n" not in message and message.isprintable()
            assert "it cannot be read (" not in message, "the error is specific"
            outcomes.append(message)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MEMORY
    assert any(outcomes) and len(set(outcomes)) > 5, "some files are refused"


def test_every_value_may_be_of_a_wrong_type(tmp_path: Path) -> None:
    """Each value of a file in turn is replaced by a random one."""
    dice, path = random.Random(SEED), tmp_path / "damaged.gltf"
    for file in (plain(), moving()):
        file.save(path)
        text = json.dumps(file.tree)
        for number in range(len(list(places(json.loads(text))))):
            tree = json.loads(text)
            container, key = list(places(tree))[number]
            container[key] = dice.choice(STRANGE)
            path.write_text(json.dumps(tree))
            try:
                use(read_gltf(path))
            except InputError as error:
                assert str(error).startswith(f"{path}: ") and "it cannot be read (" not in str(error)
