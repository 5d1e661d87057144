"""Pointer and keys over the panel, on a virtual screen: the copied command has the values that the panel sets."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import Desk, Pixels, desk, missing

from wgsss.viewer.layout import PANEL_WIDTH

WINDOW_SIZE = 700, 600
ARGV = "slab", "--vertices", "300", "--method", "barre11", "--against", "lambert"
LEFT = PANEL_WIDTH + 100, 200
"""a position on the left side"""
KNOB = 8
"""row of the left side's first knob"""

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")


def row(number: int) -> int:
    """Return the y of a row of the panel, logical pixels."""
    return 18 + 24 * number


def click(window: Desk, *rows: int) -> None:
    """Click near the left end of rows, one after the other."""
    for number in rows:
        window.xdotool("mousemove", 20, row(number), "click", 1)
        window.wait_for()


def left_side(screen: Pixels) -> Pixels:
    """Return the part of the window between panel and divider."""
    cut = PANEL_WIDTH + (WINDOW_SIZE[0] - PANEL_WIDTH) // 2 - 2
    return screen[: WINDOW_SIZE[1], PANEL_WIDTH:cut]


def check_change(window: Desk, before: Pixels, option: str) -> None:
    """Check that the left side has changed, and that its command has an option and draws the same."""
    window.xdotool("mousemove", *LEFT)
    after = left_side(window.wait_for_change(left_side, before))
    command = window.copy_command(LEFT)
    assert option in " ".join(command)
    assert "--camera" not in command, "a drag in the panel does not move the camera"
    np.testing.assert_array_equal(after, window.render_command(command)[:, : after.shape[1]])


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    size = f"{WINDOW_SIZE[0]}x{WINDOW_SIZE[1]}"
    with desk(tmp_path_factory.mktemp("desk"), *ARGV, "--size", size) as opened:
        opened.wait_for(lambda screen: bool(left_side(screen).any()))
        yield opened


def test_knob_that_is_dragged_changes_the_picture(window: Desk) -> None:
    before = left_side(window.wait_for())
    window.drag((16, row(KNOB)), (120, row(KNOB)))
    check_change(window, before, "--set distortion=0.")


def test_panel_takes_the_keys_until_escape(window: Desk) -> None:
    before = left_side(window.wait_for())
    window.xdotool("mousemove", *LEFT, "key", "p", "Home", *["Down"] * KNOB, "Return")
    window.wait_for()
    window.xdotool("key", "ctrl+a")
    window.xdotool("type", "0.25")
    window.xdotool("key", "Return")
    typed = window.wait_for_change(left_side, before)
    window.xdotool("key", "1")
    np.testing.assert_array_equal(left_side(window.wait_for()), left_side(typed), "1 does not reach the window")
    window.xdotool("key", "Escape")
    check_change(window, before, "--set distortion=0.25 --size")


@pytest.fixture(scope="module")
def folded(window: Desk) -> Desk:
    """Close the headings of both sides."""
    click(window, 6, 7)
    return window


BALL = 8 + 48, row(13) + 12 + 48
"""centre of the ball on which a light is dragged"""


@pytest.mark.parametrize(
    ("start", "end"), [((60, row(12)), (90, row(12))), (BALL, (BALL[0] + 20, BALL[1] - 30))], ids=["slider", "ball"]
)
def test_light_is_aimed_by_slider_and_ball(folded: Desk, start: tuple[int, int], end: tuple[int, int]) -> None:
    click(folded, 8)
    before = left_side(folded.wait_for())
    folded.drag(start, end)
    check_change(folded, before, "--light")
    click(folded, 8)


def test_coefficient_that_is_dragged_changes_picture_and_profile(folded: Desk) -> None:
    click(folded, 9)
    before = folded.wait_for()
    profile = slice(275, 380), slice(80, 300)
    folded.drag((63, 454), (140, 454))
    check_change(folded, left_side(before), "sigma_a = [0.")
    assert not np.array_equal(folded.grab()[profile], before[profile])
    click(folded, 9)


def test_step_button_advances_the_time(folded: Desk) -> None:
    click(folded, 10)
    for _ in range(2):
        folded.xdotool("mousemove", 67, row(11), "click", 1)
        folded.wait_for()
    assert folded.copy_command(LEFT)[-4:-2] == ["--time", "0.08"]
    click(folded, 10)


def test_next_window_has_the_size_and_open_headings_of_the_last(tmp_path: Path) -> None:
    argv = "slab", "--vertices", "300", "--method", "lambert"
    with desk(tmp_path, *argv, "--size", "640x360") as first:
        first.wait_for()
        click(first, 6, 7)
        first.xdotool("mousemove", 500, 150)
        before = first.wait_for()
        first.xdotool("key", "q")
        assert first.program.wait(20) == 0
    with desk(tmp_path, *argv) as second:
        panel = slice(0, row(11)), slice(0, PANEL_WIDTH)
        after = second.wait_for_pixels(lambda screen: screen[panel], before[panel])
        np.testing.assert_array_equal(after[:360, PANEL_WIDTH:], before[:360, PANEL_WIDTH:])
        assert "640x360" in second.xdotool("getwindowgeometry", second.window)


SCALE_TWO = """
import ctypes, subprocess
display = ctypes.CDLL("libX11.so.6").XOpenDisplay(None)  # without a client the screen would forget the setting
subprocess.run(["xrdb", "-nocpp"], input=b"Xft.dpi: 192\\n", check=True)
"""


@pytest.mark.skipif(shutil.which("xrdb") is None, reason="a display's scale is set by xrdb")
def test_display_of_scale_two_draws_pictures_and_letters_with_all_pixels(tmp_path: Path) -> None:
    argv = "slab", "--vertices", "300", "--method", "lambert", "--size", "480x300"
    with desk(tmp_path, *argv, before=SCALE_TWO) as opened:
        screen = opened.wait_for(lambda screen: bool(screen[400:600, 500:960].any()))
        opened.xdotool("mousemove", 600, 300, "key", "c")
        opened.wait_for(lambda _: "copied" in opened.printed())
        command = shlex.split(opened.printed().split("copied: ")[1].splitlines()[0])
        assert command[-2:] == ["--size", "480x600"]
        np.testing.assert_array_equal(screen[:600, 480:716], opened.render_command(command)[:, :236])
    panel = screen[:600, :480].astype(int)
    fine = np.abs(panel[::2, ::2] - panel[1::2, 1::2]).max(axis=2) > 60
    assert fine[: row(4), :120].mean() > 0.02, "letters have details of one pixel"
