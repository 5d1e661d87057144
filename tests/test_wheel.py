"""The wheel contains all that the program needs, without the checkout."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image as Picture

needs_hatchling = pytest.mark.skipif(not find_spec("hatchling"), reason="hatchling, which builds it, is not installed")
pytestmark = needs_hatchling


def run(*command: Any, cwd: Path, **env: str) -> str:
    done = subprocess.run(
        [sys.executable, *map(str, command)], cwd=cwd, env={**os.environ, **env}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run("-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, ROOT, cwd=folder)
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install wgsss into a folder for PYTHONPATH. Its dependencies come from the environment."""
    folder = tmp_path_factory.mktemp("site")
    run("-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target", folder, wheel, cwd=folder)
    return folder


def test_the_wheel_has_all_files_of_the_package_and_no_others(wheel: Path) -> None:
    listed = subprocess.run(["git", "ls-files", "wgsss", "wgsl"], cwd=ROOT, capture_output=True, text=True).stdout
    expected = {f"wgsss/{name}" if name.startswith("wgsl/") else name for name in listed.splitlines()}
    if not expected:
        pytest.skip("not a git checkout")
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert packed == expected
    assert {"wgsss/py.typed", "wgsss/study/report.html", "wgsss/wgsl/fresnel.wgsl"} <= packed


def test_the_installed_package_renders_in_an_empty_folder(site: Path, tmp_path: Path) -> None:
    place = run("-c", "import wgsss; print(wgsss.__file__)", cwd=tmp_path, PYTHONPATH=str(site))
    assert Path(place.strip()).is_relative_to(site)
    command = ["-m", "wgsss", "render", "sphere", "--vertices", "500", "--size", "32x32", "--json"]
    result = json.loads(run(*command, cwd=tmp_path, PYTHONPATH=str(site)))
    assert result["files"] == ["sphere.png"]
    with Picture.open(tmp_path / "sphere.png") as picture:
        pixels = np.asarray(picture)
    assert pixels[16, 16, 3] == 255 and pixels[16, 16, :3].max() > 40
    assert [path.name for path in tmp_path.iterdir()] == ["sphere.png"]


def test_the_installed_package_finds_all_shaders(site: Path, tmp_path: Path) -> None:
    script = """
from pathlib import Path
import wgsss
from wgsss import wgsl
root = Path(wgsss.__file__).parent / "wgsl"
for file in root.rglob("*.wgsl"):
    wgsl.load(str(file.relative_to(root).with_suffix("")))
"""
    run("-c", script, cwd=tmp_path, PYTHONPATH=str(site))
