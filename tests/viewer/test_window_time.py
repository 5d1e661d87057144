"""The animation in the window, and how many frames pass until an input is visible."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import CUT, RIGHT, SIZE_OPTION, Desk, Pixels, desk, missing, pictures, right_side

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")

GATE = """
import time
from pathlib import Path
from wgsss.viewer import painter
from wgsss.viewer.window import Window

painter.SCALES = (1.0,)
draw = Window._draw

def wait_and_draw(window):
    if Path("gate").exists():
        Path("waiting").touch()
        while Path("gate").exists() and not Path("go").exists():
            time.sleep(0.01)
        Path("waiting").unlink()
        Path("go").unlink(missing_ok=True)
    draw(window)

Window._draw = wait_and_draw
"""
"""draws all frames at full resolution; while a file `gate` exists, each frame waits for a file `go`"""


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    argv = ["wave", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(tmp_path_factory.mktemp("desk"), *argv, *SIZE_OPTION, before=GATE) as opened:
        opened.wait_for_pictures()
        wait_for_rendered(opened)
        yield opened


def wait_for_rendered(window: Desk) -> Pixels:
    """Wait until the right side is what its command draws, and return it."""
    right = window.render(RIGHT)[:, CUT + 2 :]
    window.wait_for_pixels(right_side, right)
    return right


def time_of(command: list[str]) -> float:
    return float(command[command.index("--time") + 1]) if "--time" in command else 0.0


def test_animation_plays_and_pauses_and_does_not_skip_the_time_of_a_slow_frame(window: Desk) -> None:
    before = pictures(window.wait_for())
    window.xdotool("mousemove", *RIGHT, "key", "space")
    deadline = time.monotonic() + 30.0
    while np.array_equal(pictures(window.grab()), before) and time.monotonic() < deadline:
        time.sleep(0.2)
    window.xdotool("key", "space")
    window.wait_for()
    paused = wait_for_rendered(window)
    assert (paused != before[:, CUT + 2 :]).any()
    start_s = time_of(window.copy_command(RIGHT))
    assert start_s > 0.0
    folder = window.output.parent
    (folder / "gate").touch()
    time.sleep(2.0)
    window.xdotool("key", "space")
    wait_at_gate(folder, True)
    release_frame(window, folder)
    window.xdotool("key", "space")
    (folder / "gate").unlink()
    assert time_of(window.copy_command(RIGHT)) - start_s < 1.5


def test_step_is_a_twenty_fifth_of_a_second(window: Desk) -> None:
    start_s = time_of(window.copy_command(RIGHT))
    window.xdotool("mousemove", *RIGHT, "key", "period", "key", "period")
    assert time_of(window.copy_command(RIGHT)) - start_s == pytest.approx(0.08)
    wait_for_rendered(window)


@pytest.fixture
def gate(window: Desk) -> Iterator[Path]:
    """Make each frame wait, and return the folder of the files that release it."""
    window.xdotool("key", "r")
    wait_for_rendered(window)
    folder = window.output.parent
    (folder / "gate").touch()
    yield folder
    (folder / "gate").unlink(missing_ok=True)


def wait_at_gate(folder: Path, is_waiting: bool) -> None:
    """Wait until a frame waits for `go`, or until none does."""
    end = time.monotonic() + 30.0
    while (folder / "waiting").exists() != is_waiting:
        assert time.monotonic() < end
        time.sleep(0.01)


def release_frame(window: Desk, folder: Path) -> Pixels:
    """Let the frame that waits be drawn, and return the screen that it leaves."""
    (folder / "go").touch()
    wait_at_gate(folder, False)
    wait_at_gate(folder, True)
    time.sleep(0.3)  # the screen may show the frame a moment later
    return window.grab()


def test_input_is_visible_after_at_most_two_frames(window: Desk, gate: Path) -> None:
    x, y = RIGHT
    window.xdotool("mousemove", x, y, "mousedown", 1)
    wait_at_gate(gate, True)
    screens = [window.grab()]
    window.xdotool("mousemove", x + 30, y + 15)  # the frame that waits cannot show this
    screens += [release_frame(window, gate), release_frame(window, gate)]
    window.xdotool("mouseup", 1)
    (gate / "gate").unlink()
    right = wait_for_rendered(window)
    frames = [np.array_equal(right_side(screen), right) for screen in screens].index(True)
    assert 0 < frames <= 2
