"""`wgsss export`: its files and its output."""

from __future__ import annotations

import json

from wgsss.cli import main
from wgsss.scene import load_mesh, load_scene


def test_export_writes_a_scene_for_mitsuba(tmp_path, capsys):
    folder = tmp_path / "deep" / "ball"
    assert main(["export", "sphere", "--vertices", "100", "--mitsuba", str(folder), "--size", "30x20", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["files"] == [str(folder / "scene.xml"), str(folder / "1.ply")]
    assert result["scene"] == "sphere"
    text = (folder / "scene.xml").read_text()
    assert '<integer name="width" value="30"' in text
    assert '<integer name="height" value="20"' in text


def test_a_moving_scene_is_exported_at_a_time(tmp_path, capsys):
    assert main(["export", "wave", "--mitsuba", str(tmp_path), "--time", "1"]) == 0
    assert str(tmp_path / "scene.xml") in capsys.readouterr().out
    moved = load_scene("wave").at(1.0).objects[0].placed
    assert abs(load_mesh(tmp_path / "1.ply").mesh.bounds - [moved.min(axis=0), moved.max(axis=0)]).max() < 1e-4


def test_bad_input_is_an_error(tmp_path, capsys):
    assert main(["export", "ear", "--mitsuba", str(tmp_path)]) == 2
    assert "needs coefficients or layers, not gaussians" in capsys.readouterr().err
    assert main(["export", "sphere"]) == 2
    assert "--mitsuba" in capsys.readouterr().err
