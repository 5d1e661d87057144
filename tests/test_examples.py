"""What users copy from works: the scene files and scripts in examples/, and what the README shows."""

from __future__ import annotations

import json
import re
import runpy
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image as Picture

from wgsss.cli import _parse
from wgsss.methods import METHODS
from wgsss.scene import EnvironmentLight, load_material, load_scene

EXAMPLES = ROOT / "examples"
README = (ROOT / "README.md").read_text()
MATERIALS = ["jade", "layers"]
SCENES = sorted({path.stem for path in EXAMPLES.glob("*.toml")} - set(MATERIALS))


@pytest.mark.parametrize("name", SCENES)
def test_scene_files_load_and_are_lit(name: str) -> None:
    scene = load_scene(EXAMPLES / f"{name}.toml")
    assert any(not isinstance(light, EnvironmentLight) for light in scene.lights)
    view, middle = scene.camera.view(), scene.bounds.mean(axis=0)
    assert abs((view[:3, :3] @ middle + view[:3, 3])[:2]).max() < np.ptp(scene.bounds, axis=0).max() / 2


@pytest.mark.parametrize("name", MATERIALS)
def test_material_files_load(name: str) -> None:
    assert load_material(EXAMPLES / f"{name}.toml").name == name


def test_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = runpy.run_path(str(EXAMPLES / "side_by_side.py"))
    script["main"](["sphere", "lambert", "lambert", "--side", "16", "-o", str(tmp_path / "a.png")])
    with Picture.open(tmp_path / "a.png") as picture:
        left, right = np.split(np.asarray(picture), 2, axis=1)
    np.testing.assert_array_equal(left, right)
    assert capsys.readouterr().out.count("mean radiance") == 2


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., list[list[str]]]:
    """Runs a script in examples/ and gives the words of each line of its table."""
    monkeypatch.syspath_prepend(str(EXAMPLES))

    def run(name: str, *args: str) -> list[list[str]]:
        runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](list(args))
        return [line.split() for line in capsys.readouterr().out.splitlines()]

    return run


TINY = ("--receivers", "8", "--vertices", "300")


def test_sam_convergence(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    chosen = ("--samples", "1", "100", "--select", "top", "-o", str(tmp_path / "a.png"))
    _, few, most = script("sam_convergence", "wave", *TINY, *chosen)
    assert few[:2] == ["top", "1"] and most[:2] == ["top", "100"]
    assert [float(error) for error in few[2:]] == pytest.approx([0.97, 0.97], abs=0.02)
    assert max(float(error) for error in most[2:]) < 0.1, "nearly all senders that there are"
    with Picture.open(tmp_path / "a.png") as picture:
        assert np.asarray(picture).std() > 10


def test_sam_tessellation(script: Callable[..., list[list[str]]]) -> None:
    _, row = script("sam_tessellation", "--scene", "wave", *TINY)
    assert abs(int(row[0]) - 300) < 100 and len(row) == 5
    assert float(row[3]) < 0.5 * float(row[1])


def test_sam_flicker(script: Callable[..., list[list[str]]]) -> None:
    rows = script("sam_flicker", "wave", *TINY, "--rate", "8")
    assert [row[0] for row in rows[1:]] == ["all", "top", "top", "top", "fit", "fit", "fit"]
    assert all(float(row[6]) < float(row[2]) for row in rows[2:]), "what is blended flickers less"


def test_sam_bake_times(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    chart = tmp_path / "a.png"
    size = ["--vertices", "300", "500", "--select", "top", "--materials"]
    rows = script("sam_bake_times", "--scene", "wave", *size, "-o", str(chart))
    assert [row[3] for row in rows[1:3]] == ["top", "top"]
    assert all(float(row[4]) > 0 and row[-1] == "48" for row in rows[1:3])
    with Picture.open(chart) as picture:
        assert np.asarray(picture).std() > 10


def test_light_types(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    def run(name: str, share: float) -> dict:
        return {"name": name, "error": {"rel_rmse": share, "floor": 0.01}}

    lights = {"sun": [run("a", 0.5), run("b", 0.25)], "sky": [run("a", 1.25), run("b", 0.125)]}
    found = {"scene": "ear", "reference": "integral", "methods": [run("a", 0.75), run("b", 0.0625)], "lights": lights}
    (tmp_path / "metrics.json").write_text(json.dumps(found))
    table = runpy.run_path(str(EXAMPLES / "light_types.py"))["read"](tmp_path)
    assert table[:3] == ("ear", ["a", "b", "(integral)"], ["own", "sun", "sky"])
    np.testing.assert_array_equal(table.errors, [[75, 50, 125], [6.25, 25, 12.5], [1, 1, 1]])

    script("light_types", str(tmp_path), "-o", str(tmp_path / "a.png"))
    with Picture.open(tmp_path / "a.png") as picture:
        assert np.asarray(picture).std() > 10
    del found["lights"]
    (tmp_path / "metrics.json").write_text(json.dumps(found))
    with pytest.raises(SystemExit, match="without --lights all"):
        script("light_types", str(tmp_path))


def test_screen_space_angles(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    rows = script(
        "screen_space_angles", "--angles", "45", "--size", "96", "--rounds", "1", "-o", str(tmp_path / "a.png")
    )
    tables = [[float(cell.strip("()")) for cell in row] for row in rows if len(row) == 7 and row[0][0].isdigit()]
    # Line spread, as a kernel and as drawn, svd, radial: with all six Gaussians, and without the narrowest.
    assert [row[1] for row in tables] == pytest.approx([0.074, 0.034], abs=0.0015)
    assert all(row[2] == pytest.approx(row[1], abs=0.01) for row in tables)
    assert all(row[3] < 0.016 and row[4] < 0.02 and row[5] > 0.05 for row in tables)
    assert [row[0] for row in rows[-4:]] == ["9", "17", "33", "65"]
    with Picture.open(tmp_path / "a.png") as picture:
        assert np.asarray(picture).std() > 10


def test_python_in_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README, re.S)
    assert blocks
    smaller = {"(512, 512)": "(24, 24)", '"ear"': '"ear", vertices=500', "15.0": "15.0, vertices=300", "=2048": "=64"}
    for block in blocks:
        for whole, small in smaller.items():
            block = block.replace(whole, small)
        exec(compile(block, "README.md", "exec"), {})


def test_commands_in_the_readme_parse() -> None:
    lines = [
        line.split("#")[0].strip()
        for block in re.findall(r"```sh\n(.*?)```", README, re.S)
        for line in block.splitlines()
    ]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("wgsss ")]
    assert len(commands) > 5
    for command in commands:
        _parse(command)


def test_scene_file_in_the_readme_loads(tmp_path: Path) -> None:
    for number, block in enumerate(re.findall(r"```toml\n(.*?)```", README, re.S)):
        path = tmp_path / f"{number}.toml"
        path.write_text(re.sub(r'mesh = ".*"\nsize_mm = .*', 'shape = "sphere"', block))
        load_scene(path)


def test_the_readme_names_every_method_and_every_file_it_shows() -> None:
    for name, kind in METHODS.items():
        row = re.search(rf"^\| `{name}` \|.*$", README, re.M)
        assert row and kind.source.split(",")[0] in row.group(), f"{name}: the table of methods needs a row"
    prose = re.sub(r"```.*?```", "", README, flags=re.S)
    for target in re.findall(r"\]\(([^)#]+)\)", prose):
        assert target.startswith("http") or (ROOT / target).exists(), target
