"""The benchmark: what a run records, and that a stopped benchmark continues where it was."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import OpenEXR
import pytest
from conftest import HAS_FLIP

from wgsss.errors import InputError, Note, RenderError
from wgsss.methods.lambert import Lambert
from wgsss.reference import Estimate, Reference
from wgsss.registry import METHODS, REFERENCES, make_method, sweep_of
from wgsss.rendering import Renderer
from wgsss.scene import EnvironmentLight, Scene, load_scene
from wgsss.stage import Stage
from wgsss.study import bench_run, provenance
from wgsss.study.bench import bench
from wgsss.study.bench_run import RunSpec, execute
from wgsss.study.provenance import scene_digest
from wgsss.study.run_log import FILE, read_runs
from wgsss.study.run_record import Run

SIZE = (24, 16)


@dataclass(frozen=True)
class Twice(Reference):
    """A reference: twice the M of Lambert, with an error of a tenth."""

    source: ClassVar[str] = "made up"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({},)
    estimated: ClassVar[list[str]] = []

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        self.estimated.append(stage.scene.name)
        M = Renderer(stage.rest, Lambert(), size).frame(aovs=["M_front"]).aovs["M_front"]
        return Estimate(2.0 * M, None, 0.2 * M)


@pytest.fixture(scope="module")
def ball() -> Scene:
    return load_scene("sphere", vertices=300)


@pytest.fixture(autouse=True)
def twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(REFERENCES, "twice", Twice)


def run_of(spec: RunSpec, **more: Any) -> Any:
    """Return a run with made-up figures."""
    costs = {"bake_ms": 1.0, "bake_cached": True, "frame_ms": 2.0, "frame_ms_quartiles": [1.5, 2.5], "frames": 9}
    error = {"rel_rmse": 0.1, "psnr": 30.0, "flip": 0.01, "bias": 1.0}
    where = {"adapter": "a", "clock": "sundial", "date": "2026-01-02T03:04:05+00:00", "passes": {"p": 2.0}, "bytes": 7}
    return {**spec.json(), **costs, **where, "error": error, "floor": 0.01, **more}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[RunSpec]:
    """Replace runs by made-up ones that take no time. Returns the list of specs that were run."""
    done: list[RunSpec] = []

    def fake(scene: Scene, spec: RunSpec) -> Run:
        done.append(spec)
        return run_of(spec)

    monkeypatch.setattr(bench_run, "execute", fake)
    monkeypatch.setattr(provenance, "adapter", lambda: "a")
    return done


def go(scene: Scene, folder: Path, *, methods: Any = None, size: tuple[int, int] = SIZE, **rest: Any) -> Any:
    return bench([scene], methods, folder, size, reference="twice", **rest)


def settings(runs: list[Run]) -> list[tuple[str, Any]]:
    return [(run["method"], run["knobs"].get("map_size")) for run in runs]


# what a run records


@pytest.fixture(scope="module")
def lambert(ball: Scene) -> Run:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(REFERENCES, "twice", Twice)
        patch.setattr(bench_run, "FRAMES_S", 0.05)
        return execute(ball, RunSpec("sphere", scene_digest(ball), "lambert", {}, 0, SIZE, "twice"))


def test_a_run_has_the_errors_against_the_reference(lambert: Run) -> None:
    assert lambert["error"]["rel_rmse"] == pytest.approx(0.5, rel=1e-5)
    assert lambert["error"]["bias"] == pytest.approx(0.5, rel=1e-5)
    assert lambert["floor"] == pytest.approx(0.1, rel=1e-5)
    if HAS_FLIP:
        assert 0.01 < lambert["error"]["flip"] < 1.0
    else:
        assert lambert["error"]["flip"] is None and "not installed" in lambert["error"]["flip_reason"]


def test_the_frame_time_is_the_sum_of_the_passes(lambert: Run) -> None:
    low, high = lambert["frame_ms_quartiles"]
    assert 0.0 < low <= lambert["frame_ms"] <= high and lambert["frames"] >= 5
    assert low <= sum(lambert["passes"].values()) <= high
    assert any("lambert/reflect" in name for name in lambert["passes"]) and lambert["bake_ms"] >= 0.0


def test_the_memory_includes_pixels_and_vertices(lambert: Run, ball: Scene) -> None:
    M, irradiance, radiance = (16 * SIZE[0] * SIZE[1] for _ in range(3))
    assert lambert["bytes"] > M + irradiance + radiance + 12 * len(ball.objects[0].mesh.positions)
    assert lambert["bytes"] < 64 << 20


def test_a_run_is_json_that_identifies_its_setting(lambert: Run, gpu: Any) -> None:
    assert json.loads(json.dumps(lambert, allow_nan=False)) == lambert
    asked = {"scene": "sphere", "method": "lambert", "knobs": {}, "size": list(SIZE), "reference": "twice"}
    assert lambert.items() >= asked.items() and lambert["adapter"] == gpu.name
    assert lambert["version"].startswith("0.") and lambert["date"][:2] == "20"


def test_a_run_records_whether_the_cache_held_the_baked_data(
    ball: Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path))
    monkeypatch.setattr(bench_run, "FRAMES_S", 0.0)
    monkeypatch.setattr(bench_run, "FEWEST", 2)
    spec = RunSpec("sphere", scene_digest(ball), "deon07", {"map_size": 64, "gaussians": 2}, 0, SIZE, "twice")
    cold, warm = execute(ball, spec), execute(ball, spec)
    assert (cold["bake_cached"], warm["bake_cached"]) == (False, True)
    assert cold["bake_ms"] > warm["bake_ms"]


def test_the_reference_is_computed_once_per_scene(ball: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_run, "FRAMES_S", 0.0)
    monkeypatch.setattr(bench_run, "_last_truth", {})
    monkeypatch.setattr(Twice, "passes", lambda self, frame: Lambert().passes(frame))
    monkeypatch.setattr(Lambert, "sweep", ({}, {}, {}))
    Twice.estimated.clear()
    other = replace(ball, name="other", exposure=1.0)
    bench([ball, other], ["lambert"], tmp_path, SIZE, reference="twice")
    assert Twice.estimated == ["sphere", "other"] and len(bench_run._last_truth) == 1  # the last scene only is kept


def test_an_error_names_the_run(ball: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise RenderError("no light")

    monkeypatch.setattr(Lambert, "passes", fail)
    with pytest.raises(RenderError, match=r"^sphere by lambert: no light"):
        execute(ball, RunSpec("sphere", scene_digest(ball), "lambert", {}, 0, SIZE, "twice"))


def test_a_digest_depends_on_every_part_of_a_scene(ball: Scene, tmp_path: Path) -> None:
    thing = ball.objects[0]
    moved = thing.mesh.positions.copy()
    moved[7, 1] += 1e-3
    others = [
        replace(ball, exposure=0.25),
        replace(ball, lights=(replace(ball.lights[0], irradiance=(1.0, 2.0, 3.5)),)),
        replace(ball, camera=replace(ball.camera, eye=(1.0, 2.0, 3.0))),
        replace(ball, objects=(replace(thing, material=replace(thing.material, roughness=0.3)),)),
        replace(ball, objects=(replace(thing, mesh=replace(thing.mesh, positions=moved)),)),
        replace(ball, objects=(thing, thing)),
    ]
    assert scene_digest(ball) == scene_digest(load_scene("sphere", vertices=300))
    assert len({scene_digest(scene) for scene in (ball, *others)}) == 1 + len(others)
    image = tmp_path / "sky.exr"
    skies = []
    for value in (0.5, 0.6):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": np.full((2, 4, 3), value, np.float32)}) as exr:
            exr.write(str(image))
        skies.append(scene_digest(replace(ball, lights=(EnvironmentLight(file=str(image)),))))
    assert skies[0] != skies[1]


# sweeps, complete and interrupted


def test_every_setting_of_every_method_is_run_once(ball: Scene, tmp_path: Path, measured: list[RunSpec]) -> None:
    runs = go(ball, tmp_path)
    counts = {name: len(sweep_of(name)) for name in METHODS}
    assert {name: sum(run["method"] == name for run in runs) for name in counts} == counts
    assert read_runs(tmp_path) == runs and len(measured) == len(runs)
    for run in runs:
        knobs = {knob: value for knob, value in run["knobs"].items() if knob != "surface"}
        assert vars(make_method(run["method"], run["knobs"])) == knobs


def test_recorded_runs_are_not_repeated(ball: Scene, tmp_path: Path, measured: list[RunSpec]) -> None:
    first = go(ball, tmp_path, methods=["deon07"])
    assert go(ball, tmp_path, methods=["deon07"]) == first and len(measured) == len(first)
    both = go(ball, tmp_path, methods=["lambert", "deon07"])
    assert len(measured) == len(first) + 1
    assert settings(both) == [("lambert", None), *settings(first)]
    assert settings(read_runs(tmp_path)) == [*settings(first), ("lambert", None)]


@pytest.mark.parametrize("changed", ["size", "scene", "reference", "adapter", "version", "knobs"])
def test_runs_that_differ_are_done(
    changed: str, ball: Scene, tmp_path: Path, measured: list[RunSpec], monkeypatch: pytest.MonkeyPatch
) -> None:
    go(ball, tmp_path, methods=["lambert"])
    scene, size, reference = ball, SIZE, "twice"
    if changed == "size":
        size = (16, 24)
    elif changed == "scene":
        scene = replace(ball, exposure=2.0)
    elif changed == "reference":
        monkeypatch.setitem(REFERENCES, "thrice", Twice)
        reference = "thrice"
    elif changed == "adapter":
        monkeypatch.setattr(provenance, "adapter", lambda: "b")
    elif changed == "version":
        monkeypatch.setattr(bench_run, "version", lambda: "9")
    else:
        path = tmp_path / FILE
        path.write_text(path.read_text().replace('"knobs": {}', '"knobs": {"k": 1}'))
    bench([scene], ["lambert"], tmp_path, size, reference=reference)
    assert len(measured) == 2 and len(read_runs(tmp_path)) == 2


def interrupt_after(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    fake: Callable[..., Any] = bench_run.execute
    left = iter(range(count))

    def interrupted(scene: Scene, spec: RunSpec) -> Run:
        if next(left, None) is None:
            raise KeyboardInterrupt
        return fake(scene, spec)

    monkeypatch.setattr(bench_run, "execute", interrupted)


def test_an_interrupt_loses_at_most_the_run_in_progress(
    ball: Scene, tmp_path: Path, measured: list[RunSpec], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        interrupt_after(3, patch)
        with pytest.raises(KeyboardInterrupt):
            go(ball, tmp_path, methods=["deon07"])
    assert settings(read_runs(tmp_path)) == [("deon07", n) for n in (256, 512, 1024)]
    runs = go(ball, tmp_path, methods=["deon07"])
    assert settings(runs) == settings(read_runs(tmp_path)) == [("deon07", n) for n in (256, 512, 1024, 2048)]
    assert len(measured) == 4


def test_a_run_whose_line_was_cut_off_is_repeated(ball: Scene, tmp_path: Path, measured: list[RunSpec]) -> None:
    go(ball, tmp_path, methods=["deon07"])
    path = tmp_path / FILE
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.warns(Note, match="line 4 is not a run"):
        assert settings(read_runs(tmp_path)) == [("deon07", n) for n in (256, 512, 1024)]
        go(ball, tmp_path, methods=["deon07"])
        assert settings(read_runs(tmp_path)) == [("deon07", n) for n in (256, 512, 1024, 2048)] and len(measured) == 5


def test_each_run_is_recorded_before_it_is_reported(ball: Scene, tmp_path: Path, measured: list[RunSpec]) -> None:
    reported = []
    go(ball, tmp_path, methods=["deon07"], on_run=lambda run: reported.append((run, read_runs(tmp_path)[-1])))
    assert len(reported) == 4 and all(run == recorded for run, recorded in reported)


def test_a_benchmark_that_fails_at_once_leaves_no_files(
    ball: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise RenderError("no adapter")

    with pytest.raises(InputError, match="unknown method 'lambrt'; did you mean 'lambert'"):
        bench([ball], ["lambrt"], tmp_path / "a", SIZE, reference="twice")
    with pytest.raises(InputError, match="unknown reference 'lambert'"):
        bench([ball], None, tmp_path / "a", SIZE, reference="lambert")
    with pytest.raises(RenderError, match="no adapter"):
        monkeypatch.setattr(provenance, "adapter", lambda: "a")
        monkeypatch.setattr(bench_run, "execute", fail)
        go(ball, tmp_path / "a")
    assert not (tmp_path / "a").exists()
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: this is not a folder"):
        go(ball, tmp_path / "file")


# on a cluster


def test_a_cluster_needs_dask(ball: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(InputError, match=r"wgsss\[cluster\]"):
        go(ball, tmp_path, scheduler="tcp://127.0.0.1:1")


def test_a_cluster_does_the_runs(ball: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask's distributed is not installed")
    monkeypatch.setattr(bench_run, "FRAMES_S", 0.0)
    monkeypatch.setattr(bench_run, "FEWEST", 2)
    monkeypatch.setattr(METHODS["deon07"], "sweep", ({"map_size": 64}, {"map_size": 128}))
    options: dict[str, Any] = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options, protocol="tcp://") as cluster:
        runs = go(ball, tmp_path, methods=["deon07", "lambert"], scheduler=cluster.scheduler_address)
    assert settings(runs) == [("deon07", 64), ("deon07", 128), ("lambert", None)]
    assert sorted(map(str, read_runs(tmp_path))) == sorted(map(str, runs))
    assert np.isclose(runs[-1]["error"]["rel_rmse"], 0.5)
    go(ball, tmp_path, methods=["lambert"])
    assert len(read_runs(tmp_path)) == 3
