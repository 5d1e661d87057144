"""`wgsss info FILE`: its text and its JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import ball_primitive, checkered, colored
from gltfs import File
from scenes import write_environment

from wgsss.cli import main

MARBLE_MM = 19.5
"""how far light spreads in it"""


@pytest.fixture
def info(capsys: pytest.CaptureFixture[str]) -> Any:
    """Return the output of the command, which must not print anything else."""

    def run(path: Path, *options: str) -> str:
        assert main(["info", str(path), *options]) == 0
        out, err = capsys.readouterr()
        assert err == ""
        return out

    return run


def lines_of(text: str) -> dict[str, str]:
    """Return the lines above the first empty line, by their first word."""
    head = text.split("\n\n")[0].splitlines()
    return {line.split("  ")[0]: line[line.index("  ") :].strip() for line in head}


def table_of(text: str) -> list[dict[str, str]]:
    """Return the table of bodies, by the names of its columns."""
    first, *rows = text.split("\n\n")[1].splitlines()
    names = [name for name in first.replace(", mm", "-mm").replace("light spreads", "light-spreads").split()]
    starts = [first.index(name.replace("-mm", ", mm").replace("-", " ")) for name in names]
    ends = [*starts[1:], None]
    return [{n: row[a:b].strip() for n, a, b in zip(names, starts, ends, strict=True)} for row in rows]


def test_info_describes_a_mesh(tmp_path: Path, info: Any) -> None:
    path = checkered().save(tmp_path / "ball.glb")
    text = info(path)
    head, (body,) = lines_of(text), table_of(text)
    assert head["file"] == str(path) and head["holds"] == "mesh (glTF)"
    assert head["size"].endswith(" mm") and "100" in head["size"]
    assert head["unit"] == "metre, as the format says (--size-mm X makes the longest side X mm)"
    assert (body["body"], body["faces"], body["vertices"], body["surface"]) == ("ball", "476", "240", "closed")
    assert (body["material"], body["light-spreads"]) == ("marble", f"{MARBLE_MM} mm")
    assert body["has"] == "base colour texture 64 x 64"
    assert text.rstrip().endswith("notes  all that it holds is used")


def test_info_of_a_format_without_a_unit(tmp_path: Path, info: Any) -> None:
    (tmp_path / "tetra.obj").write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    head = lines_of(info(tmp_path / "tetra.obj"))
    assert head["unit"].startswith("not stated: taken for a millimetre") and head["size"] == "9 x 9 x 9 mm"


def test_info_describes_all_contents_of_a_mesh_file(tmp_path: Path, info: Any) -> None:
    file = File()
    red = file.add(
        "materials", name="red", pbrMetallicRoughness={"baseColorFactor": [1, 0.25, 0, 1], "metallicFactor": 0}
    )
    file.node(mesh=file.mesh(ball_primitive(file, colored(file))))
    file.node(mesh=file.mesh(ball_primitive(file, red)), translation=[0.2, 0, 0])
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}, {"type": "directional"}]}}
    for light in (0, 1, 1):
        file.node(extensions={"KHR_lights_punctual": {"light": light}})
    file.node(camera=file.add("cameras", type="perspective", perspective={"yfov": 1, "znear": 0.1}))
    times, places = file.rows([0, 1], "SCALAR"), file.rows([(0, 0, 0), (0, 0.1, 0)], "VEC3")
    for name in ("Walk", "Run"):
        channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
        file.add("animations", name=name, channels=[channel], samplers=[{"input": times, "output": places}])
    path = file.save(tmp_path / "two.glb")
    text = info(path)
    head, bodies = lines_of(text), table_of(text)
    assert head["lights"] == "1 point, 2 directional (--file-lights uses them)"
    assert head["cameras"] == "1 perspective (--file-camera uses the first)"
    assert head["animations"] == "Walk (plays), Run (--animation NAME plays another, or none)"
    assert [body["has"] for body in bodies] == ["base colour texture 64 x 64, a motion", "base colour 1 0.25 0"]
    notes = [line.removeprefix("notes").strip() for line in text.rstrip().split("\n\n")[2].splitlines()]
    assert notes == [
        "plays Walk, the first of 2 animations (--animation NAME plays another: Run)",
        "3 lights of the file are not used (--file-lights uses them)",
        "1 camera of the file is not used (--file-camera uses it)",
    ]
    result = json.loads(info(path, "--json"))
    assert result["notes"] == [f"two.glb: {note}" for note in notes]
    assert [body["moves"] for body in result["bodies"]] == [True, False]
    assert (result["animations"], result["plays"], result["mm_per_unit"]) == (["Walk", "Run"], "Walk", 1000.0)
    assert [light["kind"] for light in result["lights"]] == ["point", "directional", "directional"]


def test_info_notes_repairs_and_missing_files(tmp_path: Path, info: Any) -> None:
    file = checkered("gone.png")
    corners = file.tree["meshes"][0]["primitives"][0]
    accessor = file.tree["accessors"][corners["indices"]]
    accessor["count"] -= 3
    text = info(file.save(tmp_path / "ball.gltf"))
    assert table_of(text)[0]["surface"] == "open" and "3 boundary edges (1 hole)" in text
    assert "gone.png" in text and table_of(text)[0]["has"] == ""


def test_info_lists_the_first_of_many_bodies(tmp_path: Path, info: Any) -> None:
    file = File()
    for number in range(45):
        pbr = {"baseColorFactor": [number / 45, 0.5, 0.5, 1], "metallicFactor": 0}
        material = file.add("materials", name=f"m{number}", pbrMetallicRoughness=pbr)
        file.node(mesh=file.mesh(file.primitive(material=material)), translation=[2 * number, 0, 0])
    path = file.save(tmp_path / "many.glb")
    text = info(path)
    assert "… and 5 more (--json lists all)" in text and "m39" in text and "m40" not in text
    assert len(json.loads(info(path, "--json"))["bodies"]) == 45


def test_info_describes_scenes_materials_and_skies(tmp_path: Path, info: Any) -> None:
    sky = write_environment(tmp_path / "sky.exr", np.full((4, 8, 3), (1, 2, 3), np.float32))
    (tmp_path / "wax.toml").write_text("sigma_a = [0.01, 0.02, 0.03]\nsigma_s_prime = [1, 1, 1]\n")
    (tmp_path / "scene.toml").write_text(
        '[[object]]\nshape = "sphere"\nvertices = 500\nmaterial = "wax.toml"\n'
        '[[light]]\nkind = "environment"\nfile = "sky.exr"\n[[light]]\nkind = "directional"\n'
        "direction = [0, -1, 0]\nirradiance = [1, 1, 1]\n"
    )
    text = info(tmp_path / "scene.toml")
    head, (body,) = lines_of(text), table_of(text)
    assert head["holds"] == "scene" and head["lights"] == f"1 environment {sky}, 1 directional"
    assert head["cameras"] == "1 perspective" and body["material"] == "wax"

    head = lines_of(info(tmp_path / "wax.toml"))
    assert head["holds"] == "material wax" and head["light spreads"].endswith(" mm")

    head = lines_of(info(Path(sky)))
    assert (head["holds"], head["size"]) == ("environment image", "8 x 4 pixels")
    assert head["mean radiance"] == "1 2 3 W/(m^2 sr), red green blue" and head["greatest"] == "3 W/(m^2 sr)"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.fbx", b"x", "not a kind of file that can be described"),
        ("a.glb", b"x", "a.glb: "),
        ("a.glb", None, "a.glb: no such file"),
        ("a.toml", b"name = ", "a.toml: not a TOML file"),
        ("a.toml", b"", "a.toml: the file is empty"),
        ("a.exr", b"x", "a.exr: "),
    ],
)
def test_unreadable_files_are_errors_of_one_line(
    tmp_path: Path, name: str, content: bytes | None, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert main(["info", str(tmp_path / name)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("wgsss: error: ") and err.count("\n") == 1 and words in err


REAL = (
    "anim/AnimatedMorphSphere.glb",
    "anim/Fox.glb",
    "gltf_materials/AttenuationTest.glb",
    "gltf_materials/ExtVolumeScatterDiffuseTransmission.gltf",
    "lee_perry_smith/LeePerrySmith.glb",
    "lee_perry_smith/LeePerrySmith.obj",
    "spot.obj",
    "bunny_stanford.ply",
    "env/forest.exr",
    "env/brown_photostudio_02_1k.hdr",
)


@pytest.mark.parametrize("name", REAL)
def test_info_describes_real_files(data: Path, info: Any, name: str) -> None:
    text = info(data / name)
    head = lines_of(text)
    assert head["file"] == str(data / name) and head["size"] and len(text.rstrip().split("\n\n")) in (2, 3)
    assert all(len(line) < 300 for line in text.splitlines()) and "nan" not in text
