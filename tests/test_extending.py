"""The tutorial in docs/extending.md works: its method is added to a copy of the package, and renders."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT

RENDER = """
import json, sys
import numpy as np
import wgsss
from wgsss.scene.shapes import sphere

towards = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
ball = wgsss.Object(sphere(radius=15.0, vertices=2000), wgsss.material("skin1"))
sun = wgsss.DirectionalLight(direction=tuple(-towards), irradiance=(3.0, 3.0, 3.0))
camera = wgsss.OrthographicCamera((0, 0, 90), (0, 0, 0), height=31.0)
scene = wgsss.Scene("ball", (ball,), (sun,), camera)

images = {name: wgsss.render(scene, name, (64, 64), aovs=["M_front", "normal"]) for name in ("lambert", "wrap")}
plain, wrapped = (images[name].aovs["M_front"][..., 1] for name in ("lambert", "wrap"))
cosine = images["wrap"].aovs["normal"] @ towards
seen = images["wrap"].pixels[..., 3] > 0
frontal = wrapped[seen & (cosine > 0.99)] / plain[seen & (cosine > 0.99)]
terminator = seen & (abs(cosine) < 0.2)
dark = seen & (cosine < -0.55)
print(json.dumps({
    "package": wgsss.__file__,
    "frontal": [frontal.min().item(), frontal.max().item()],
    "terminator": (wrapped - plain)[terminator].min().item(),
    "dark": wrapped[dark].max().item(),
    "pixels": [int((seen & (cosine > 0.99)).sum()), int(terminator.sum()), int(dark.sum())],
}))
"""


def files() -> dict[str, str]:
    """Return the code blocks of the tutorial by the path that stands above each."""
    text = (ROOT / "docs" / "extending.md").read_text()
    return dict(re.findall(r"^\*\*`([\w/.]+)`\*\*\n\n```\w+\n(.*?)^```", text, re.S | re.M))


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of the package to which the tutorial's method has been added."""
    folder = tmp_path_factory.mktemp("copy")
    for name in ("wgsss", "wgsl"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path, text in files().items():
        target = folder / path
        if target.exists():  # the file with the table of methods
            line, row = text.splitlines()
            old = target.read_text()
            new = re.sub(r"^from wgsss\.methods\.", f"{line}\n\\g<0>", old, count=1, flags=re.M)
            new = re.sub(r"^ROWS = \($", f"\\g<0>\n{row}", new, count=1, flags=re.M)
            assert line in new and row in new
            target.write_text(new)
        else:
            target.parent.mkdir(exist_ok=True)
            target.write_text(text)
    return folder


def run(folder: Path, *arguments: str) -> Any:
    """Run Python with the copied package and return what it prints as JSON."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_tutorial_has_three_files_of_few_lines() -> None:
    python, shader, table = (len(text.splitlines()) for text in files().values())
    assert python <= 50 and shader <= 66 and table == 2


def test_the_command_line_lists_the_method_and_its_knob(copied: Path) -> None:
    methods = {method["name"]: method for method in run(copied, "-m", "wgsss", "methods", "--json")["methods"]}
    (knob,) = methods["wrap"]["knobs"]
    assert (knob["name"], knob["default"]) == ("wrap", 0.5)


def test_wrap_is_lambert_where_light_is_frontal_and_brighter_at_the_terminator(copied: Path) -> None:
    found = run(copied, "-c", RENDER)
    assert Path(found["package"]).is_relative_to(copied)
    assert min(found["pixels"]) > 10
    assert found["frontal"] == pytest.approx([1.0, 1.0], abs=0.02)
    assert found["terminator"] > 0.01
    assert found["dark"] == 0.0, "nothing arrives beyond the wrapped terminator"
