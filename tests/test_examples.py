"""The scene files, the material files and the script in examples/ work."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image as Picture

from wgsss.scene import EnvironmentLight, load_material, load_scene

EXAMPLES = ROOT / "examples"
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
