"""The file of runs: a damaged line loses one run only, and processes that append do not damage each other's lines."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT

from wgsss.errors import InputError, Note
from wgsss.study.chart import draw
from wgsss.study.run_log import FILE, open_log, read_runs

RUN: dict[str, Any] = {
    "scene": "ball",
    "digest": "d",
    "method": "sam",
    "knobs": {"samples": 3, "select": "fit", "fine": True, "share": 0.5},
    "step": 0,
    "size": [24, 16],
    "reference": "integral",
    "version": "1",
    "adapter": "a",
    "clock": "sundial",
    "date": "2026-01-02T03:04:05+00:00",
    "bake_ms": 1.0,
    "bake_cached": True,
    "frame_ms": 2.0,
    "frame_ms_quartiles": [1.5, 2.5],
    "frames": 9,
    "passes": {"p": 2.0},
    "bytes": 7,
    "error": {"rel_rmse": 0.1, "psnr": 30.0, "flip": None, "bias": 1.0},
    "floor": 0.01,
}
STRANGE: tuple[Any, ...] = (
    *(None, True, -1, 1.5, "", "x" * 2000, [], [1], [1, "2"], [1, 2, 3], {}, {"a": None}, {"a": [1]}, 10**400),
    *(float("nan"), float("inf"), 1e300, [0, 0], [1e300, 1], {"a": 1e300}, {"a": float("nan")}),
)


def line(**changed: Any) -> bytes:
    return json.dumps({**RUN, **changed}).encode()


@pytest.fixture(autouse=True)
def long_numbers() -> Any:
    """Let json.dumps write numbers of any length, which Python refuses by default."""
    before = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(0)
    yield
    sys.set_int_max_str_digits(before)


@pytest.mark.parametrize("key", RUN)
def test_a_line_with_a_strange_value_is_skipped_or_drawn(key: str, tmp_path: Path) -> None:
    sys.set_int_max_str_digits(4300)
    for value in STRANGE:
        (tmp_path / FILE).write_bytes(line() + b"\n" + line(**{key: value}) + b"\n")
        try:
            with pytest.warns(
                Note, match=rf"line 2 is not a run \((key '{key}[.\w]*' must be |.*not finite|key .* missing)"
            ):
                runs = read_runs(tmp_path)
            assert runs == [RUN]
        except pytest.fail.Exception:
            assert len(read_runs(tmp_path)) == 2


@pytest.mark.parametrize("key", [*RUN, *(f"error.{name}" for name in RUN["error"])])
def test_a_missing_key_is_named(key: str, tmp_path: Path) -> None:
    run = json.loads(line())
    outer, _, inner = key.partition(".")
    if inner:
        del run[outer][inner]
    else:
        del run[outer]
    (tmp_path / FILE).write_text(json.dumps(run) + "\n")
    with pytest.raises(InputError, match=rf"runs.jsonl: line 1 is not a run \(key '{key}' is missing\)"):
        read_runs(tmp_path)


BAD: dict[str, bytes] = {
    "text": b"nonsense",
    "cut off": line()[:-9],
    "null": b"null",
    "a list": b"[]",
    "nested": b"[" * 100_000 + b"]" * 100_000,
    "bytes": b'{"scene": "\xff\xfe"}',
    "NUL": b"\0" * 40,
    "UTF-16": line().decode().encode("utf-16"),
    "two on a line": line() + line(),
}


@pytest.mark.parametrize("bad", BAD)
def test_a_damaged_line_is_skipped_with_a_warning(bad: str, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(line() + b"\n" + BAD[bad] + b"\n" + line(scene="other"))
    with pytest.warns(Note, match=r"line 2 is not a run") as caught:
        assert [run["scene"] for run in read_runs(tmp_path)] == ["ball", "other"]
    assert len(caught) == 1 and len(str(caught[0].message)) < 300


def test_many_damaged_lines_give_one_warning(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"x\n" * 100 + line() + b"\n")
    with pytest.warns(Note, match=r"100 of 101 lines skipped: line 1 is .*line 3 is .* and 97 more$") as caught:
        assert len(read_runs(tmp_path)) == 1
    assert len(caught) == 1


def test_marks_and_blank_lines_of_editors_are_accepted(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    (tmp_path / FILE).write_bytes(b"\xef\xbb\xbf" + line() + b"\r\n\r\n \n" + line(extra=[1, {"a": None}]))
    assert read_runs(tmp_path) == [RUN, RUN] and not recwarn.list


@pytest.mark.parametrize("content", [b"", b"\n\n", b"x\n"])
def test_a_file_without_runs_is_an_error(content: bytes, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(InputError, match=r"runs.jsonl: (there are no runs in it|line 1 is not a run)"):
        read_runs(tmp_path)


@pytest.mark.parametrize("make", [os.mkdir, os.mkfifo, lambda path: os.symlink("/dev/zero", path)])
def test_a_path_that_is_not_a_regular_file_is_refused(make: Callable[[Path], None], tmp_path: Path) -> None:
    make(tmp_path / FILE)
    with pytest.raises(InputError, match=r"runs.jsonl: this is (a folder|not a regular file)"):
        read_runs(tmp_path)
    with pytest.raises(InputError, match=r"runs.jsonl: this is (a folder|not a regular file)"), open_log(tmp_path):
        pass


def test_runs_of_extreme_values_are_drawn(tmp_path: Path) -> None:
    extremes = [1e-9, 1e12]
    text = "$\\frac{ _^ <!--<script></script>]]>&\u2028\x1b\u202e\ud800\n"
    with (tmp_path / FILE).open("wb") as file:
        for i, value in enumerate((*extremes, 0)):
            time = max(value, 1e-9)
            error = {"rel_rmse": value, "psnr": -value, "flip": value, "bias": -value}
            changed = {"frame_ms": time, "frame_ms_quartiles": [time, time], "error": error, "floor": value}
            names = {name: text for name in ("scene", "method", "adapter", "clock", "reference", "version", "date")}
            file.write(line(step=i, knobs={text: text + str(i)}, **changed, **names) + b"\n")
    assert all(path.stat().st_size > 0 for path in draw(read_runs(tmp_path), tmp_path))


# writing


def test_a_folder_is_created_for_runs_and_removed_if_it_stays_empty(tmp_path: Path) -> None:
    with open_log(tmp_path / "a" / "b") as (runs, append):
        assert runs == []
    assert not list(tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt), open_log(tmp_path / "a" / "b"):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
    with open_log(tmp_path / "a" / "b") as (runs, append):
        append(RUN)
    assert read_runs(tmp_path / "a" / "b") == [RUN]


def test_a_cut_off_line_does_not_damage_the_next_one(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(line() + b"\n" + line()[:50])
    with pytest.warns(Note, match="line 2"), open_log(tmp_path) as (_, append):
        append(RUN)
    with pytest.warns(Note, match="line 2"):
        assert read_runs(tmp_path) == [RUN, RUN]


def test_a_last_line_without_a_line_break_is_kept(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(line())
    with open_log(tmp_path) as (runs, append):
        assert runs == [RUN]
        append(RUN)
    assert read_runs(tmp_path) == [RUN, RUN]


def test_a_short_write_is_completed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_log(tmp_path) as (_, append):
        monkeypatch.setattr(Path, "open", _slow_open)
        append(RUN)
        append(RUN)
    monkeypatch.undo()
    assert read_runs(tmp_path) == [RUN, RUN]


def test_a_full_disk_leaves_no_partial_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_log(tmp_path) as (_, append):
        append(RUN)
        monkeypatch.setattr(Path, "open", lambda path, *args, **rest: _slow_open(path, *args, **rest, room=50))
        with pytest.raises(InputError, match=r"runs.jsonl: cannot be written \(No space left"):
            append(RUN)
    monkeypatch.undo()
    assert (tmp_path / FILE).read_bytes() == line() + b"\n"


_open = Path.open


def _slow_open(path: Path, *args: Any, room: int = 1 << 30, **rest: Any) -> Any:
    """Open a file that accepts 7 bytes per write, until `room` bytes are written."""
    if "a" not in args[0]:
        return _open(path, *args, **rest)

    class Slow:
        def __init__(self) -> None:
            self.file, self.left = _open(path, *args, **rest), room

        def write(self, data: bytes) -> int:
            if self.left <= 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self.left -= 7
            return int(self.file.write(data[:7]))

        def __enter__(self) -> Slow:
            return self

        def __exit__(self, *_: object) -> None:
            self.file.close()

        def __getattr__(self, name: str) -> Any:
            return getattr(self.file, name)

    return Slow()


APPENDER = """
import sys
from pathlib import Path
from wgsss.study.run_log import open_log
sys.path.insert(0, {tests!r})
from test_run_log import RUN
name = sys.argv[1]
with open_log(Path({folder!r})) as (_, append):
    for step in range(300):
        append({{**RUN, "scene": name, "step": step}})
"""


def test_processes_that_append_at_the_same_time_lose_no_line(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    script = APPENDER.format(tests=str(Path(__file__).parent), folder=str(tmp_path / "runs"))
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    command = [sys.executable, "-c", script]
    names = ["a", "b" * 900]
    running = [subprocess.Popen([*command, name], env={**os.environ, "PYTHONPATH": path}) for name in names]
    assert [process.wait(timeout=60) for process in running] == [0, 0]
    runs = read_runs(tmp_path / "runs")
    assert {name: [run["step"] for run in runs if run["scene"] == name] for name in names} == {
        name: list(range(300)) for name in names
    }
    assert not recwarn.list
