"""Output of commands in any encoding, to closed streams, full devices and closed pipes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

COMMAND = [sys.executable, "-m", "wgsss"]
NAME = "bär… 雪 \U0001f600 <$x$>"
SCENE = f'name = "{NAME}"\n[[object]]\nshape = "sphere"\nvertices = 100\nmaterial = "marble"\n'
RENDER = ["render", "s.toml", "--method", "lambert", "--size", "8x8", "-o", "a.png"]
full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")


@pytest.fixture(autouse=True)
def scene(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENE, encoding="utf-8")


def run(folder: Path, *argv: str | bytes, shell: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run a command in a folder, with redirections in shell syntax."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    command = ["sh", "-c", f'exec "$@" {shell}', "sh", *COMMAND, *argv]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, timeout=60)


@pytest.mark.parametrize("encoding", ["ascii:strict", "latin-1", "utf-16"])
def test_names_in_any_alphabet_are_printed_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    environment = {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    text, as_json = run(tmp_path, *RENDER, **environment), run(tmp_path, *RENDER, "--json", **environment)
    codec = encoding.partition(":")[0]
    assert (text.returncode, text.stderr, as_json.returncode, as_json.stderr) == (0, b"", 0, b"")
    shown = text.stdout.decode(codec)
    assert (NAME in shown) == codec.startswith("utf") and "<$x$>" in shown
    assert json.loads(as_json.stdout.decode(codec))["scene"] == NAME


def test_the_c_locale_prints_names_and_errors(tmp_path: Path) -> None:
    environment = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    assert run(tmp_path, *RENDER, **environment).returncode == 0
    failed = run(tmp_path, "render", "s.toml", "--method", "bär…", **environment)
    assert failed.returncode == 2 and failed.stderr.startswith(b"wgsss: error: unknown method 'b")


def test_a_file_name_that_is_not_text_is_printed(tmp_path: Path) -> None:
    done = run(tmp_path, *RENDER[:-1], b"\xff\xfe.png", "--json")
    assert done.returncode == 0
    assert os.fsencode(json.loads(done.stdout)["files"][0]) == b"\xff\xfe.png"
    failed = run(tmp_path, "render", b"\xff.toml")
    assert failed.returncode == 2 and failed.stderr.startswith(rb"wgsss: error: \udcff.toml: no such file")


def test_control_characters_are_escaped(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENE.replace(NAME, r"a\u001b[31m\nb\u202ec"))
    done = run(tmp_path, *RENDER)
    assert done.returncode == 0 and done.stdout.count(b"\n") == 1
    assert rb"a\x1b[31m b\u202ec" in done.stdout or rb"a\x1b[31m\nb\u202ec" in done.stdout
    failed = run(tmp_path, "render", "no\n\x1b\x07where.toml")
    assert failed.returncode == 2 and failed.stderr == b"wgsss: error: no \\x1b\\x07where.toml: no such file\n"


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize("argv", [RENDER, ["--help"], ["render", "nowhere"]])
def test_commands_work_with_closed_streams(tmp_path: Path, closed: str, argv: list[str]) -> None:
    done = run(tmp_path, *argv, shell=closed)
    assert done.returncode == (2 if argv[-1] == "nowhere" else 0)
    assert done.stderr.count(b"\n") == (argv[-1] == "nowhere" and "2>&-" not in closed)
    if argv is RENDER:
        assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@full
@pytest.mark.parametrize("argv", [["methods"], ["render", "--help"], ["--version"]])
def test_a_full_device_is_an_error_of_one_line(tmp_path: Path, argv: list[str]) -> None:
    done = run(tmp_path, *argv, shell=">/dev/full")
    assert done.returncode == 2
    assert (
        done.stderr.startswith(b"wgsss: error: standard output cannot be written (No space")
        and done.stderr.count(b"\n") == 1
    )


@full
def test_the_exit_code_is_kept_if_errors_cannot_be_written(tmp_path: Path) -> None:
    assert run(tmp_path, "render", "nowhere", shell="2>/dev/full").returncode == 2
    assert run(tmp_path, "methods", shell=">/dev/full 2>/dev/full").returncode == 2
    assert run(tmp_path, *RENDER, shell="2>/dev/full").returncode == 0


@pytest.mark.parametrize("argv", [["--help"], ["materials", "--json"]])
def test_a_closed_pipe_ends_the_command_quietly(tmp_path: Path, argv: list[str]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([*COMMAND, *argv], cwd=tmp_path, env=env, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


def test_commands_finish_if_the_terminal_is_closed(tmp_path: Path) -> None:
    """Progress is shown on terminals only. Writing to a closed terminal fails."""
    pty = pytest.importorskip("pty")
    master, slave = pty.openpty()
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    argv = [*COMMAND, *RENDER, "--frames", "30"]
    running = subprocess.Popen(
        argv, cwd=tmp_path, env=env, stdout=subprocess.PIPE, stderr=slave, stdin=subprocess.DEVNULL
    )
    os.close(slave)
    assert os.read(master, 1)  # progress is shown
    os.close(master)
    assert running.wait(timeout=60) == 0
    assert len(list(tmp_path.glob("*.png"))) == 30
