"""The viewer on a virtual screen, with a pointer and keys that tests control."""

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

import numpy as np
import numpy.typing as npt
from PIL import Image as Picture
from PIL import ImageGrab

from wgsss.cli import main
from wgsss.viewer.layout import PANEL_WIDTH

ROOT = Path(__file__).parents[1]
SCREEN_SIZE = 1000, 640
PROGRAMS = "Xvfb", "xdotool"
TIMEOUT_S = 60.0

WINDOW_SIZE = 700, 420
"""pixels, of windows that are opened with SIZE_OPTION"""
SIZE_OPTION = "--size", f"{WINDOW_SIZE[0]}x{WINDOW_SIZE[1]}"
CUT = (WINDOW_SIZE[0] - PANEL_WIDTH) // 2
"""columns of the pictures that show the left side"""
DIVIDER = PANEL_WIDTH + CUT
LEFT, RIGHT = (DIVIDER - 60, 200), (DIVIDER + 60, 200)
"""positions over either side"""

Pixels = npt.NDArray[np.uint8]
Position = tuple[int, int]


def pictures(screen: Pixels) -> Pixels:
    """Return the part of the window beside its panel."""
    return screen[: WINDOW_SIZE[1], PANEL_WIDTH : WINDOW_SIZE[0]]


def right_side(screen: Pixels) -> Pixels:
    """Return the part of the window right of the divider, without the divider's own columns."""
    return pictures(screen)[:, CUT + 2 :]


def read_png(file: Path) -> Pixels:
    """Read a PNG as the window shows it, on black: uint8 (H, W, 3)."""
    with Picture.open(file) as picture:
        rgba = np.asarray(picture.convert("RGBA"))
    return rgba[..., :3] * (rgba[..., 3:] > 0)


def missing() -> str:
    """Return the names of programs and modules that a test of a window needs and that are not installed."""
    names = [name for name in PROGRAMS if shutil.which(name) is None]
    for module in ("glfw", "rendercanvas", "imgui_bundle"):
        try:
            __import__(module)
        except ImportError:
            names.append(module)
    return ", ".join(names)


class Desk:
    """A virtual screen that shows the viewer."""

    def __init__(self, display: str, program: subprocess.Popen[str], output: Path) -> None:
        """`output` is the file to which the program prints."""
        self.display, self.program, self.output = display, program, output
        self._grabs = 0

    def xdotool(self, *words: object) -> str:
        """Run an xdotool command, and return what it prints."""
        command = ["xdotool", *map(str, words)]
        env = {**os.environ, "DISPLAY": self.display}
        return subprocess.run(command, env=env, capture_output=True, text=True, timeout=20).stdout.strip()

    def drag(self, start: Position, end: Position, button: int = 1, key: str = "") -> None:
        """Drag the pointer with a button, and with a key held if one is named."""
        self.xdotool("mousemove", *start)
        words: list[object] = ["keydown", key] if key else []
        words += ["mousedown", button]
        for share in (0.25, 0.5, 0.75, 1.0):
            words += ["mousemove", *(round(a + share * (b - a)) for a, b in zip(start, end, strict=True))]
        self.xdotool(*words, "mouseup", button, *(["keyup", key] if key else []))

    def grab(self) -> Pixels:
        """Return the pixels of the screen: uint8 (H, W, 3)."""
        return np.asarray(ImageGrab.grab(xdisplay=self.display).convert("RGB"))

    def minimise(self, restore: bool = False) -> None:
        """Minimise the window, or restore it, as a window manager does: unmap or map it, and set its state."""
        x11 = ctypes.CDLL("libX11.so.6")
        x11.XOpenDisplay.restype = x11.XInternAtom.restype = ctypes.c_void_p
        screen = ctypes.c_void_p(x11.XOpenDisplay(self.display.encode()))
        name = ctypes.c_ulong(x11.XInternAtom(screen, b"WM_STATE", False))
        state = (ctypes.c_long * 2)(1 if restore else 3, 0)
        x11.XChangeProperty(screen, ctypes.c_ulong(self.window), name, name, 32, 0, state, 2)
        (x11.XMapWindow if restore else x11.XUnmapWindow)(screen, ctypes.c_ulong(self.window))
        x11.XCloseDisplay(screen)

    @property
    def window(self) -> int:
        """The X11 id of the window."""
        return int(self.xdotool("search", "--name", "wgsss").split()[0])

    def copy_command(self, position: Position) -> list[str]:
        """Copy the command of the side at a position, and return its words."""
        start = len(self.printed())
        self.xdotool("mousemove", *position, "key", "c")
        self.wait_for(lambda _: "copied: " in self.printed()[start:])
        return shlex.split(self.printed()[start:].split("copied: ")[1].splitlines()[0])

    def render(self, position: Position) -> Pixels:
        """Run the command of the side at a position, and return the picture that it draws."""
        return self.render_command(self.copy_command(position))

    def render_command(self, command: list[str]) -> Pixels:
        """Run a copied command, and return the picture that it draws."""
        file = self.output.with_name("drawn.png")
        assert main([*command[1:], "-o", str(file)]) == 0
        return read_png(file)

    def wait_for(self, condition: Callable[[Pixels], bool] = lambda screen: True) -> Pixels:
        """Wait until the screen no longer changes and fulfils a condition, and return it.

        The screen is also saved beside the output, for inspection.
        """
        end = time.monotonic() + TIMEOUT_S
        last = self.grab()
        while time.monotonic() < end:
            time.sleep(0.7)
            assert self.program.poll() is None, self.printed()
            now = self.grab()
            if np.array_equal(now, last) and now.any() and condition(now):
                self._grabs += 1
                Picture.fromarray(now).save(self.output.with_name(f"screen-{self._grabs:03}.png"))
                return now
            last = now
        raise AssertionError(f"the screen did not fulfil the condition; the program printed: {self.printed()}")

    def wait_for_change(self, area: Callable[[Pixels], Pixels], before: Pixels) -> Pixels:
        """Wait until an area of the screen differs from what it was, and return the screen."""
        return self.wait_for(lambda screen: not np.array_equal(area(screen), before))

    def wait_for_pixels(self, area: Callable[[Pixels], Pixels], pixels: Pixels) -> Pixels:
        """Wait until an area of the screen has some pixels, and return the screen."""
        return self.wait_for(lambda screen: np.array_equal(area(screen), pixels))

    def wait_for_pictures(self) -> Pixels:
        """Wait until the window shows something beside its panel, and return the screen."""
        return self.wait_for(lambda screen: bool(pictures(screen).any()))

    def printed(self) -> str:
        """Return all that the program has printed."""
        return self.output.read_text()


@contextmanager
def desk(folder: Path, *argv: str, root: Path = ROOT, before: str = "") -> Iterator[Desk]:
    """Run `wgsss view` with some arguments on a screen of its own.

    Args:
        folder: where the program runs and writes.
        root: the checkout that the program is imported from.
        before: Python code that the program runs first.
    """
    read, write = os.pipe()
    size = f"{SCREEN_SIZE[0]}x{SCREEN_SIZE[1]}x24"
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", size, "-nolisten", "tcp"]
    screen = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        display = f":{pipe.readline().strip()}"
    output = folder / "output.txt"
    env = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(root), "XDG_STATE_HOME": str(folder)}
    try:
        with output.open("w") as file:
            code = f"{before}\nfrom wgsss.cli import main\nraise SystemExit(main())"
            command = [sys.executable, "-c", code, "view", *argv]
            program = subprocess.Popen(command, cwd=folder, env=env, stdout=file, stderr=file, text=True)
        try:
            yield Desk(display, program, output)
        finally:
            program.terminate()
            program.wait(20)
    finally:
        screen.terminate()
        screen.wait(20)
