"""Signals end a command quietly, with the usual exit code, and leave no files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ROOT

SPHERE = ["sphere", "--vertices", "300"]
ENDING = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


def start(folder: Path, *argv: str, code: str = "", cache: str = "cache") -> subprocess.Popen[str]:
    """Start the command in a folder, after some code."""
    script = f"{code}\nfrom wgsss.cli import main\nraise SystemExit(main())"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "WGSSS_CACHE": str(folder / cache)}
    command = [sys.executable, "-c", script, *argv]
    return subprocess.Popen(command, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for(running: subprocess.Popen[str], folder: Path, pattern: str) -> None:
    while running.poll() is None and not list(folder.glob(pattern)):
        time.sleep(0.01)
    assert running.poll() is None, running.communicate()


def remaining(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file() and path.suffix != ".npz")


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_ends_a_film_and_leaves_no_files(tmp_path: Path, number: int) -> None:
    running = start(
        tmp_path, "render", *SPHERE, "--method", "lambert", "--size", "64x64", "--frames", "90000", "-o", "a.mp4"
    )
    wait_for(running, tmp_path, ".*.mp4")
    time.sleep(0.3)
    running.send_signal(number)
    assert running.communicate(timeout=20) == ("", "")
    assert running.returncode == 128 + number and remaining(tmp_path) == []


SLOW = """
import time
from wgsss.bake import unwrap
made = unwrap._unwrap
def slow(*args):
    open("baking", "w").close()
    time.sleep(60)
unwrap._unwrap = slow
"""


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_ends_a_bake(tmp_path: Path, number: int) -> None:
    running = start(tmp_path, "bake", *SPHERE, code=SLOW)
    wait_for(running, tmp_path, "baking")
    running.send_signal(number)
    assert running.communicate(timeout=20) == ("", "")
    assert running.returncode == 128 + number and remaining(tmp_path) == ["baking"]


CLEANING = """
import time
from wgsss.cli import main
from wgsss.cli import catalogue
def slow(args):
    try:
        open("working", "w").close()
        time.sleep(60)
    finally:
        open("cleaning", "w").close()
        time.sleep(0.5)
        open("cleaned", "w").close()
catalogue.scenes = slow
"""


def test_further_signals_do_not_interrupt_the_clean_up(tmp_path: Path) -> None:
    running = start(tmp_path, "scenes", code=CLEANING)
    wait_for(running, tmp_path, "working")
    running.send_signal(signal.SIGTERM)
    wait_for(running, tmp_path, "cleaning")
    for number in ENDING * 3:
        running.send_signal(number)
        time.sleep(0.01)
    assert running.communicate(timeout=20) == ("", "")
    assert running.returncode == 143 and (tmp_path / "cleaned").exists()


LOST = """
import os, signal, time
from wgsss.bake import unwrap
class Dying:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(1000):
            pass
def slow(*args):
    Dying()
    time.sleep(60)
unwrap._unwrap = slow
"""


def test_a_signal_during_a_destructor_is_not_lost(tmp_path: Path) -> None:
    running = start(tmp_path, "bake", *SPHERE, code=LOST)
    assert running.communicate(timeout=30) == ("", "")
    assert running.returncode == 143


def test_a_signal_that_was_ignored_stays_ignored(tmp_path: Path) -> None:
    argv = ["render", *SPHERE, "--method", "lambert", "--size", "8x8", "--frames", "40", "-o", "a.png"]
    running = start(tmp_path, *argv, code="import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)")
    wait_for(running, tmp_path, "a.0001.png")
    running.send_signal(signal.SIGHUP)
    assert running.wait(timeout=60) == 0 and len(list(tmp_path.glob("a.*.png"))) == 40


CHANGED = """
import time
from wgsss.cli import catalogue
def slow(args):
    open("working", "w").close()
    try:
        time.sleep(60)
    except BaseException:
        raise ImportError("initialization failed") from None
catalogue.scenes = slow
"""


def test_a_signal_that_a_library_converts_to_another_exception_ends_the_command(tmp_path: Path) -> None:
    running = start(tmp_path, "scenes", code=CHANGED)
    wait_for(running, tmp_path, "working")
    running.send_signal(signal.SIGTERM)
    assert running.communicate(timeout=20) == ("", "")
    assert running.returncode == 143
