"""A desktop for a window under test: a virtual screen, and someone at pointer and keys."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).parents[1]
SCREEN = 1000, 640
NEEDS = "Xvfb", "xdotool"
PATIENCE_S = 60.0

Pixels = npt.NDArray[np.uint8]


def missing() -> str:
    """What keeps a window from being tested here; empty if nothing does."""
    lacking = [name for name in NEEDS if shutil.which(name) is None]
    for module in ("glfw", "rendercanvas", "imgui_bundle"):
        try:
            __import__(module)
        except ImportError:
            lacking.append(module)
    return ", ".join(lacking)


class Desk:
    """A screen with one program on it."""

    def __init__(self, display: str, program: subprocess.Popen[str], output: Path) -> None:
        self.display, self.program, self.output = display, program, output

    def do(self, *words: Any) -> str:
        """An xdotool command."""
        command = ["xdotool", *map(str, words)]
        env = {**os.environ, "DISPLAY": self.display}
        return subprocess.run(command, env=env, capture_output=True, text=True, timeout=20).stdout.strip()

    def drag(self, start: tuple[int, int], end: tuple[int, int], button: int = 1, key: str = "") -> None:
        """With a key held, where one is named."""
        self.do("mousemove", *start)
        words: list[Any] = ["keydown", key] if key else []
        words += ["mousedown", button]
        for share in (0.25, 0.5, 0.75, 1.0):
            words += ["mousemove", *(round(a + share * (b - a)) for a, b in zip(start, end, strict=True))]
        self.do(*words, "mouseup", button, *(["keyup", key] if key else []))

    def look(self) -> Pixels:
        """uint8 (H, W, 3): the screen."""
        from PIL import ImageGrab

        return np.asarray(ImageGrab.grab(xdisplay=self.display).convert("RGB"))

    def settled(self, wanted: Callable[[Pixels], bool] = lambda pixels: True) -> Pixels:
        """The screen once it stays as it is, and as it is wanted."""
        end = time.monotonic() + PATIENCE_S
        last = self.look()
        while time.monotonic() < end:
            time.sleep(0.7)
            assert self.program.poll() is None, self.said()
            now = self.look()
            if np.array_equal(now, last) and now.any() and wanted(now):
                return now
            last = now
        raise AssertionError(f"the window did not come to rest as wanted; it said: {self.said()}")

    def said(self) -> str:
        """What the program has printed."""
        return self.output.read_text()


@contextmanager
def desk(folder: Path, *argv: str, root: Path = ROOT, before: str = "") -> Iterator[Desk]:
    """`wgsss view` with these arguments on a screen of its own; what it writes goes to the folder.

    The program is that below `root`, and runs what is to be `before` it first.
    """
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{SCREEN[0]}x{SCREEN[1]}x24", "-nolisten", "tcp"]
    screen = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as found:
        display = f":{found.readline().strip()}"
    output = folder / "said.txt"
    env = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(root), "XDG_STATE_HOME": str(folder)}
    try:
        with output.open("w") as file:
            code = f"{before}\nfrom wgsss.cli import main\nraise SystemExit(main())"
            started = [sys.executable, "-c", code, "view", *argv]
            program = subprocess.Popen(started, cwd=folder, env=env, stdout=file, stderr=file, text=True)
        try:
            yield Desk(display, program, output)
        finally:
            program.terminate()
            program.wait(20)
    finally:
        screen.terminate()
        screen.wait(20)
