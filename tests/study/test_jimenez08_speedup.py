"""The table of speed-ups: the measurement, and the output of the command."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from wgsss.cli import main
from wgsss.study import jimenez08_speedup as table
from wgsss.study.jimenez08_speedup import DISTANCES, HEADS, PAPER, UNIT_MM


class Clock:
    """Replaces the renderer: frames of deon07 take heads x distance x 10 ms at first, and frames of the other half
    as long."""

    made: ClassVar[list[Clock]] = []

    def __init__(self, scene, method, size):
        self.scene, self.method, self.size, self.frames = scene, method, size, 0
        Clock.made.append(self)

    def frame(self):
        self.frames += 1
        camera = self.scene.camera
        ms = 10 * len(self.scene.objects) * np.linalg.norm(np.subtract(camera.eye, camera.target)) / UNIT_MM
        half = 1.0 if type(self.method).__name__ == "TextureSpace" else 0.5
        wobble = 3.0 if self.frames == 1 else 1.0
        return SimpleNamespace(timings={"a": 0.25 * ms * half, "b": 0.75 * ms * half * wobble}, clock="sundial")


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Clock]:
    Clock.made = []
    crowd = table.crowd
    monkeypatch.setattr(table, "Renderer", Clock)
    monkeypatch.setattr(table, "crowd", lambda copies: crowd(1000, copies))
    monkeypatch.chdir(tmp_path)
    return Clock.made


def test_cells_hold_the_fastest_frames_of_both_methods_in_turn(clock):
    cells = []
    found = table.speedup("here", (960, 600), on_cell=cells.append)
    assert [(cell.heads, cell.distance) for cell in found.cells] == [(n, d) for n in HEADS for d in DISTANCES]
    assert list(found.cells) == cells and found.clock == "sundial" and found.map_size == 1024
    for cell in cells:
        assert cell.full_ms == pytest.approx(10 * cell.heads * cell.distance)
        assert cell.speedup == pytest.approx(2.0)
    assert [cell.paper for cell in cells] == [x for row in PAPER for x in row]
    assert all(made.method.map_size == 1024 and made.size == (960, 600) for made in clock)
    kept = json.loads(Path("here/speedup.json").read_text())
    assert kept == json.loads(json.dumps(found.json())) and len(kept["cells"]) == 30


def test_the_table_of_the_paper_is_as_printed():
    assert (PAPER[0][0], PAPER[0][-1], PAPER[-1][-1], PAPER[2][1]) == (1.17, 1.61, 2.77, 1.39)
    assert np.shape(PAPER) == (len(HEADS), len(DISTANCES)) and min(map(min, PAPER)) == 1.10


@pytest.mark.parametrize("heads", [1, 2, 5, 16])
def test_heads_stand_in_a_row_about_the_middle_one(heads):
    scene = table.view(heads, 20.0)
    places = np.array([head.translate for head in scene.objects])
    assert len(places) == heads and not places[:, 1:].any() and places[heads // 2, 0] == 0
    assert np.linalg.norm(scene.camera.eye) == pytest.approx(20 * UNIT_MM) and scene.camera.target == (0, 0, 0)
    if heads > 1:
        bounds = scene.objects[0].mesh.bounds
        assert (np.diff(places[:, 0]) > np.linalg.norm(np.ptp(bounds, axis=0)[[0, 2]]) * 0.85).all()


def test_the_command_prints_the_table_and_the_file(clock, capsys):
    assert main(["bench", "crowd", "--table", "speedup", "--size", "480x300"]) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].split() == ["heads", "2.5", "5", "10", "20", "50", "100"]
    assert lines[5].split()[:3] == ["16", "2.00", "(2.01)"]
    assert "480 x 300 pixels, maps of 512" in out and lines[-1] == "bench/speedup.json"
    assert err.splitlines()[0] == "1 heads at 2.5: 25 ms to 12 ms, 2.00 times" and len(err.splitlines()) == 30
    assert main(["bench", "crowd", "--table", "speedup", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["files"] == ["bench/speedup.json"] and len(result["cells"]) == 30


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["--table", "speedup"], "is of the scene crowd"),
        (["ear", "--table", "speedup"], "is of the scene crowd"),
        (["crowd", "--table", "speedup", "--methods", "sam"], "is of two methods"),
        (["crowd", "--table", "speedup", "-o", "file"], "file: this is not a folder"),
        (["crowd", "--table", "other"], "invalid choice: 'other'"),
    ],
)
def test_an_input_error_is_one_line(clock, capsys, argv, said):
    Path("file").touch()
    assert main(["bench", *argv]) == 2
    out, err = capsys.readouterr()
    assert out == "" and said in err.splitlines()[-1] and not clock
