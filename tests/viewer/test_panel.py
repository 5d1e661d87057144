"""The panel under pointer and keys, on a virtual screen: what is set there is what the copied command draws."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import Desk, Pixels, desk, missing
from PIL import Image as Picture

from wgsss.cli import main
from wgsss.viewer.panels import PANEL_WIDTH

WINDOW = 700, 420
ARGV = "slab", "--vertices", "300", "--method", "barre11", "--against", "lambert"
MIDDLE = PANEL_WIDTH + 100, 200
"""on the left side"""
KNOB = 8
"""rows above the left side's first knob"""

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")


def row(number: int) -> int:
    """Where a row of the panel is, logical pixels from the top."""
    return 18 + 24 * number


def left_of(screen: Pixels, scale: int = 1) -> Pixels:
    """What is shown of the left side, the divider left out."""
    cut = (PANEL_WIDTH + (WINDOW[0] - PANEL_WIDTH) // 2 - 2) * scale
    return screen[: WINDOW[1] * scale, PANEL_WIDTH * scale : cut]


def copied(window: Desk) -> list[str]:
    """The command that the window copies for the left side."""
    said = len(window.said())
    window.do("mousemove", *MIDDLE, "key", "c")
    window.settled(lambda _: "copied: " in window.said()[said:])
    return shlex.split(window.said()[said:].split("copied: ")[1].splitlines()[0])


def drawn(command: list[str], folder: Path) -> Pixels:
    """What a command draws."""
    file = folder / "drawn.png"
    assert main([*command[1:], "-o", str(file)]) == 0
    with Picture.open(file) as picture:
        rgba = np.asarray(picture.convert("RGBA"))
    return rgba[..., :3] * (rgba[..., 3:] > 0)


def check(window: Desk, before: Pixels, said: str, folder: Path) -> None:
    """That the left side has changed, to what its command draws, which says so."""
    window.do("mousemove", *MIDDLE)
    after = left_of(window.settled(lambda screen: not np.array_equal(left_of(screen), before)))
    command = copied(window)
    assert said in " ".join(command)
    np.testing.assert_array_equal(after, drawn(command, folder)[:, : after.shape[1]])


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    with desk(tmp_path_factory.mktemp("desk"), *ARGV, "--size", f"{WINDOW[0]}x{WINDOW[1]}") as opened:
        opened.settled(lambda screen: bool(left_of(screen).any()))
        yield opened


def test_a_knob_dragged_changes_the_picture(window: Desk, tmp_path: Path) -> None:
    before = left_of(window.settled())
    window.drag((16, row(KNOB)), (120, row(KNOB)))
    check(window, before, "--set distortion=0.", tmp_path)


def test_keys_reach_a_knob_and_are_given_back(window: Desk, tmp_path: Path) -> None:
    before = left_of(window.settled())
    window.do("mousemove", *MIDDLE, "key", "p", "Home", *["Down"] * KNOB, "Return")
    window.settled()
    window.do("key", "ctrl+a")
    window.do("type", "0.25")
    window.do("key", "Return")
    check_typed = window.settled(lambda screen: not np.array_equal(left_of(screen), before))
    window.do("key", "1")
    np.testing.assert_array_equal(left_of(window.settled()), left_of(check_typed), "1 is not the window's now")
    window.do("key", "Escape")
    check(window, before, "--set distortion=0.25", tmp_path)
