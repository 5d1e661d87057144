"""Time in the window: played, paused and stepped; and how many frames it takes until input is seen."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import CUT, RIGHT, SMALL, Desk, Pixels, desk, missing, pictures

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")

GATE = """
import time
from pathlib import Path
from wgsss.viewer import pace
from wgsss.viewer.window import Window

pace.SCALES = (1.0,)
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
"""where there is a file `gate`, each frame waits for a file `go` before it is drawn; all are drawn in full"""


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    argv = ["wave", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(tmp_path_factory.mktemp("desk"), *argv, *SMALL, before=GATE) as opened:
        opened.settled(lambda screen: bool(pictures(screen).any()))
        right = opened.drawn(RIGHT)
        opened.settled(lambda screen: same(screen, right))
        yield opened


def same(screen: Pixels, picture: Pixels) -> bool:
    """Whether a picture is on the right, in full."""
    return np.array_equal(pictures(screen)[:, CUT + 2 :], picture[:, CUT + 2 :])


def time_of(command: list[str]) -> float:
    return float(command[command.index("--time") + 1]) if "--time" in command else 0.0


def test_time_is_played_and_paused_and_no_time_passes_meanwhile(window: Desk) -> None:
    before = pictures(window.settled())
    window.do("mousemove", *RIGHT, "key", "space")
    deadline = time.monotonic() + 30.0
    while np.array_equal(pictures(window.look()), before) and time.monotonic() < deadline:
        time.sleep(0.2)
    window.do("key", "space")
    window.settled()
    paused = window.drawn(RIGHT)
    window.settled(lambda screen: same(screen, paused))
    assert (paused != before).any()
    at = time_of(window.copied(RIGHT))
    assert at > 0.0
    folder = window.output.parent
    (folder / "gate").touch()
    time.sleep(2.0)
    window.do("key", "space")
    until(folder, True)
    frame(window, folder)
    window.do("key", "space")
    (folder / "gate").unlink()
    assert time_of(window.copied(RIGHT)) - at < 1.5


def test_a_step_is_a_twenty_fifth_of_a_second(window: Desk) -> None:
    at = time_of(window.copied(RIGHT))
    window.do("mousemove", *RIGHT, "key", "period", "key", "period")
    assert time_of(window.copied(RIGHT)) - at == pytest.approx(0.08)
    stepped = window.drawn(RIGHT)
    window.settled(lambda screen: same(screen, stepped))


@pytest.fixture
def gate(window: Desk) -> Iterator[Path]:
    window.do("key", "r")
    right = window.drawn(RIGHT)
    window.settled(lambda screen: same(screen, right))
    folder = window.output.parent
    (folder / "gate").touch()
    yield folder
    (folder / "gate").unlink(missing_ok=True)


def until(folder: Path, waits: bool) -> None:
    """A frame is about to be drawn, or is not any more."""
    end = time.monotonic() + 30.0
    while (folder / "waiting").exists() != waits:
        assert time.monotonic() < end
        time.sleep(0.01)


def frame(window: Desk, folder: Path) -> Pixels:
    """What is seen after the frame that waits."""
    (folder / "go").touch()
    until(folder, False)
    until(folder, True)
    time.sleep(0.3)  # the display has been told, and may take a moment
    return window.look()


def test_input_is_seen_at_most_two_frames_later(window: Desk, gate: Path) -> None:
    place = [RIGHT[0], RIGHT[1]]
    window.do("mousemove", *place, "mousedown", 1)
    until(gate, True)
    seen = [window.look()]
    window.do("mousemove", place[0] + 30, place[1] + 15)  # while a frame is being drawn that cannot know of it
    seen += [frame(window, gate), frame(window, gate)]
    window.do("mouseup", 1)
    (gate / "gate").unlink()
    right = window.drawn(RIGHT)
    window.settled(lambda screen: same(screen, right))
    frames = [same(screen, right) for screen in seen].index(True)
    assert 0 < frames <= 2
