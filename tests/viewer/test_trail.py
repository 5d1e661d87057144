"""What the chart of speed against accuracy is made of."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from wgsss.registry import REFERENCES, make_method
from wgsss.study.provenance import adapter, scene_digest
from wgsss.viewer import controls, marks
from wgsss.viewer.costs import milliseconds
from wgsss.viewer.state import Source, State
from wgsss.viewer.trail import LENGTH, Point, Trail, label_of

SIZE = 24, 16


def opened(*methods: Any) -> State:
    return State.open(Source("slab", vertices=300), methods)


def painter(*found: tuple[float, float | None]) -> Any:
    """With what the pictures of the sides cost, ms, and their errors, as if measured; they share the pass `all`."""
    times = {"all": 1.0} | {f"own {side}": ms - 1.0 for side, (ms, _) in enumerate(found)}
    sides = [SimpleNamespace(passes=("all", f"own {side}", "kept")) for side in range(len(found))]
    errors = [None if error is None else SimpleNamespace(rel_rmse=error) for _, error in found]
    drawing = SimpleNamespace(graph=SimpleNamespace(times=times))
    return SimpleNamespace(drawing=drawing, sides=sides, measured=SimpleNamespace(errors=errors))


def test_a_side_costs_its_own_passes_and_those_it_shares() -> None:
    painted = painter((5.0, None), (7.5, None))
    assert (milliseconds(painted, 0), milliseconds(painted, 1)) == (5.0, 7.5)
    painted.sides[0] = None
    assert milliseconds(painted, 0) == 0.0


def test_labels_name_the_knobs_that_were_set() -> None:
    assert label_of(make_method("jimenez15")) == "jimenez15"
    assert label_of(make_method("sam", {"samples": 8, "surface": "screen"})) == "sam, samples 8, surface screen"
    assert label_of(make_method("jensen02", {"epsilon": 0.25})) == "jensen02, epsilon 0.25"


def test_what_was_measured_stays_until_it_is_measured_anew() -> None:
    state, trail = opened(make_method("lambert"), make_method("jimenez15")), Trail()
    trail.follow(state, painter((2.0, 0.4), (6.0, 0.1)), SIZE)
    state.methods[1] = make_method("screen+none", {"taps": 9})
    trail.follow(state, painter((3.0, 0.3), (5.0, 0.2)), SIZE)
    assert trail.points(state, SIZE) == [
        Point("jimenez15", "jimenez15", 6.0, 0.1),
        Point("lambert", "lambert", 3.0, 0.3),
        Point("screen+none", "screen+none, taps 9", 5.0, 0.2),
    ]


def test_points_are_of_one_view() -> None:
    state, trail = opened(make_method("lambert"), make_method("jimenez15")), Trail()
    trail.follow(state, painter((2.0, 0.4), (6.0, None)), SIZE)
    seen = state.scene
    for other in (
        replace(seen, camera=controls.zoom(seen.camera, 2.0)),
        replace(seen, lights=seen.lights[:1] * 2),
        replace(seen, objects=tuple(replace(thing) for thing in seen.objects)),
    ):
        state.scene = other
        assert trail.points(state, SIZE) == []
    state.scene = replace(seen, exposure=1.0)
    assert [point.label for point in trail.points(state, SIZE)] == ["lambert"], "radiance is what is measured"
    assert trail.points(state, (25, 16)) == []
    state.time_s = 1.0
    assert trail.points(state, SIZE) == []


def test_references_and_what_is_not_known_leave_no_point() -> None:
    state, trail = opened(make_method("lambert"), REFERENCES["integral"]()), Trail()
    trail.follow(state, painter((2.0, None), (6.0, 1e-9)), SIZE)
    painted = painter((2.0, 0.4), (6.0, None))
    painted.drawing.graph.times.clear()  # not timed, since things move
    trail.follow(state, painted, SIZE)
    painted.measured = None
    trail.follow(state, painted, SIZE)
    assert trail.points(state, SIZE) == []


def test_another_scene_and_many_points_drop_the_first() -> None:
    state, trail = opened(make_method("lambert"), make_method("lambert")), Trail()
    for number in range(LENGTH + 5):
        state.time_s = float(number)
        trail.follow(state, painter((2.0, 0.4), (2.0, 0.4)), SIZE)
    kept = []
    for number in range(LENGTH + 5):
        state.time_s = float(number)
        kept.append(len(trail.points(state, SIZE)))
    assert kept == [0] * 5 + [1] * LENGTH
    trail.follow(opened(), painter(), SIZE)
    assert trail.points(state, SIZE) == []


def written(folder: Path, state: State, change: Callable[[dict[str, Any]], Any] = lambda run: None) -> list[Any]:
    """Runs of a bench in a folder."""
    runs = []
    for method, knobs, ms, error in (("lambert", {}, 10.0, 0.5), ("jimenez15", {"taps": 9}, 20.0, 0.1)):
        run: dict[str, Any] = {"scene": "slab", "digest": scene_digest(state.opened), "method": method, "knobs": knobs}
        run |= {"size": [64, 64], "reference": "integral", "version": "1", "adapter": adapter(), "step": 0}
        run |= {
            "frame_ms": ms,
            "frame_ms_quartiles": [ms, ms],
            "frames": 9,
            "passes": {},
            "bytes": 7,
            "clock": "sundial",
        }
        run |= {
            "error": {"rel_rmse": error, "psnr": None, "flip": None, "bias": None},
            "date": "2026-01-01",
            "floor": 0.0,
        }
        run |= {"bake_ms": 1.0, "bake_cached": True, "clock": "sundial"}
        change(run)
        runs.append(run)
    (folder / "bench").mkdir()
    (folder / "bench" / "runs.jsonl").write_text("".join(json.dumps(run) + "\n" for run in runs))
    return runs


def test_runs_of_a_bench_are_those_of_the_scene_as_it_is_lit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    state = opened()
    assert Trail().bench(state) == []
    runs = written(tmp_path, state)
    trail = Trail()
    state.scene = replace(state.scene, camera=controls.zoom(state.scene.camera, 2.0))
    assert trail.bench(state) == runs, "a bench has its own view"
    state.scene = replace(state.scene, lights=state.scene.lights[:1] * 2)
    assert trail.bench(state) == []
    state.reset()
    assert trail.bench(state) == runs
    state.wear("ketchup")
    assert trail.bench(state) == []


@pytest.mark.parametrize("change", [{"digest": "other"}, {"adapter": "other"}, {"error": None}])
def test_runs_of_other_scenes_and_adapters_and_damaged_ones_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any]
) -> None:
    monkeypatch.chdir(tmp_path)
    state = opened()
    written(tmp_path, state, lambda run: run.update(change))
    assert Trail().bench(state) == []


def test_marks_of_a_session_tell_the_sides_from_what_was_before() -> None:
    points = [Point("sam", "sam", 3.0, 0.2), Point("lambert", "lambert", 1.0, 0.5), Point("deon07", "deon07", 9.0, 0.1)]
    found = marks.session(points, [make_method("lambert"), make_method("jimenez15")])
    assert [(mark.label, mark.letter, mark.error) for mark in found] == [
        *(("sam", "", 20.0), ("deon07", "", 10.0), ("lambert", "L", 50.0)),
    ]
    first, last, side = found
    assert first.colour[3] == pytest.approx(marks.FAINTEST)
    assert first.colour[3] < last.colour[3] <= side.colour[3] == 1.0
    assert side.radius > last.radius
    assert marks.session(points, [make_method("lambert")] * 2)[-1].letter == "LR"


def test_marks_of_a_bench_name_each_method_once() -> None:
    knobs = [("sam", {"samples": 3}, 0.3), ("lambert", {}, 0.5), ("sam", {"samples": 8}, 0.2), ("black", {}, None)]
    runs = [{"method": m, "knobs": k, "frame_ms": 1.0, "error": {"rel_rmse": e}} for m, k, e in knobs]
    found = marks.bench(runs)
    assert {(mark.about, mark.label) for mark in found} == {
        *(("lambert", "lambert"), ("sam, samples 3", ""), ("sam, samples 8", "sam")),
    }


def test_limits_hold_all_values_and_half_a_decade() -> None:
    low, high = marks.limits([10.0])
    assert high / low == pytest.approx(10**0.5) and low * high == pytest.approx(100.0)
    low, high = marks.limits([1.0, 1000.0])
    assert low < 0.9 and high > 1100.0
