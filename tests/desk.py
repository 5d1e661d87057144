"""A desktop for a window under test: a virtual screen, and someone at pointer and keys who knows the viewer."""

from __future__ import annotations

import ctypes
import os
import shlex
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
from PIL import Image as Picture
from PIL import ImageGrab

from wgsss.cli import main
from wgsss.viewer.panels import PANEL_WIDTH

ROOT = Path(__file__).parents[1]
SCREEN = 1000, 640
NEEDS = "Xvfb", "xdotool"
PATIENCE_S = 60.0

WINDOW = 700, 420
"""pixels, of windows that are opened with SMALL"""
SMALL = "--size", f"{WINDOW[0]}x{WINDOW[1]}"
CUT = (WINDOW[0] - PANEL_WIDTH) // 2
"""pixels of a picture that are the left side's"""
DIVIDER = PANEL_WIDTH + CUT
LEFT, RIGHT = (DIVIDER - 60, 200), (DIVIDER + 60, 200)
"""places on either side"""

Pixels = npt.NDArray[np.uint8]


def pictures(screen: Pixels) -> Pixels:
    """What the window shows beside its panel."""
    return screen[: WINDOW[1], PANEL_WIDTH : WINDOW[0]]


def shown(file: Path) -> Pixels:
    """uint8 (H, W, 3): a PNG as the window shows it, on black."""
    with Picture.open(file) as picture:
        rgba = np.asarray(picture.convert("RGBA"))
    return rgba[..., :3] * (rgba[..., 3:] > 0)


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
        self.looks = 0

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
        return np.asarray(ImageGrab.grab(xdisplay=self.display).convert("RGB"))

    def minimise(self, back: bool = False) -> None:
        """What a window manager does to an icon: unmap the window and say so; or map it again."""
        x11 = ctypes.CDLL("libX11.so.6")
        x11.XOpenDisplay.restype = x11.XInternAtom.restype = ctypes.c_void_p
        screen = ctypes.c_void_p(x11.XOpenDisplay(self.display.encode()))
        word = ctypes.c_ulong(x11.XInternAtom(screen, b"WM_STATE", False))
        state = (ctypes.c_long * 2)(1 if back else 3, 0)
        x11.XChangeProperty(screen, ctypes.c_ulong(self.window), word, word, 32, 0, state, 2)
        (x11.XMapWindow if back else x11.XUnmapWindow)(screen, ctypes.c_ulong(self.window))
        x11.XCloseDisplay(screen)

    @property
    def window(self) -> int:
        """Its number."""
        return int(self.do("search", "--name", "wgsss").split()[0])

    def copied(self, at: tuple[int, int]) -> list[str]:
        """The words of the command that the window copies for the side under a place."""
        said = len(self.said())
        self.do("mousemove", *at, "key", "c")
        self.settled(lambda _: "copied: " in self.said()[said:])
        return shlex.split(self.said()[said:].split("copied: ")[1].splitlines()[0])

    def drawn(self, at: tuple[int, int]) -> Pixels:
        """What that command draws."""
        file = self.output.with_name("drawn.png")
        assert main([*self.copied(at)[1:], "-o", str(file)]) == 0
        return shown(file)

    def settled(self, wanted: Callable[[Pixels], bool] = lambda pixels: True) -> Pixels:
        """The screen once it stays as it is, and as it is wanted."""
        end = time.monotonic() + PATIENCE_S
        last = self.look()
        while time.monotonic() < end:
            time.sleep(0.7)
            assert self.program.poll() is None, self.said()
            now = self.look()
            if np.array_equal(now, last) and now.any() and wanted(now):
                self._keep(now)
                return now
            last = now
        raise AssertionError(f"the window did not come to rest as wanted; it said: {self.said()}")

    def _keep(self, pixels: Pixels) -> None:
        """Beside what was said, for who wants to see."""
        self.looks += 1
        Picture.fromarray(pixels).save(self.output.with_name(f"look-{self.looks:03}.png"))

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
