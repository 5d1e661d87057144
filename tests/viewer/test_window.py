"""The window under pointer and keys, on a virtual screen: what it shows is what the offscreen command draws."""

from __future__ import annotations

import json
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
DIVIDER = PANEL_WIDTH + (WINDOW[0] - PANEL_WIDTH) // 2
MIDDLE = DIVIDER + 60, 200

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"a window needs {missing()}")


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    folder = tmp_path_factory.mktemp("desk")
    argv = ["slab", "--vertices", "300", "--method", "lambert", "--against", "screen+none:taps=9"]
    with desk(folder, *argv, "--size", f"{WINDOW[0]}x{WINDOW[1]}") as opened:
        opened.settled(lambda pixels: bool(pictures(pixels).any()))
        yield opened


def pictures(screen: Pixels) -> Pixels:
    """What the window shows beside its panel."""
    return screen[: WINDOW[1], PANEL_WIDTH : WINDOW[0]]


def drawn(window: Desk, folder: Path, at: tuple[int, int]) -> Pixels:
    """What the command draws that the window copies for the side under a point."""
    said = len(window.said())
    window.do("mousemove", *at, "key", "c")
    window.settled(lambda _: "copied: " in window.said()[said:])
    command = shlex.split(window.said()[said:].split("copied: ")[1].splitlines()[0])
    file = folder / "drawn.png"
    assert main([*command[1:], "-o", str(file)]) == 0
    with Picture.open(file) as picture:
        rgba = np.asarray(picture.convert("RGBA"))
    return rgba[..., :3] * (rgba[..., 3:] > 0)


def test_both_sides_are_what_the_commands_draw(window: Desk, tmp_path: Path) -> None:
    seen = pictures(window.settled())
    cut = DIVIDER - PANEL_WIDTH
    left, right = drawn(window, tmp_path, (DIVIDER - 60, 200)), drawn(window, tmp_path, MIDDLE)
    np.testing.assert_array_equal(seen[:, : cut - 2], left[:, : cut - 2])
    np.testing.assert_array_equal(seen[:, cut + 2 :], right[:, cut + 2 :])
    assert (left != right).any()


@pytest.mark.parametrize(
    ("button", "key"), [(1, ""), (3, ""), (1, "shift"), (1, "ctrl")], ids=["orbit", "pan", "pan by shift", "light"]
)
def test_a_drag_moves_what_it_holds_and_the_command_follows(
    window: Desk, tmp_path: Path, button: int, key: str
) -> None:
    before = pictures(window.settled())
    window.drag(MIDDLE, (MIDDLE[0] + 40, MIDDLE[1] + 25), button, key)
    after = pictures(window.settled(lambda pixels: not np.array_equal(pictures(pixels), before)))
    wanted = drawn(window, tmp_path, MIDDLE)
    np.testing.assert_array_equal(after[:, DIVIDER - PANEL_WIDTH + 2 :], wanted[:, DIVIDER - PANEL_WIDTH + 2 :])


def test_wheel_and_keys_zoom_and_reset(window: Desk) -> None:
    window.do("mousemove", *MIDDLE, "key", "r")
    start = pictures(window.settled())
    for act in (("click", 4), ("key", "plus"), ("key", "Left")):
        before = pictures(window.settled())
        window.do(*act)
        window.settled(lambda pixels, before=before: not np.array_equal(pictures(pixels), before))  # type: ignore[misc]
    window.do("key", "r")
    window.settled(lambda pixels: bool(np.array_equal(pictures(pixels), start)))


def test_the_divider_follows_the_pointer(window: Desk, tmp_path: Path) -> None:
    right = drawn(window, tmp_path, MIDDLE)
    window.drag((DIVIDER, 300), (DIVIDER - 100, 300))
    cut = DIVIDER - 100 - PANEL_WIDTH
    window.settled(lambda pixels: np.array_equal(pictures(pixels)[:, cut + 2 :], right[:, cut + 2 :]))
    window.drag((DIVIDER - 100, 300), (DIVIDER, 300))
    window.settled()


def test_one_side_alone_swapped_and_the_error_between_them(window: Desk, tmp_path: Path) -> None:
    left, right = drawn(window, tmp_path, (DIVIDER - 60, 200)), drawn(window, tmp_path, MIDDLE)
    for key, wanted in (("2", left), ("3", right), ("Tab", left), ("Tab", right), ("x", left), ("x", right)):
        window.do("mousemove", *MIDDLE, "key", key)
        window.settled(lambda pixels, wanted=wanted: np.array_equal(pictures(pixels), wanted))  # type: ignore[misc]
    window.do("key", "4")
    differ = (left.astype(int) != right).any(axis=2)
    shown = pictures(window.settled(lambda pixels: not np.array_equal(pictures(pixels), right)))
    rows = slice(0, WINDOW[1] - 60)  # above the legend
    assert (shown[rows].sum(axis=2) > 60)[differ[rows]].mean() > 0.2, "where they differ it is bright"
    window.do("key", "1")


def test_a_screenshot_is_what_is_shown(window: Desk) -> None:
    window.do("mousemove", *MIDDLE, "key", "3")
    shown = pictures(window.settled())
    said = window.output.parent
    window.do("key", "s")
    window.settled(lambda _: bool([*said.glob("slab-*.exr")]))
    (file,) = said.glob("slab-*.png")
    with Picture.open(file) as picture:
        rgba = np.asarray(picture.convert("RGBA"))
    np.testing.assert_array_equal(shown, rgba[..., :3] * (rgba[..., 3:] > 0))
    window.do("key", "1")


def test_a_resize_draws_at_the_new_size(window: Desk, tmp_path: Path) -> None:
    (found,) = window.do("search", "--name", "wgsss").splitlines()[:1]
    window.do("windowsize", found, 600, 300)
    window.settled(lambda pixels: not pixels[320:, :].any() or not pixels[:, 620:].any())
    window.do("windowsize", found, *WINDOW)
    right = drawn(window, tmp_path, MIDDLE)
    cut = DIVIDER - PANEL_WIDTH + 2
    window.settled(lambda pixels: np.array_equal(pictures(pixels)[:, cut:], right[:, cut:]))


def test_q_closes_it(tmp_path: Path) -> None:
    with desk(tmp_path, "slab", "--vertices", "300", "--method", "lambert", "--size", "500x300") as opened:
        opened.settled()
        opened.do("mousemove", 400, 150, "key", "q")
        assert opened.program.wait(20) == 0
        assert "rror" not in opened.said()
    kept = json.loads((tmp_path / "wgsss" / "viewer.json").read_text())
    assert kept == {"size": [500, 300], "open": ["left", "passes", "right"]}
