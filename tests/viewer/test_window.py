"""Pointer and keys over the pictures, on a virtual screen: the window shows what the copied command draws."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import (
    CUT,
    DIVIDER,
    LEFT,
    RIGHT,
    SIZE_OPTION,
    WINDOW_SIZE,
    Desk,
    Pixels,
    desk,
    missing,
    pictures,
    read_png,
    right_side,
)

from wgsss.registry import METHODS

METHOD_LIST = 60, 186
"""position of the list of methods for the left side"""
FIRST_ITEM, ITEM_HEIGHT = 25, 18
"""pixels from that list to the first item that it opens, and from item to item"""

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    folder = tmp_path_factory.mktemp("desk")
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(folder, *argv, *SIZE_OPTION) as opened:
        opened.wait_for_pictures()
        yield opened


def left_side(screen: Pixels) -> Pixels:
    """Return the part of the window between panel and divider."""
    return pictures(screen)[:, : CUT - 2]


def test_both_sides_show_what_their_commands_draw(window: Desk) -> None:
    screen = window.wait_for()
    left, right = window.render(LEFT), window.render(RIGHT)
    np.testing.assert_array_equal(left_side(screen), left[:, : CUT - 2])
    np.testing.assert_array_equal(right_side(screen), right[:, CUT + 2 :])
    assert (left != right).any()


@pytest.mark.parametrize(
    ("button", "key"), [(1, ""), (3, ""), (1, "shift"), (1, "ctrl")], ids=["orbit", "pan", "pan by shift", "light"]
)
def test_drag_changes_the_picture_and_its_command(window: Desk, button: int, key: str) -> None:
    before = pictures(window.wait_for())
    window.drag(RIGHT, (RIGHT[0] + 40, RIGHT[1] + 25), button, key)
    after = window.wait_for_change(pictures, before)
    np.testing.assert_array_equal(right_side(after), window.render(RIGHT)[:, CUT + 2 :])


def test_wheel_and_keys_move_the_camera_and_r_resets_it(window: Desk) -> None:
    window.xdotool("mousemove", *RIGHT, "key", "r")
    start = pictures(window.wait_for())
    for action in (("click", 4), ("key", "plus"), ("key", "Left")):
        before = pictures(window.wait_for())
        window.xdotool(*action)
        window.wait_for_change(pictures, before)
    window.xdotool("key", "r")
    window.wait_for_pixels(pictures, start)


def test_divider_follows_the_pointer(window: Desk) -> None:
    right = window.render(RIGHT)
    window.drag((DIVIDER, 300), (DIVIDER - 100, 300))
    cut = CUT - 100
    window.wait_for_pixels(lambda screen: pictures(screen)[:, cut + 2 :], right[:, cut + 2 :])
    window.drag((DIVIDER - 100, 300), (DIVIDER, 300))
    window.wait_for()


def test_keys_show_one_side_alone_swap_sides_and_show_the_error_map(window: Desk) -> None:
    left, right = window.render(LEFT), window.render(RIGHT)
    for key, picture in (("2", left), ("3", right), ("Tab", left), ("Tab", right), ("x", left), ("x", right)):
        window.xdotool("mousemove", *RIGHT, "key", key)
        window.wait_for_pixels(pictures, picture)
    window.xdotool("key", "4")
    differs = (left.astype(int) != right).any(axis=2)
    error_map = pictures(window.wait_for_change(pictures, right))
    rows = slice(0, WINDOW_SIZE[1] - 60)  # above the legend
    assert (error_map[rows].sum(axis=2) > 60)[differs[rows]].mean() > 0.2, "the map is bright where the sides differ"
    window.xdotool("key", "1")


def test_screenshot_equals_the_picture_in_the_window(window: Desk) -> None:
    window.xdotool("mousemove", *RIGHT, "key", "3")
    picture = pictures(window.wait_for())
    folder = window.output.parent
    window.xdotool("key", "s")
    window.wait_for(lambda _: bool([*folder.glob("slab-*.exr")]))
    (file,) = folder.glob("slab-*.png")
    np.testing.assert_array_equal(picture, read_png(file))
    window.xdotool("key", "1")


def test_resized_window_draws_at_its_new_size(window: Desk) -> None:
    window.xdotool("windowsize", window.window, 600, 300)
    window.wait_for(lambda screen: not screen[320:, :].any() or not screen[:, 620:].any())
    window.xdotool("windowsize", window.window, *WINDOW_SIZE)
    window.wait_for_pixels(right_side, window.render(RIGHT)[:, CUT + 2 :])


def test_method_chosen_in_the_panel_is_drawn(window: Desk) -> None:
    before = window.render(LEFT)[:, : CUT - 2]
    x, y = METHOD_LIST
    window.xdotool("mousemove", x, y, "click", 1)
    window.wait_for()
    window.xdotool("mousemove", x, y + FIRST_ITEM + ITEM_HEIGHT * list(METHODS).index("barre11"), "click", 1)
    window.wait_for_change(left_side, before)
    command = window.copy_command(LEFT)
    assert command[command.index("--method") + 1] == "barre11"
    window.wait_for_pixels(left_side, window.render(LEFT)[:, : CUT - 2])


def test_q_closes_the_window_and_its_settings_are_saved(tmp_path: Path) -> None:
    with desk(tmp_path, "slab", "--vertices", "300", "--method", "lambert", "--size", "500x300") as opened:
        opened.wait_for()
        opened.xdotool("mousemove", 400, 150, "key", "q")
        assert opened.program.wait(20) == 0
        assert "rror" not in opened.printed()
    settings = json.loads((tmp_path / "wgsss" / "viewer.json").read_text())
    assert settings == {"size": [500, 300], "open": ["left", "passes", "right"]}
