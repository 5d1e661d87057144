"""The window under pointer and keys, on a virtual screen: what it shows is what the offscreen command draws."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from desk import CUT, DIVIDER, LEFT, RIGHT, SMALL, WINDOW, Desk, desk, missing, pictures, shown

from wgsss.registry import METHODS

METHOD = 60, 186
"""the left side's method in the panel; of what it opens, the first is 25 pixels below, and each 18 below another"""

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    folder = tmp_path_factory.mktemp("desk")
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(folder, *argv, *SMALL) as opened:
        opened.settled(lambda pixels: bool(pictures(pixels).any()))
        yield opened


def test_both_sides_are_what_the_commands_draw(window: Desk) -> None:
    seen = pictures(window.settled())
    left, right = window.drawn(LEFT), window.drawn(RIGHT)
    np.testing.assert_array_equal(seen[:, : CUT - 2], left[:, : CUT - 2])
    np.testing.assert_array_equal(seen[:, CUT + 2 :], right[:, CUT + 2 :])
    assert (left != right).any()


@pytest.mark.parametrize(
    ("button", "key"), [(1, ""), (3, ""), (1, "shift"), (1, "ctrl")], ids=["orbit", "pan", "pan by shift", "light"]
)
def test_a_drag_moves_what_it_holds_and_the_command_follows(window: Desk, button: int, key: str) -> None:
    before = pictures(window.settled())
    window.drag(RIGHT, (RIGHT[0] + 40, RIGHT[1] + 25), button, key)
    after = pictures(window.settled(lambda pixels: not np.array_equal(pictures(pixels), before)))
    wanted = window.drawn(RIGHT)
    np.testing.assert_array_equal(after[:, CUT + 2 :], wanted[:, CUT + 2 :])


def test_wheel_and_keys_zoom_and_reset(window: Desk) -> None:
    window.do("mousemove", *RIGHT, "key", "r")
    start = pictures(window.settled())
    for act in (("click", 4), ("key", "plus"), ("key", "Left")):
        before = pictures(window.settled())
        window.do(*act)
        window.settled(lambda pixels, before=before: not np.array_equal(pictures(pixels), before))  # type: ignore[misc]
    window.do("key", "r")
    window.settled(lambda pixels: bool(np.array_equal(pictures(pixels), start)))


def test_the_divider_follows_the_pointer(window: Desk) -> None:
    right = window.drawn(RIGHT)
    window.drag((DIVIDER, 300), (DIVIDER - 100, 300))
    cut = CUT - 100
    window.settled(lambda pixels: np.array_equal(pictures(pixels)[:, cut + 2 :], right[:, cut + 2 :]))
    window.drag((DIVIDER - 100, 300), (DIVIDER, 300))
    window.settled()


def test_one_side_alone_swapped_and_the_error_between_them(window: Desk) -> None:
    left, right = window.drawn(LEFT), window.drawn(RIGHT)
    for key, wanted in (("2", left), ("3", right), ("Tab", left), ("Tab", right), ("x", left), ("x", right)):
        window.do("mousemove", *RIGHT, "key", key)
        window.settled(lambda pixels, wanted=wanted: np.array_equal(pictures(pixels), wanted))  # type: ignore[misc]
    window.do("key", "4")
    differ = (left.astype(int) != right).any(axis=2)
    seen = pictures(window.settled(lambda pixels: not np.array_equal(pictures(pixels), right)))
    rows = slice(0, WINDOW[1] - 60)  # above the legend
    assert (seen[rows].sum(axis=2) > 60)[differ[rows]].mean() > 0.2, "where they differ it is bright"
    window.do("key", "1")


def test_a_screenshot_is_what_is_shown(window: Desk) -> None:
    window.do("mousemove", *RIGHT, "key", "3")
    seen = pictures(window.settled())
    said = window.output.parent
    window.do("key", "s")
    window.settled(lambda _: bool([*said.glob("slab-*.exr")]))
    (file,) = said.glob("slab-*.png")
    np.testing.assert_array_equal(seen, shown(file))
    window.do("key", "1")


def test_a_resize_draws_at_the_new_size(window: Desk) -> None:
    window.do("windowsize", window.window, 600, 300)
    window.settled(lambda pixels: not pixels[320:, :].any() or not pixels[:, 620:].any())
    window.do("windowsize", window.window, *WINDOW)
    right = window.drawn(RIGHT)
    cut = CUT + 2
    window.settled(lambda pixels: np.array_equal(pictures(pixels)[:, cut:], right[:, cut:]))


def test_a_method_is_chosen_in_the_panel(window: Desk) -> None:
    before = window.drawn(LEFT)
    window.do("mousemove", *METHOD, "click", 1)
    window.settled()
    window.do("mousemove", METHOD[0], METHOD[1] + 25 + 18 * list(METHODS).index("barre11"), "click", 1)
    window.settled(lambda screen: not np.array_equal(pictures(screen)[:, : CUT - 2], before[:, : CUT - 2]))
    command = window.copied(LEFT)
    assert command[command.index("--method") + 1] == "barre11"
    chosen = window.drawn(LEFT)
    window.settled(lambda screen: np.array_equal(pictures(screen)[:, : CUT - 2], chosen[:, : CUT - 2]))


def test_q_closes_it(tmp_path: Path) -> None:
    with desk(tmp_path, "slab", "--vertices", "300", "--method", "lambert", "--size", "500x300") as opened:
        opened.settled()
        opened.do("mousemove", 400, 150, "key", "q")
        assert opened.program.wait(20) == 0
        assert "rror" not in opened.said()
    kept = json.loads((tmp_path / "wgsss" / "viewer.json").read_text())
    assert kept == {"size": [500, 300], "open": ["left", "passes", "right"]}
