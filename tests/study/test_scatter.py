"""The scatter plot of frame time against error: its model, and the pictures and the page that show it."""

from __future__ import annotations

import copy
import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import browser
import numpy as np
import pytest
from conftest import ROOT
from PIL import Image

from wgsss.errors import InputError
from wgsss.registry import METHODS
from wgsss.study.chart import draw
from wgsss.study.run_record import Run
from wgsss.study.scatter import (
    Point,
    axis_limits,
    caption,
    is_free,
    labels,
    panels,
    pareto_front,
    setting_text,
    style,
    ticks,
)

PASSES = {"frame/gbuffer": 1.5, "lambert/reflect": 0.25}


def run_of(method: str, ms: float, error: float | None, step: int = 0, **more: Any) -> Any:
    run: dict[str, Any] = {"scene": "ear", "method": method, "knobs": {}, "step": step, "size": [64, 48]}
    run |= {"reference": "integral", "adapter": "llvmpipe", "clock": "sundial", "version": "0.1.0+abc1234"}
    run |= {"date": "2026-01-02T03:04:05+00:00", "bake_ms": 12.0, "bake_cached": True, "bytes": 3 << 20, "floor": 0.004}
    run |= {"frame_ms": ms, "frame_ms_quartiles": [0.9 * ms, 1.2 * ms], "frames": 9, "passes": PASSES}
    decibels = None if not error else 20.0 - 20.0 * math.log10(error)
    run["error"] = {"rel_rmse": error, "psnr": decibels, "flip": error, "bias": None if error is None else 1.0 - error}
    return {**run, **more}


def sweep(method: str, knob: str, points: dict[Any, tuple[float, float]], **more: Any) -> list[Run]:
    return [
        run_of(method, ms, error, step, knobs={knob: value, "other": 3}, **more)
        for step, (value, (ms, error)) in enumerate(points.items())
    ]


SWEEPS: list[Run] = [
    run_of("lambert", 5.0, 0.3),
    *sweep("deon07", "map_size", {256: (20.0, 0.12), 512: (45.0, 0.08), 1024: (140.0, 0.06)}),
    *sweep("jensen02", "epsilon", {1.0: (30.0, 0.05), 0.3: (90.0, 0.01)}),
]
BEST = {("lambert", 5.0), ("deon07", 20.0), ("jensen02", 30.0), ("jensen02", 90.0)}  # of SWEEPS, by inspection


# the model


def test_the_pareto_front_holds_the_points_that_no_other_point_beats() -> None:
    random = np.random.default_rng(3)
    for n in (0, 1, 2, 40):
        points = [(float(x), float(y)) for x, y in random.integers(0, 12, (n, 2))]  # with many ties

        def is_beaten(p: Any, points: Any = points) -> bool:
            return any(q[0] <= p[0] and q[1] <= p[1] and (q[0] < p[0] or q[1] < p[1]) for q in points)

        assert sorted(pareto_front(points)) == [i for i, p in enumerate(points) if not is_beaten(p)]
        assert [points[i] for i in pareto_front(points)] == sorted(points[i] for i in pareto_front(points))


def test_only_comparable_runs_share_a_panel() -> None:
    others = [
        run_of("lambert", 1.0, 0.1, **{key: value}) for key, value in (("scene", "milk"), ("reference", "volume"))
    ]
    others += [run_of("lambert", 1.0, 0.1, adapter="h100"), run_of("lambert", 1.0, 0.1, size=[8, 8])]
    found = panels([*SWEEPS, *others])
    assert [len(panel.runs) for panel in found] == [len(SWEEPS), 1, 1, 1, 1]
    assert len({panel.title for panel in found}) == 5
    assert found[2].title == "ear, 64 x 48, llvmpipe, against volume"
    assert [panel.title for panel in panels(SWEEPS)] == ["ear"]


def test_a_repeated_run_counts_once() -> None:
    again = run_of("lambert", 4.0, 0.2, version="0.2.0", date="2026-02-02T03:04:05+00:00")
    (panel,) = panels([*SWEEPS, again])
    assert len(panel.runs) == len(SWEEPS) and panel.runs[0] == again


def test_runs_are_ordered_by_sweep_and_not_by_file() -> None:
    (panel,) = panels(SWEEPS[::-1])
    assert [run["frame_ms"] for run in panel.runs if run["method"] == "deon07"] == [20.0, 45.0, 140.0]


def test_points_are_labelled_by_the_knobs_that_vary() -> None:
    assert labels(SWEEPS[1:4]) == ["map_size 256", "512", "1024"]
    assert labels(SWEEPS[:1]) == [""]
    both = [
        run_of("jensen02", 1.0, 0.1, knobs={"epsilon": e, "spacing": s, "k": 1}) for e, s in ((1.0, 4.0), (0.3, 2.0))
    ]
    assert labels(both) == ["epsilon 1, spacing 4", "0.3, 2"]


def test_points_of_a_panel_leave_out_runs_without_an_error_to_show() -> None:
    fit = run_of("sam", 2.0, 0.1, knobs={"samples": 4, "select": "fit"})
    (panel,) = panels([run_of("lambert", 1.0, None), run_of("deon07", 1.0, 0.0), fit])
    assert panel.points == (Point("sam", "", 2.0, 0.1, (1.8, 2.4), ("fit",)),) and panel.floor == 0.004


def test_a_setting_in_words() -> None:
    assert setting_text("lambert", {}) == "lambert"
    assert (
        setting_text("sam", {"share": 1 / 3, "samples": 4, "fine": True}) == "sam, share 0.3333, samples 4, fine True"
    )


def test_an_axis_shows_all_values_with_a_margin() -> None:
    assert axis_limits([1.0, 100.0]) == pytest.approx((10**-0.2, 10**2.2))
    assert axis_limits([3.0]) == pytest.approx((3 * 10**-0.05, 3 * 10**0.05))
    assert axis_limits([3.0], least_span=1.0) == pytest.approx((3 * 10**-0.5, 3 * 10**0.5))
    assert axis_limits([3.0], least_margin=0.2) == pytest.approx((3 * 10**-0.2, 3 * 10**0.2))


def test_a_label_is_inside_the_frame_and_covers_no_other_label() -> None:
    frame, taken = (0.0, 0.0, 10.0, 10.0), [(4.0, 4.0, 6.0, 6.0)]
    assert is_free((1.0, 1.0, 4.0, 4.0), frame, taken)
    assert not is_free((1.0, 1.0, 5.0, 5.0), frame, taken)
    assert not is_free((8.0, 1.0, 11.0, 2.0), frame, taken)


def test_each_method_of_the_project_has_its_own_fixed_style() -> None:
    names = [*METHODS, "jensen02", "sam", "jimenez15"]
    assert len({style(name) for name in names}) == len(set(names))
    assert style("lambert")[0] == "#000000" and style("deon07")[0] == "#0072B2"
    assert style("unknown method") == style("another unknown method")


def test_ticks_are_round_and_few() -> None:
    assert ticks(0.9, 1100.0) == [1, 10, 100, 1000] or ticks(0.9, 1100.0) == pytest.approx(
        [1, 3, 10, 30, 100, 300, 1000]
    )
    assert ticks(2.1, 8.9) == pytest.approx([3, 4, 5, 6, 7, 8])
    for low, high in ((1e-6, 1e4), (0.33, 0.41), (5.0, 6000.0)):
        assert 1 <= len(ticks(low, high)) <= 11 and all(low <= t <= high for t in ticks(low, high))


def test_the_caption_names_adapter_size_version_date_and_clock() -> None:
    text = caption(panels([*SWEEPS, run_of("lambert", 1.0, 0.1, scene="milk", date="2026-01-04T00:00:00+00:00")]))
    for part in ("llvmpipe", "64 x 48", "0.1.0+abc1234", "2026-01-02 to 2026-01-04", "sundial", "against integral"):
        assert part in text


# the pictures


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chart")
    assert [path.name for path in draw(SWEEPS, folder)] == ["chart.svg", "chart.png", "chart.html"]
    return folder


def pixels_near(path: Path, colour: str) -> int:
    """Return the number of pixels near a colour."""
    target = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    return int((np.abs(pixels.astype(int) - target).max(axis=1) < 6).sum())


def test_the_pictures_contain_the_colour_of_every_method(drawn: Path) -> None:
    svg = (drawn / "chart.svg").read_text()
    for method in {run["method"] for run in SWEEPS}:
        assert pixels_near(drawn / "chart.png", style(method)[0]) > 150
        assert style(method)[0].lower() in svg
    assert pixels_near(drawn / "chart.png", style("sam")[0]) == 0


def test_the_references_own_error_is_shaded(drawn: Path, tmp_path: Path) -> None:
    draw([{**run, "floor": 0.0} for run in SWEEPS], tmp_path)
    shade = "#EBEBEB"
    assert pixels_near(drawn / "chart.png", shade) > 10_000 > 2_000 > pixels_near(tmp_path / "chart.png", shade)


def test_the_same_runs_give_the_same_files(drawn: Path, tmp_path: Path) -> None:
    for path in draw(copy.deepcopy(SWEEPS), tmp_path):
        assert path.read_bytes() == (drawn / path.name).read_bytes()


@pytest.mark.parametrize(
    "runs",
    [
        [run_of("lambert", 5.0, 0.3)],
        [run_of("lambert", 5.0, 0.0)],
        [run_of("lambert", 5.0, None, floor=None)],
        [run_of("lambert", 5.0, 0.3), run_of("deon07", 5.0, 0.3)],
        [run_of(f"method {n}", 5.0 + n, 0.3 / (1 + n)) for n in range(12)],
        [run_of("lambert", 5.0, 0.3, scene=f"scene {n}") for n in range(4)],
    ],
    ids=["one", "no error", "unknown error", "equal", "many methods", "many scenes"],
)
def test_unusual_runs_are_drawn(runs: list[Run], tmp_path: Path) -> None:
    assert all(path.stat().st_size > 3_000 for path in draw(runs, tmp_path))


def test_missing_runs_and_a_missing_folder_are_errors(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no runs"):
        draw([], tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        draw(SWEEPS, tmp_path / "no")


def test_drawing_does_not_load_the_renderer(tmp_path: Path) -> None:
    (tmp_path / "runs.jsonl").write_text("".join(json.dumps(run | {"digest": ""}) + "\n" for run in SWEEPS))
    script = f"""
import sys
from wgsss.cli import main
assert main(["bench", "-o", {str(tmp_path)!r}]) == 0
print([name for name in ("wgpu", "wgsss.rendering", "wgsss.study.bench_run") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]" and (tmp_path / "chart.png").exists()


# the page


def test_the_page_needs_no_network(drawn: Path) -> None:
    page = (drawn / "chart.html").read_text()
    assert set(re.findall(r"https?://[^\"' ]+", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"(src|href)=(?!\"data:)|@import|url\(", page)


def test_text_in_runs_cannot_break_the_page(tmp_path: Path) -> None:
    draw([run_of("lambert", 5.0, 0.3, scene="</script><b>")], tmp_path)
    assert "</script><b>" not in (tmp_path / "chart.html").read_text()


@pytest.fixture(scope="module")
def tab(drawn: Path) -> Iterator[browser.Page]:
    if not browser.chromium():
        pytest.skip("no Chromium here")
    with browser.page() as page:
        page.open((drawn / "chart.html").as_uri())
        yield page
        assert page.said == []


CHOOSE = "(m => { m.value = '%s'; m.dispatchEvent(new Event('change')) })(document.getElementById('metric'))"
POINTS = "[...document.querySelectorAll('.run')]"


def test_the_page_shows_every_run_and_marks_the_best(tab: browser.Page) -> None:
    assert tab.run(f"{POINTS}.length") == len(SWEEPS)
    best = tab.run(f"{POINTS}.filter(m => m.classList.contains('best')).map(m => m.getAttribute('aria-label'))")
    assert {(re.split(r"\W", text)[0], float(re.search(r": ([\d.]+) ms", text)[1])) for text in best} == BEST
    assert "llvmpipe" in tab.run("document.getElementById('caption').textContent")


def test_the_page_computes_the_same_front_axes_and_ticks(tab: browser.Page) -> None:
    random = np.random.default_rng(4)
    points = [(float(x), float(y)) for x, y in random.integers(1, 12, (40, 2))]
    front = tab.run(f"paretoFront({json.dumps([{'x': x, 'y': y} for x, y in points])}).map(p => [p.x, p.y])")
    assert [tuple(p) for p in front] == [points[i] for i in pareto_front(points)]
    for values in ([3.0], [0.2, 0.3, 4.0], [1e-3, 70.0]):
        axis = tab.run(f"(s => [s.low, s.high, s.ticks])(scale({values}, 0, 1, true))")
        assert axis[:2] == pytest.approx(axis_limits(values)) and axis[2] == pytest.approx(ticks(*axis_limits(values)))


def test_faster_is_further_left_and_better_further_down(tab: browser.Page) -> None:
    places = tab.run(f"{POINTS}.map(m => (r => [r.x + r.width / 2, r.y + r.height / 2])(m.getBoundingClientRect()))")
    for axis, key in ((0, lambda run: run["frame_ms"]), (1, lambda run: -run["error"]["rel_rmse"])):
        assert (
            np.argsort([p[axis] for p in places]).tolist()
            == np.argsort([key(run) for run in panels(SWEEPS)[0].runs]).tolist()
        )


def test_the_pointer_over_a_point_shows_the_figures_of_the_run(tab: browser.Page) -> None:
    assert tab.run("document.getElementById('tip').hidden")
    box = f"{POINTS}.find(m => m.dataset.method === 'lambert').getBoundingClientRect()"
    x, y = tab.run(f"(r => [r.x + r.width / 2, r.y + r.height / 2])({box})")
    tab.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    text = tab.run("document.getElementById('tip').innerText")
    for part in ("lambert", "5 ms (4.5 to 6, 9 frames)", "frame/gbuffer", "1.5 ms", "3 MiB", "30 %", "0.4 %", "12 ms"):
        assert part in text
    assert not tab.run("document.getElementById('tip').hidden")
    tab.ask("Input.dispatchMouseEvent", type="mouseMoved", x=1, y=1)
    assert tab.run("document.getElementById('tip').hidden")


def test_methods_can_be_hidden(tab: browser.Page) -> None:
    box = "document.querySelector('#methods input[value=jensen02]')"
    tab.run(f"{box}.click()")
    assert tab.run(f"{POINTS}.map(m => m.dataset.method)") == ["lambert", "deon07", "deon07", "deon07"]
    assert tab.run("document.querySelectorAll('.best').length") == 4  # points that it beat are now best
    tab.run(f"{box}.click()")
    assert tab.run(f"{POINTS}.length") == len(SWEEPS)


def test_the_page_shows_why_flip_is_missing(tab: browser.Page, drawn: Path, tmp_path: Path) -> None:
    run = run_of("lambert", 5.0, 0.3)
    draw([{**run, "error": {**run["error"], "flip": None, "flip_reason": "it is not installed"}}], tmp_path)
    tab.open((tmp_path / "chart.html").as_uri())
    tab.run(CHOOSE % "flip")
    assert "it is not installed" in tab.run("document.getElementById('panels').textContent")
    tab.open((drawn / "chart.html").as_uri())


@pytest.mark.parametrize(("metric", "direction"), [("psnr", "up"), ("flip", "down"), ("bias", "down")])
def test_another_error_can_be_chosen(metric: str, direction: str, tab: browser.Page) -> None:
    tab.run(CHOOSE % metric)
    best = tab.run(f"{POINTS}.filter(m => m.classList.contains('best')).map(m => m.dataset.method)")
    assert sorted(best) == ["deon07", "jensen02", "jensen02", "lambert"]  # all errors of SWEEPS rank alike
    heights = tab.run(f"{POINTS}.map(m => m.getBoundingClientRect().y)")
    assert (heights[0] > heights[-1]) == (direction == "up")  # lambert is first, the best of jensen02 last
    tab.run(CHOOSE % "rel_rmse")
