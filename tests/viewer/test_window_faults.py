"""What would end other programs does not end the viewer: it says what is wrong, and goes on once it is right again."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import CUT, RIGHT, ROOT, SMALL, WINDOW, Desk, Pixels, desk, missing, pictures

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")

FAULTS = """
import signal
import wgpu
from rendercanvas.contexts.wgpucontext import WgpuContextToScreen as Context
from wgsss.gpu import default_gpu

take, lost = Context._get_current_texture, []

def try_to_take(context):
    if lost:
        print(f"lost: {lost[-1]}", flush=True)
        raise lost.pop()
    return take(context)

Context._get_current_texture = try_to_take
signal.signal(signal.SIGUSR1, lambda *_: lost.extend([wgpu.DrawCancelled("Lost"), wgpu.GPUError("no surface")]))
signal.signal(signal.SIGUSR2, lambda *_: default_gpu().device.destroy())
"""
"""surfaces that are lost for two frames, and a device that is lost, when told so"""
BROKEN = {
    "syntax": ("fn aces(", "fn aces(("),
    "entry point": ("@fragment", ""),
    "binding": ("var<uniform> params", "var<uniform> parameters"),
    "import": ("import package::", "import package::nowhere::"),
}
BELOW = slice(WINDOW[1] // 2, None)
"""rows of a picture that nothing is said over"""


@pytest.fixture(scope="module")
def shaders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project's shaders, beside the project."""
    folder = tmp_path_factory.mktemp("copy")
    (folder / "wgsss").symlink_to(ROOT / "wgsss")
    shutil.copytree(ROOT / "wgsl", folder / "wgsl")
    return folder


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory, shaders: Path) -> Iterator[Desk]:
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(tmp_path_factory.mktemp("desk"), *argv, *SMALL, root=shaders, before=FAULTS) as opened:
        opened.settled(lambda screen: bool(pictures(screen).any()))
        opened.settled(shows(opened.drawn(RIGHT)))
        yield opened


def is_said(screen: Pixels) -> bool:
    """Whether something is said over the pictures."""
    red, green, blue = pictures(screen)[2, 2].astype(int)
    return bool(red > green + 30 and green == blue)


def shows(wanted: Pixels, rows: slice = slice(None)) -> Callable[[Pixels], bool]:
    """Whether a picture is on the right, in full."""
    return lambda screen: np.array_equal(pictures(screen)[rows, CUT + 2 :], wanted[rows, CUT + 2 :])


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_shader_is_said_and_the_last_good_one_goes_on(window: Desk, shaders: Path, fault: str) -> None:
    good, bad = BROKEN[fault]
    file = shaders / "wgsl" / "frame" / "tone_map.wgsl"
    text = file.read_text()
    before = pictures(window.settled(lambda screen: not is_said(screen)))
    file.write_text(text.replace(good, bad))
    window.settled(lambda screen: is_said(screen) and shows(before, BELOW)(screen))
    window.drag(RIGHT, (RIGHT[0] + 20, RIGHT[1] + 10))
    turned = window.drawn(RIGHT)
    window.settled(lambda screen: is_said(screen) and shows(turned, BELOW)(screen))
    assert (turned != before).any()
    file.write_text(text)
    window.settled(shows(turned))


def test_a_minimised_window_comes_back_as_it_should_look(window: Desk) -> None:
    before = pictures(window.settled())
    window.minimise()
    assert not window.look().any()
    window.minimise(back=True)
    window.settled(shows(before))


def test_a_window_of_one_pixel_comes_back_as_it_should_look(window: Desk) -> None:
    before = pictures(window.settled())
    window.do("windowsize", window.window, 1, 1)
    window.settled(lambda screen: not screen[2:, 2:].any())
    window.do("windowsize", window.window, *WINDOW)
    window.settled(shows(before))


def test_a_lost_surface_is_drawn_on_again(window: Desk) -> None:
    right = window.drawn(RIGHT)
    os.kill(window.program.pid, signal.SIGUSR1)
    window.do("mousemove", *RIGHT, "key", "3")
    window.settled(lambda screen: np.array_equal(pictures(screen), right))
    assert "lost: no surface" in window.said(), "a frame was lost"
    window.do("key", "1")


def test_a_lost_device_ends_the_program_with_one_line(window: Desk) -> None:
    said = len(window.said())
    os.kill(window.program.pid, signal.SIGUSR2)
    window.do("mousemove", *RIGHT, "key", "2")
    assert window.program.wait(20) == 1
    (line,) = (line for line in window.said()[said:].splitlines() if line.startswith("wgsss: "))
    assert "the device was lost" in line
