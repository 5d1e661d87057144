"""Shaders are read again when they are saved, and a bad one gives way to the last that was good."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from wgsss import wgsl
from wgsss.viewer.reload import Shaders

GOOD, BETTER, BAD = "const A: u32 = 1u;\n", "const A: u32 = 2u;\n", "import package::nothing::{B};\n"


def save(path: Path, text: str, second: int) -> None:
    path.write_text(text)
    os.utime(path, (second, second))


def test_a_saved_shader_is_read_again_and_a_bad_one_is_not_kept(tmp_path: Path) -> None:
    path = tmp_path / "module.wgsl"
    save(path, GOOD, 1)
    shaders = Shaders(tmp_path)
    assert wgsl.load("module", tmp_path).source.strip() == GOOD.strip()
    assert not shaders.changed()
    save(path, BETTER, 2)
    assert shaders.changed() and not shaders.changed()
    assert wgsl.load("module", tmp_path).source.strip() == BETTER.strip()
    shaders.keep()
    save(path, BAD, 3)
    assert shaders.changed()
    with pytest.raises(wgsl.WgslError, match="nothing"):
        wgsl.load("module", tmp_path)
    shaders.undo()
    assert wgsl.load("module", tmp_path).source.strip() == BETTER.strip()
