"""Damaged and strange input gives one line, leaves no files, does not hang, and makes no pictures with NaN."""

from __future__ import annotations

import faulthandler
import json
import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from strange import KINDS

from wgsss.cli import main

SEED = 20
BOUND_S = 30.0
"""time limit for one input on a slow machine"""


@pytest.fixture(autouse=True)
def no_hang() -> Iterator[None]:
    """Print a traceback if Python itself hangs."""
    faulthandler.dump_traceback_later(5 * BOUND_S)
    yield
    faulthandler.cancel_dump_traceback_later()


def late(*_: object) -> None:
    raise TimeoutError(f"took more than {BOUND_S:g} s")


def faults(folder: Path, argv: list[str], files: dict[str, bytes], capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Run a command, and return a list of what it did wrong."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    before = {path for path in folder.rglob("*")}
    signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, BOUND_S)
    start = time.perf_counter()
    try:
        code = main(argv)
    except SystemExit as end:  # --help exits
        code = int(end.code or 0)
    except BaseException as error:
        return [f"{type(error).__name__}: {error}"]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    took = time.perf_counter() - start
    out, err = capsys.readouterr()
    problems = [] if code in (0, 2) else [f"exit code {code}: {err}"]
    problems += [
        f"unexpected: {line!r}" for line in err.splitlines() if not line.startswith("wgsss: ") and " by " not in line
    ]
    errors = [line for line in err.splitlines() if line.startswith("wgsss: error: ")]
    if len(errors) != (code != 0):
        problems.append(f"{len(errors)} lines of errors with exit code {code}: {err}")
    written = {path for path in folder.rglob("*") if path.is_file()} - before
    named = set()
    if code == 0 and out.startswith("{"):
        result = json.loads(out, parse_constant=lambda name: problems.append(f"{name} in JSON"))
        named = {(folder / file).resolve() for file in [*result.get("files", ()), result.get("graph_file", "out.npy")]}
    left = {path for path in written if path.resolve() not in named and path.name != "runs.jsonl"}
    if left and (code != 0 or out.startswith("{")):
        problems.append(f"left: {sorted(path.name for path in left)}")
    for path in written:
        if path.suffix == ".npy" and not np.isfinite(np.load(path)).all():
            problems.append(f"{path.name} is not finite")
    return [*problems, *([f"took {took:.1f} s"] if took > BOUND_S else [])]


@pytest.mark.parametrize("kind", KINDS)
def test_bad_input_gives_one_line_and_leaves_nothing(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make, count = KINDS[kind]
    bad = []
    for number in range(count):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.chdir(folder)
        argv, files = make(random.Random(f"{SEED} {kind} {number}"))
        bad += [f"{number}: {' '.join(argv)[:200]}: {fault}" for fault in faults(folder, argv, files, capsys)]
    assert not bad, "\n".join(bad)
