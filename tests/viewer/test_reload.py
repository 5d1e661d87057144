"""Shaders are reread when their files change, and a faulty one gives way to the last that worked."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from wgsss import wgsl
from wgsss.viewer.reload import Shaders

FIRST, SECOND, FAULTY = "const A: u32 = 1u;\n", "const A: u32 = 2u;\n", "import package::nothing::{B};\n"


def save(path: Path, text: str, second: int) -> None:
    path.write_text(text)
    os.utime(path, (second, second))


def test_changed_shader_is_reread_and_a_faulty_one_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "module.wgsl"
    save(path, FIRST, 1)
    shaders = Shaders(tmp_path)
    assert wgsl.load("module", tmp_path).source.strip() == FIRST.strip()
    assert not shaders.reload_changed()
    save(path, SECOND, 2)
    assert shaders.reload_changed() and not shaders.reload_changed()
    assert wgsl.load("module", tmp_path).source.strip() == SECOND.strip()
    shaders.mark_working()
    save(path, FAULTY, 3)
    assert shaders.reload_changed()
    with pytest.raises(wgsl.WgslError, match="nothing"):
        wgsl.load("module", tmp_path)
    shaders.restore_working()
    assert wgsl.load("module", tmp_path).source.strip() == SECOND.strip()
