"""The panel under pointer and keys, on a virtual screen: what is set there is what the copied command draws."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import Desk, Pixels, desk, missing
from PIL import Image as Picture

from wgsss.cli import main
from wgsss.viewer.panels import PANEL_WIDTH

WINDOW = 700, 600
ARGV = "slab", "--vertices", "300", "--method", "barre11", "--against", "lambert"
MIDDLE = PANEL_WIDTH + 100, 200
"""on the left side"""
KNOB = 8
"""rows above the left side's first knob"""

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")


def row(number: int) -> int:
    """Where a row of the panel is, logical pixels from the top."""
    return 18 + 24 * number


def click(window: Desk, *rows: int) -> None:
    """Near the left end of rows, one after the other."""
    for number in rows:
        window.do("mousemove", 20, row(number), "click", 1)
        window.settled()


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
    assert "--camera" not in command, "what is dragged in the panel is the panel's"
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
    typed = window.settled(lambda screen: not np.array_equal(left_of(screen), before))
    window.do("key", "1")
    np.testing.assert_array_equal(left_of(window.settled()), left_of(typed), "1 is not the window's now")
    window.do("key", "Escape")
    check(window, before, "--set distortion=0.25 --size", tmp_path)


@pytest.fixture(scope="module")
def folded(window: Desk) -> Desk:
    """With both sides' headings closed."""
    click(window, 6, 7)
    return window


BALL = 8 + 48, row(13) + 12 + 48
"""the middle of the light's"""


@pytest.mark.parametrize(
    ("start", "end"), [((60, row(12)), (90, row(12))), (BALL, (BALL[0] + 20, BALL[1] - 30))], ids=["slider", "ball"]
)
def test_a_light_is_aimed(folded: Desk, tmp_path: Path, start: tuple[int, int], end: tuple[int, int]) -> None:
    click(folded, 8)
    before = left_of(folded.settled())
    folded.drag(start, end)
    check(folded, before, "--light", tmp_path)
    click(folded, 8)


def test_a_coefficient_dragged_changes_picture_and_profile(folded: Desk, tmp_path: Path) -> None:
    click(folded, 9)
    before = folded.settled()
    profile = slice(275, 380), slice(80, 300)
    folded.drag((63, 454), (140, 454))
    check(folded, left_of(before), "sigma_a = [0.", tmp_path)
    assert not np.array_equal(folded.look()[profile], before[profile])
    click(folded, 9)


def test_time_goes_on_by_steps(folded: Desk) -> None:
    click(folded, 10)
    for _ in range(2):
        folded.do("mousemove", 67, row(11), "click", 1)
        folded.settled()
    assert copied(folded)[-4:-2] == ["--time", "0.08"]
    click(folded, 10)


def test_size_and_headings_are_remembered(tmp_path: Path) -> None:
    argv = "slab", "--vertices", "300", "--method", "lambert"
    with desk(tmp_path, *argv, "--size", "640x360") as first:
        first.settled()
        click(first, 6, 7)
        first.do("mousemove", 500, 150)
        seen = first.settled()
        first.do("key", "q")
        assert first.program.wait(20) == 0
    with desk(tmp_path, *argv) as second:
        panel = slice(0, row(11)), slice(0, PANEL_WIDTH)
        again = second.settled(lambda screen: np.array_equal(screen[panel], seen[panel]))
        np.testing.assert_array_equal(again[:360, PANEL_WIDTH:], seen[:360, PANEL_WIDTH:])
        (found,) = second.do("search", "--name", "wgsss").splitlines()[:1]
        assert "640x360" in second.do("getwindowgeometry", found)


TWICE = """
import ctypes, subprocess
kept = ctypes.CDLL("libX11.so.6").XOpenDisplay(None)  # a screen forgets all with its last client
subprocess.run(["xrdb", "-nocpp"], input=b"Xft.dpi: 192\\n", check=True)
"""


@pytest.mark.skipif(shutil.which("xrdb") is None, reason="a display's scale is set by xrdb")
def test_a_display_of_scale_two_has_four_pixels_for_one(tmp_path: Path) -> None:
    argv = "slab", "--vertices", "300", "--method", "lambert", "--size", "480x300"
    with desk(tmp_path, *argv, before=TWICE) as opened:
        seen = opened.settled(lambda screen: bool(screen[400:600, 500:960].any()))
        opened.do("mousemove", 600, 300, "key", "c")
        opened.settled(lambda _: "copied" in opened.said())
    command = shlex.split(opened.said().split("copied: ")[1].splitlines()[0])
    assert command[-2:] == ["--size", "480x600"]
    np.testing.assert_array_equal(seen[:600, 480:716], drawn(command, tmp_path)[:, :236])
    panel = seen[:600, :480].astype(int)
    fine = np.abs(panel[::2, ::2] - panel[1::2, 1::2]).max(axis=2) > 60
    assert fine[: row(4), :120].mean() > 0.02, "letters are drawn with all the pixels there are"
