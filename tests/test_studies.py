"""The research scripts in studies/ run, on scenes that are small enough for a test."""

from __future__ import annotations

import json
import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image as Picture

STUDIES = ROOT / "studies"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., list[list[str]]]:
    """Return a function that runs a script in studies/ and splits each line of its output into words."""
    monkeypatch.syspath_prepend(str(STUDIES))

    def run(name: str, *args: str) -> list[list[str]]:
        runpy.run_path(str(STUDIES / f"{name}.py"))["main"](list(args))
        return [line.split() for line in capsys.readouterr().out.splitlines()]

    return run


TINY = ("--receivers", "8", "--vertices", "300")


def test_sam_convergence(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    chosen = ("--samples", "1", "100", "--select", "top", "-o", str(tmp_path / "a.png"))
    _, few, most = script("sam_convergence", "wave", *TINY, *chosen)
    assert few[:2] == ["top", "1"] and most[:2] == ["top", "100"]
    assert [float(error) for error in few[2:]] == pytest.approx([0.97, 0.97], abs=0.02)
    assert max(float(error) for error in most[2:]) < 0.1, "nearly all senders that there are"
    with Picture.open(tmp_path / "a.png") as picture:
        assert np.asarray(picture).std() > 10


def test_sam_tessellation(script: Callable[..., list[list[str]]]) -> None:
    _, row = script("sam_tessellation", "--scene", "wave", *TINY)
    assert abs(int(row[0]) - 300) < 100 and len(row) == 5
    assert float(row[3]) < 0.5 * float(row[1])


def test_sam_flicker(script: Callable[..., list[list[str]]]) -> None:
    rows = script("sam_flicker", "wave", *TINY, "--rate", "8")
    assert [row[0] for row in rows[1:]] == ["all", "top", "top", "top", "fit", "fit", "fit"]
    assert all(float(row[6]) < float(row[2]) for row in rows[2:]), "what is blended flickers less"


def test_sam_bake_times(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    chart = tmp_path / "a.png"
    size = ["--vertices", "300", "500", "--select", "top", "--materials"]
    rows = script("sam_bake_times", "--scene", "wave", *size, "-o", str(chart))
    assert [row[3] for row in rows[1:3]] == ["top", "top"]
    assert all(float(row[4]) > 0 and row[-1] == "48" for row in rows[1:3])
    with Picture.open(chart) as picture:
        assert np.asarray(picture).std() > 10


def test_light_types(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    def run(name: str, share: float) -> dict:
        return {"name": name, "error": {"rel_rmse": share, "floor": 0.01}}

    lights = {"sun": [run("a", 0.5), run("b", 0.25)], "sky": [run("a", 1.25), run("b", 0.125)]}
    found = {"scene": "ear", "reference": "integral", "methods": [run("a", 0.75), run("b", 0.0625)], "lights": lights}
    (tmp_path / "metrics.json").write_text(json.dumps(found))
    table = runpy.run_path(str(STUDIES / "light_types.py"))["read"](tmp_path)
    assert table[:3] == ("ear", ["a", "b", "(integral)"], ["own", "sun", "sky"])
    np.testing.assert_array_equal(table.errors, [[75, 50, 125], [6.25, 25, 12.5], [1, 1, 1]])

    script("light_types", str(tmp_path), "-o", str(tmp_path / "a.png"))
    with Picture.open(tmp_path / "a.png") as picture:
        assert np.asarray(picture).std() > 10
    del found["lights"]
    (tmp_path / "metrics.json").write_text(json.dumps(found))
    with pytest.raises(SystemExit, match="without --lights all"):
        script("light_types", str(tmp_path))


def test_screen_space_angles(script: Callable[..., list[list[str]]], tmp_path: Path) -> None:
    rows = script(
        "screen_space_angles", "--angles", "45", "--size", "96", "--rounds", "1", "-o", str(tmp_path / "a.png")
    )
    tables = [[float(cell.strip("()")) for cell in row] for row in rows if len(row) == 7 and row[0][0].isdigit()]
    # Line spread, as a kernel and as drawn, svd, radial: with all six Gaussians, and without the narrowest.
    assert [row[1] for row in tables] == pytest.approx([0.074, 0.034], abs=0.0015)
    assert all(row[2] == pytest.approx(row[1], abs=0.01) for row in tables)
    assert all(row[3] < 0.016 and row[4] < 0.02 and row[5] > 0.05 for row in tables)
    assert [row[0] for row in rows[-4:]] == ["9", "17", "33", "65"]
    with Picture.open(tmp_path / "a.png") as picture:
        assert np.asarray(picture).std() > 10
