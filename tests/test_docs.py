"""The text for users is true: its links resolve, its commands parse and its code runs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from conftest import ROOT

from wgsss.cli import _parse
from wgsss.methods import METHODS
from wgsss.scene import load_scene

README = (ROOT / "README.md").read_text()


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
