"""`wgsss bench`: text, JSON, charts and interrupted runs."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from wgsss.cli import main
from wgsss.registry import METHODS, REFERENCES
from wgsss.scene import Scene
from wgsss.study import bench_run, provenance
from wgsss.study.bench_run import RunSpec

FILES = ["chart.html", "chart.png", "chart.svg", "runs.jsonl"]


def run(capsys: pytest.CaptureFixture[str], *argv: str, code: int = 0) -> tuple[str, str]:
    assert main(["bench", *argv]) == code
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return out, err


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[RunSpec]:
    """Replace measurements by fast stand-ins, in an empty folder. Return the list of runs."""
    specs: list[RunSpec] = []

    def fake(scene: Scene, spec: RunSpec) -> dict[str, Any]:
        specs.append(spec)
        ms = 10.0 * len(specs)
        costs = {"bake_ms": 1.0, "bake_cached": False, "frame_ms": ms, "frame_ms_quartiles": [ms, ms], "frames": 9}
        context = {"adapter": "a", "clock": "sundial", "date": "2026-01-02T03:04:05+00:00", "passes": {}, "bytes": 7}
        error = {"rel_rmse": 1.0 / ms, "psnr": None, "flip": None, "bias": 1.0}
        return {**spec.json(), **costs, **context, "error": error, "floor": 0.01}

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bench_run, "execute", fake)
    monkeypatch.setattr(provenance, "adapter", lambda: "a")
    monkeypatch.setitem(REFERENCES, "integral", METHODS["lambert"])  # only its name is used
    return specs


def test_text_has_a_row_per_run_and_names_the_files(done: list[RunSpec], tmp_path: Path, capsys):
    out, err = run(capsys, "slab", "sphere", "--methods", "lambert,deon07")
    table, files = out.split("\n\n")
    rows = [line.split()[:2] for line in table.splitlines()]
    assert rows[1:] == [[scene, m] for scene in ("slab", "sphere") for m in ("lambert", *["deon07"] * 4)]
    assert "map_size=2048" in table and "10.0" in table and "cold" in table
    assert sorted(path.name for path in (tmp_path / "bench").iterdir()) == FILES
    assert files.split() == [f"bench/chart.{extension}" for extension in ("svg", "png", "html")]
    assert len(err.splitlines()) == len(done) == 10  # a line per finished run
    assert err.startswith("slab by lambert: 10.00 ms, error 10 %\nslab by deon07 map_size=256 gaussians=6: 20.00 ms")


def test_json_has_the_runs(done: list[RunSpec], capsys):
    result = json.loads(run(capsys, "slab", "--methods", "lambert", "--size", "32x24", "-o", "here", "--json")[0])
    assert result["files"] == ["here/chart.svg", "here/chart.png", "here/chart.html"]
    (entry,) = result["runs"]
    promised = {"scene", "method", "knobs", "size", "adapter", "bake_ms", "frame_ms", "passes", "bytes", "error"}
    assert promised <= entry.keys() and entry["error"].keys() == {"rel_rmse", "psnr", "flip", "bias"}
    assert (entry["scene"], entry["size"], entry["reference"]) == ("slab", [32, 24], "integral")


def test_the_chart_has_all_runs_of_the_folder(done: list[RunSpec], capsys):
    run(capsys, "slab", "--methods", "lambert")
    first = Path("bench/chart.svg").read_text()
    run(capsys, "sphere", "--methods", "lambert")
    second = Path("bench/chart.svg").read_text()
    assert first != second
    Path("bench/chart.svg").unlink()
    out, err = run(capsys)
    assert Path("bench/chart.svg").read_text() == second and err == "" and len(done) == 2
    assert [line.split()[0] for line in out.splitlines()[1:3]] == ["slab", "sphere"]


def test_a_scene_named_twice_is_measured_once(done: list[RunSpec], capsys):
    run(capsys, "slab", "slab", "--methods", "lambert,lambert")
    assert len(done) == 1


def test_ctrl_c_keeps_finished_runs(done: list[RunSpec], monkeypatch: pytest.MonkeyPatch, capsys):
    fake = bench_run.execute

    def interrupted(scene: Scene, spec: RunSpec) -> Any:
        if len(done) == 2:
            raise KeyboardInterrupt
        return fake(scene, spec)

    with monkeypatch.context() as patch:
        patch.setattr(bench_run, "execute", interrupted)
        run(capsys, "slab", "--methods", "deon07", code=130)
    assert len(Path("bench/runs.jsonl").read_text().splitlines()) == 2
    run(capsys, "slab", "--methods", "deon07")
    assert [spec.knobs["map_size"] for spec in done] == [256, 512, 1024, 2048]


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        ([], "bench/runs.jsonl: no such file"),
        (["--material", "marble"], "without a scene"),
        (["eer"], "unknown scene 'eer'; did you mean 'ear'"),
        (["slab", "--methods", "lambrt"], "unknown method 'lambrt'; did you mean 'lambert'"),
        (["slab", "--methods", "lambert,"], "'lambert,' is not a list of names"),
        (["slab", "--reference", "truth"], "unknown reference 'truth'"),
        (["slab", "--size", "64"], "'64' is not WIDTHxHEIGHT"),
        (["slab", "-o", "file"], "file: this is not a folder"),
        (["slab", "--scheduler", "tcp://127.0.0.1:1"], r"Dask"),
        (["no/scene.toml"], "no/scene.toml"),
    ],
)
def test_bad_input_is_one_line(argv, says, done: list[RunSpec], monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    Path("file").touch()
    out, err = run(capsys, *argv, code=2)
    assert out == "" and err.count("\n") == 1 and re.search(says, err), err
    assert not done


def test_options_apply_to_every_scene(done: list[RunSpec], tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch):
    seen: list[Scene] = []
    fake = bench_run.execute
    monkeypatch.setattr(bench_run, "execute", lambda scene, spec: (seen.append(scene), fake(scene, spec))[1])
    cube = trimesh.creation.box()
    cube.export(tmp_path / "cube.ply")
    run(capsys, "cube.ply", "--methods", "lambert", "--material", "marble", "--size-mm", "80")
    run(capsys, "slab", "sphere", "--methods", "lambert", "--material", "ketchup", "--vertices", "500")
    assert [scene.objects[0].material.name for scene in seen] == ["marble", "ketchup", "ketchup"]
    assert np.ptp(seen[0].objects[0].mesh.bounds, axis=0).max() == pytest.approx(80.0)
    assert all(len(scene.objects[0].mesh.positions) < 700 for scene in seen)


def test_the_table_accepts_no_scene_options(capsys):
    _, err = run(capsys, "crowd", "--table", "speedup", "--material", "marble", code=2)
    assert "as it is" in err and err.count("\n") == 1
