"""Every built-in scene by every method, against the picture in goldens/ that was looked at and found right.

A golden catches change, it does not measure accuracy. On the adapter, driver and kind of processor that drew it, at
most 0.1 % of pixels differ by more than 1 of 255 in any channel; on another, the pictures look alike by FLIP. What
fails is left in out/goldens/: what was drawn, the difference, the golden.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import HAS_FLIP, ROOT, needs_flip
from PIL import Image as Picture

from wgsss.bake.atlas import library
from wgsss.bake.sam import SELECTIONS
from wgsss.gpu import Gpu
from wgsss.output import save
from wgsss.registry import METHODS, make_method, methods_for
from wgsss.rendering import Image, Renderer
from wgsss.scene import Scene, load_scene
from wgsss.scene.builtin import SCENES

GOLDENS, FAILED = ROOT / "goldens", ROOT / "out" / "goldens"

SIZE = (128, 128)
VERTICES = {"milk": 5000, "statue": 5000}  # the least that they can have; 2000 for the others
KNOBS: dict[str, dict[str, Any]] = {
    "deon07": {"map_size": 256},
    "jimenez08": {"map_size": 256},
    "jensen02": {"spacing": 6.0},
    "skin-patch jensen02": {"spacing": 0.5},  # mean free paths are long
    "organ jensen02": {"spacing": 0.5},
    "crowd jensen02": {"spacing": 20.0},  # heads are large beside what skin scatters over
    "sam": {"surface": "screen"},
    "oat06": {"map_size": 256},
}
# Other ways of a method, by name and in some scenes: thin and moving.
VARIANTS = {f"sam-{select}": ("sam", {"select": select, "surface": "screen"}) for select in SELECTIONS}
UNWRAPPED = {"deon07", "jimenez08", "oat06"}  # methods whose pictures depend on the atlas, which xatlas made
# Skin is known by its profile only, which methods of layers refuse.
DRAWN = [
    *(
        (scene, method)
        for scene in SCENES
        for method in methods_for(load_scene(scene, vertices=VERTICES.get(scene, 2000)))
    ),
    *product(("ear", "wave"), VARIANTS),
]
# On the screen, light spreads over less than a pixel, or nothing shines through what is thick.
BELOW_PIXELS = {*(("crowd", method) for method in ("barre11", "jensen02", "jimenez15", "sam")), ("sphere", "barre11")}
TIME_S = 0.7  # what moves is not at rest

DRAWN_BY = "wgsss.adapter"  # the label of a golden that tells what drew it
# What is baked depends on the instructions that numpy finds: of two senders that are as good, rounding chooses one.
PROCESSOR = ", ".join(np.show_config(mode="dicts")["SIMD Extensions"]["found"])
MOST_OFF, MOST_PIXELS_OFF = 1, 0.001
# The mean over the object. Rounding differs between drivers; what a method does to Lambert's picture is more.
MOST_FLIP = 0.01

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Golden:
    pixels: Pixels  # (H, W, 4)
    drawn_by: str


def golden_path(scene: str, method: str) -> Path:
    return GOLDENS / scene / f"{method}.png"


def read(path: Path) -> Golden:
    with Picture.open(path) as picture:
        return Golden(np.asarray(picture.convert("RGBA")), str(picture.info.get(DRAWN_BY, "")))


@lru_cache(maxsize=1)
def load(scene: str) -> Scene:
    return load_scene(scene, vertices=VERTICES.get(scene, 2000))


def draw(gpu: Gpu, scene: str, name: str) -> Image:
    method, knobs = VARIANTS.get(name, (name, KNOBS.get(f"{scene} {name}", KNOBS.get(name))))
    renderer = Renderer(load(scene), make_method(method, knobs), SIZE, gpu)
    image = renderer.frame(TIME_S, timed=False)
    return replace(image, metadata={**image.metadata, "adapter": f"{gpu.name}, {PROCESSOR}"})


def share_off(got: Pixels, golden: Pixels) -> float:
    """The share of pixels with a channel further off than one step."""
    return float((np.abs(got.astype(int) - golden) > MOST_OFF).any(axis=2).mean())


def over_black(pixels: Pixels) -> npt.NDArray[np.float32]:
    return (pixels[..., :3] / 255.0 * (pixels[..., 3:] / 255.0)).astype(np.float32)


def flip(got: Pixels, golden: Pixels) -> float:
    """The mean FLIP error over the pixels where either shows something."""
    import flip_evaluator

    error, _, _ = flip_evaluator.evaluate(over_black(golden), over_black(got), "LDR", applyMagma=False)
    seen = (got[..., 3] > 0) | (golden[..., 3] > 0)
    return float(error[..., 0][seen].mean())


def show(got: Pixels, golden: Pixels, path: Path) -> None:
    """Got, difference and golden side by side. The fourth root makes a difference of one step visible."""
    difference = np.abs(over_black(got) - over_black(golden)) ** 0.25
    panels = np.concatenate([over_black(got), difference, over_black(golden)], axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    Picture.fromarray(np.round(panels * 255).astype(np.uint8)).save(path)


@pytest.mark.parametrize(("scene", "method"), DRAWN)
def test_golden(gpu: Gpu, request: pytest.FixtureRequest, scene: str, method: str) -> None:
    if method in UNWRAPPED and library() != "xatlas":
        pytest.skip(f"the golden was drawn with an atlas by xatlas, and here {library()} makes them")
    path = golden_path(scene, method)
    image = draw(gpu, scene, method)
    if request.config.getoption("--update-goldens"):
        path.parent.mkdir(parents=True, exist_ok=True)
        save(image, path)
        pytest.skip(f"wrote {path.relative_to(ROOT)}: look at it")
    if not path.is_file():
        pytest.fail(f"{path.relative_to(ROOT)} is missing: write it with `pytest --update-goldens`, and look at it")

    golden, failed = read(path), FAILED / f"{scene}-{method}.png"
    assert image.display.shape == golden.pixels.shape
    drawn_by = image.metadata["adapter"]
    same = golden.drawn_by == drawn_by
    off = share_off(image.display, golden.pixels)
    figures = f"{off:.3%} of pixels off by more than {MOST_OFF}/255"
    if not (same or HAS_FLIP):
        pytest.skip(f"{figures}: flip-evaluator is not installed, which compares what other devices draw")
    flipped = flip(image.display, golden.pixels) if HAS_FLIP else math.nan
    figures += f", FLIP {flipped:.5f}"
    figures += f" ({'the same device' if same else f'drawn by {golden.drawn_by}, not {drawn_by}'})"
    print(figures)
    if off <= MOST_PIXELS_OFF if same else flipped <= MOST_FLIP:
        failed.unlink(missing_ok=True)
        return
    show(image.display, golden.pixels, failed)
    pytest.fail(f"{figures}: see {failed} (drawn, difference, golden)")


def test_there_is_no_golden_that_nothing_draws() -> None:
    wanted = {golden_path(*drawn) for drawn in DRAWN}
    found = {path for path in GOLDENS.rglob("*") if path.is_file()}
    assert sorted(map(str, found - wanted)) == []


@needs_flip
def test_the_tolerance_for_other_drivers_is_smaller_than_the_effect_of_any_method() -> None:
    for scene, method in DRAWN:
        if method not in METHODS or method == "lambert":
            continue
        plain, other = (read(golden_path(scene, name)).pixels for name in ("lambert", method))
        assert flip(other, plain) > MOST_FLIP or (scene, method) in BELOW_PIXELS, f"{scene} {method}"


def test_one_step_passes_and_two_do_not() -> None:
    random = np.random.default_rng(3)
    golden = random.integers(5, 250, (100, 100, 4)).astype(np.uint8)
    assert share_off(golden + np.uint8(1), golden) == 0
    got = golden.copy()
    got[:10, 1, 2] += 2
    assert share_off(got, golden) == MOST_PIXELS_OFF
    got[10, 1, 3] -= 2
    assert share_off(got, golden) > MOST_PIXELS_OFF
