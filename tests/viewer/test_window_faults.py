"""Faulty shaders, hidden windows and lost surfaces do not end the viewer: it reports them and recovers."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import CUT, RIGHT, ROOT, SIZE_OPTION, WINDOW_SIZE, Desk, Pixels, desk, missing, pictures, right_side

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")

FAULTS = """
import signal
import wgpu
from rendercanvas.contexts.wgpucontext import WgpuContextToScreen as Context
from wgsss.gpu import default_gpu

get_texture, errors = Context._get_current_texture, []

def get_texture_or_fail(context):
    if errors:
        print(f"lost: {errors[-1]}", flush=True)
        raise errors.pop()
    return get_texture(context)

Context._get_current_texture = get_texture_or_fail
signal.signal(signal.SIGUSR1, lambda *_: errors.extend([wgpu.DrawCancelled("Lost"), wgpu.GPUError("no surface")]))
signal.signal(signal.SIGUSR2, lambda *_: default_gpu().device.destroy())
"""
"""makes the surface fail for two frames on SIGUSR1, and the device on SIGUSR2"""
BROKEN = {
    "syntax": ("fn aces(", "fn aces(("),
    "entry point": ("@fragment", ""),
    "binding": ("var<uniform> params", "var<uniform> parameters"),
    "import": ("import package::", "import package::nowhere::"),
}


@pytest.fixture(scope="module")
def shaders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of the shaders, beside a link to the package."""
    folder = tmp_path_factory.mktemp("copy")
    (folder / "wgsss").symlink_to(ROOT / "wgsss")
    shutil.copytree(ROOT / "wgsl", folder / "wgsl")
    return folder


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory, shaders: Path) -> Iterator[Desk]:
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(tmp_path_factory.mktemp("desk"), *argv, *SIZE_OPTION, root=shaders, before=FAULTS) as opened:
        opened.wait_for_pictures()
        opened.wait_for_pixels(right_side, opened.render(RIGHT)[:, CUT + 2 :])
        yield opened


def shows_error(screen: Pixels) -> bool:
    """Return whether the window shows an error message, whose background is red, over the pictures."""
    red, green, blue = pictures(screen)[2, 2].astype(int)
    return bool(red > green + 30 and green == blue)


def lower_right(screen: Pixels) -> Pixels:
    """Return the part of the right side that no error message covers."""
    return right_side(screen)[WINDOW_SIZE[1] // 2 :]


@pytest.mark.parametrize("fault", BROKEN)
def test_broken_shader_is_reported_while_the_last_good_one_stays_in_use(
    window: Desk, shaders: Path, fault: str
) -> None:
    good, bad = BROKEN[fault]
    file = shaders / "wgsl" / "frame" / "tone_map.wgsl"
    text = file.read_text()
    before = window.wait_for(lambda screen: not shows_error(screen))
    file.write_text(text.replace(good, bad))
    window.wait_for(lambda screen: shows_error(screen) and np.array_equal(lower_right(screen), lower_right(before)))
    window.drag(RIGHT, (RIGHT[0] + 20, RIGHT[1] + 10))
    turned = window.render(RIGHT)[:, CUT + 2 :]
    assert (turned != right_side(before)).any()
    half = turned[WINDOW_SIZE[1] // 2 :]
    window.wait_for(lambda screen: shows_error(screen) and np.array_equal(lower_right(screen), half))
    file.write_text(text)
    window.wait_for_pixels(right_side, turned)


def test_minimised_window_looks_the_same_when_restored(window: Desk) -> None:
    before = window.wait_for()
    window.minimise()
    assert not window.grab().any()
    window.minimise(restore=True)
    window.wait_for_pixels(right_side, right_side(before))


def test_window_of_one_pixel_looks_the_same_when_enlarged(window: Desk) -> None:
    before = window.wait_for()
    window.xdotool("windowsize", window.window, 1, 1)
    window.wait_for(lambda screen: not screen[2:, 2:].any())
    window.xdotool("windowsize", window.window, *WINDOW_SIZE)
    window.wait_for_pixels(right_side, right_side(before))


def test_window_draws_again_after_its_surface_is_lost(window: Desk) -> None:
    right = window.render(RIGHT)
    os.kill(window.program.pid, signal.SIGUSR1)
    window.xdotool("mousemove", *RIGHT, "key", "3")
    window.wait_for_pixels(pictures, right)
    assert "lost: no surface" in window.printed(), "a frame was lost"
    window.xdotool("key", "1")


def test_lost_device_ends_the_program_with_one_line(window: Desk) -> None:
    start = len(window.printed())
    os.kill(window.program.pid, signal.SIGUSR2)
    window.xdotool("mousemove", *RIGHT, "key", "2")
    assert window.program.wait(20) == 1
    (line,) = (line for line in window.printed()[start:].splitlines() if line.startswith("wgsss: "))
    assert "the device was lost" in line
