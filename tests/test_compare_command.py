"""`wgsss compare`: text, JSON and files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from standins import Scaled

from wgsss.cli import main
from wgsss.registry import REFERENCES
from wgsss.study import compare


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setitem(REFERENCES, "integral", Scaled)
    monkeypatch.setattr(compare, "WARM_FRAMES", 1)


def run(capsys: pytest.CaptureFixture[str], *argv: str, code: int = 0) -> tuple[str, str]:
    assert main(["compare", *argv]) == code
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return out, err


SMALL = ("sphere", "--vertices", "600", "--size", "32x32", "--methods", "lambert")


def test_compare_prints_text_and_writes_files(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out, err = run(capsys, *SMALL)
    lines = out.splitlines()
    assert lines[0].split()[:3] == ["method", "rel", "RMSE"] and lines[1].split()[:3] == ["lambert", "20", "%"]
    assert "error of integral itself: 1.6 %" in lines and lines[-1] == "sphere-compare/report.html"
    assert "by type of light" not in out and "by cause" not in out and err == ""
    assert (tmp_path / "sphere-compare" / "report.html").stat().st_size > 20_000
    numbers = json.loads((tmp_path / "sphere-compare" / "metrics.json").read_text())
    assert numbers["methods"][0]["error"]["rel_rmse"] == pytest.approx(0.2, rel=1e-4)


def test_json_has_errors_of_all_methods(tmp_path: Path, capsys):
    out, _ = run(capsys, *SMALL, "-o", str(tmp_path / "here"), "--json")
    result = json.loads(out)
    assert result.keys() == {"scene", "reference", "adapter", "size", "methods", "files", "warnings"}
    assert result["scene"] == "sphere" and result["size"] == [32, 32]
    assert all(Path(file).is_file() and Path(file).parent == tmp_path / "here" for file in result["files"])


def test_knobs_of_methods_are_set(tmp_path: Path, capsys):
    methods = "deon07:map_size=64:gaussians=2, deon07:map_size=128,lambert"
    out, _ = run(capsys, *SMALL[:-1], methods, "-o", str(tmp_path / "here"), "--json")
    runs = [(run["method"], run["knobs"]) for run in json.loads(out)["methods"]]
    assert runs[:2] == [("deon07", {"map_size": 64, "gaussians": 2}), ("deon07", {"map_size": 128, "gaussians": 6})]
    assert len(runs) == 3


def test_lights_of_all_types_are_compared(tmp_path: Path, capsys):
    argv = [*SMALL, "--lights", "all", "-o", str(tmp_path / "here")]
    rows = run(capsys, *argv)[0].split("by type of light: rel RMSE\n")[1].splitlines()
    assert rows[0].split() == ["method", "directional", "point", "area", "environment"]
    assert rows[1].split() == ["lambert", *["20", "%"] * 4] and rows[2].split() == ["(integral)", *["1.6", "%"] * 4]
    numbers = json.loads((tmp_path / "here" / "metrics.json").read_text())
    assert list(numbers["lights"]) == ["directional", "point", "area", "environment"]
    assert numbers["lights"]["area"][0]["method"] == "lambert"


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["spher"], "unknown scene 'spher'"),
        (["sphere", "--methods", "lambert,deon7"], "unknown method 'deon7'; did you mean 'deon07'"),
        (["sphere", "--methods", "lambert,,deon07"], "'lambert,,deon07' is not a list of names"),
        (["sphere", "--reference", "lambert"], "unknown reference 'lambert'"),
        (["sphere", "--size", "0x9", "--methods", "lambert"], "must be 1 to"),
        (["sphere", "--lights", "some"], "invalid choice: 'some'"),
        (["sphere", "-o", "/no/folder"], "/no/folder: there is no folder '/no'"),
        (["sphere", "-o", "/dev/null"], "/dev/null: this is not a folder"),
        (["sphere", "--light", "all"], "argument --light: 'all' is not a table"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(argv, says, tmp_path: Path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out, err = run(capsys, *argv, code=2)
    assert out == "" and err.count("\n") == 1 and says in err, err
    assert not list(tmp_path.iterdir())
