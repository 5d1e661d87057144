"""Which measured points and which runs of a benchmark the viewer shows."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from wgsss.methods import Method
from wgsss.registry import REFERENCES, make_method
from wgsss.scene import Scene, load_scene
from wgsss.scene.loading import with_material
from wgsss.study.metrics import Errors
from wgsss.study.provenance import adapter, scene_digest
from wgsss.viewer import manipulation
from wgsss.viewer.history import MAX_POINTS, History, MeasuredPoint, method_label
from wgsss.viewer.pictures import View

SCENE = load_scene("slab", vertices=300)
LAMBERT, JIMENEZ = make_method("lambert"), make_method("jimenez15")


def view_by(*methods: Method) -> View:
    return View(SCENE, methods, (24, 16))


def errors(*rel_rmse: float | None) -> list[Errors | None]:
    return [None if e is None else Errors(e, None, None, None, None, None) for e in rel_rmse]


def test_label_names_the_knobs_that_were_set() -> None:
    assert method_label(make_method("jimenez15")) == "jimenez15"
    assert method_label(make_method("sam", {"samples": 8, "surface": "screen"})) == "screen+sam, samples 8"
    assert method_label(make_method("jensen02", {"epsilon": 0.25})) == "jensen02, epsilon 0.25"


def test_point_stays_until_the_same_method_is_measured_again() -> None:
    view, history = view_by(LAMBERT, JIMENEZ), History()
    history.record(view, (2.0, 6.0), errors(0.4, 0.1))
    view = view_by(LAMBERT, make_method("screen+none", {"taps": 9}))
    history.record(view, (3.0, 5.0), errors(0.3, 0.2))
    assert history.points(view) == [
        MeasuredPoint("jimenez15", "jimenez15", 6.0, 0.1),
        MeasuredPoint("lambert", "lambert", 3.0, 0.3),
        MeasuredPoint("screen+none", "screen+none, taps 9", 5.0, 0.2),
    ]


def test_points_belong_to_one_view() -> None:
    view, history = view_by(LAMBERT, JIMENEZ), History()
    history.record(view, (2.0, 6.0), errors(0.4, None))
    for scene in (
        replace(SCENE, camera=manipulation.zoom(SCENE.camera, 2.0)),
        replace(SCENE, lights=SCENE.lights[:1] * 2),
        replace(SCENE, objects=tuple(replace(item) for item in SCENE.objects)),
    ):
        assert history.points(replace(view, scene=scene)) == []
    exposed = replace(view, scene=replace(SCENE, exposure=1.0))
    assert [point.label for point in history.points(exposed)] == ["lambert"], "errors are of M, before exposure"
    assert history.points(replace(view, size=(25, 16))) == []
    assert history.points(replace(view, time_s=1.0)) == []


def test_references_and_incomplete_measurements_leave_no_point() -> None:
    view, history = view_by(LAMBERT, REFERENCES["integral"]()), History()
    history.record(view, (2.0, 6.0), errors(None, 1e-9))
    history.record(view, (0.0, 6.0), errors(0.4, None))
    assert history.points(view) == []


def test_oldest_points_are_dropped() -> None:
    view, history = view_by(LAMBERT, LAMBERT), History()
    views = [replace(view, time_s=float(number)) for number in range(MAX_POINTS + 5)]
    for view in views:
        history.record(view, (2.0, 2.0), errors(0.4, 0.4))
    assert [len(history.points(view)) for view in views] == [0] * 5 + [1] * MAX_POINTS


def write_runs(folder: Path, scene: Scene, change: Callable[[dict[str, Any]], Any] = lambda run: None) -> list[Any]:
    """Write the runs of a benchmark into a folder, after a change to each."""
    runs = []
    for method, knobs, ms, error in (("lambert", {}, 10.0, 0.5), ("jimenez15", {"taps": 9}, 20.0, 0.1)):
        run: dict[str, Any] = {
            **{"scene": "slab", "digest": scene_digest(scene), "method": method, "knobs": knobs, "size": [64, 64]},
            **{"reference": "integral", "version": "1", "adapter": adapter(), "step": 0, "floor": 0.0},
            **{"frame_ms": ms, "frame_ms_quartiles": [ms, ms], "frames": 9, "passes": {}, "bytes": 7},
            **{"error": {"rel_rmse": error, "psnr": None, "flip": None, "bias": None}, "date": "2026-01-01"},
            **{"bake_ms": 1.0, "bake_cached": True, "clock": "sundial"},
        }
        change(run)
        runs.append(run)
    (folder / "bench").mkdir()
    (folder / "bench" / "runs.jsonl").write_text("".join(json.dumps(run) + "\n" for run in runs))
    return runs


def test_benchmark_runs_are_those_of_the_same_objects_and_lights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert History().bench_runs(SCENE, SCENE) == []
    runs, history = write_runs(tmp_path, SCENE), History()
    zoomed = replace(SCENE, camera=manipulation.zoom(SCENE.camera, 2.0))
    assert history.bench_runs(SCENE, zoomed) == runs, "a benchmark has its own camera"
    assert history.bench_runs(SCENE, replace(SCENE, lights=SCENE.lights[:1] * 2)) == []
    assert history.bench_runs(SCENE, SCENE) == runs
    assert history.bench_runs(SCENE, with_material(SCENE, "ketchup")) == []


@pytest.mark.parametrize("change", [{"digest": "other"}, {"adapter": "other"}, {"error": None}])
def test_runs_of_other_scenes_or_adapters_and_damaged_runs_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_runs(tmp_path, SCENE, lambda run: run.update(change))
    assert History().bench_runs(SCENE, SCENE) == []
