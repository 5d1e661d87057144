"""When the painter draws, at which resolution, and which pictures stay when drawing fails."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from wgsss import wgsl
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import load_scene
from wgsss.viewer import manipulation
from wgsss.viewer.painter import AdaptiveResolution, Painter
from wgsss.viewer.pictures import View
from wgsss.viewer.reload import Shaders

SIZE = (48, 32)


VIEW = View(load_scene("slab", vertices=300), (make_method("lambert"), make_method("screen+none", {"taps": 9})), SIZE)


@pytest.fixture
def painter(gpu: Gpu) -> Painter:
    return Painter(gpu)


def turned(view: View) -> View:
    """Return the view from another side."""
    return replace(view, scene=replace(view.scene, camera=manipulation.orbit(view.scene.camera, 0.1, 0.05)))


def with_left_method(view: View, name: str) -> View:
    return replace(view, methods=(make_method(name), view.methods[1]))


def right_pixels(painter: Painter) -> Any:
    """Read back the picture of the right side."""
    assert painter.drawing is not None and painter.sides[1] is not None and painter.sides[1].display is not None
    return painter.drawing.graph.read(painter.sides[1].display)


def test_painter_draws_coarsely_while_things_move_and_in_full_afterwards(
    painter: Painter, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    painter.resolution = AdaptiveResolution(budget_s=0.0, step=2)  # no picture fits the budget
    assert painter.paint(VIEW) and painter.scale == 1.0, "the first picture is in full"
    assert painter.is_done(VIEW) and not painter.paint(VIEW)
    view = turned(VIEW)
    assert not painter.is_done(view)
    assert painter.paint(view) and right_pixels(painter).shape[:2] == (8, 12)
    assert not painter.paint(view), "nothing has changed"
    now += 0.2
    view = turned(view)
    assert painter.paint(view) and painter.scale < 1.0
    now += 0.3
    assert painter.paint(view) and painter.is_done(view)
    offscreen = Renderer(view.scene, view.methods[1], SIZE, painter.gpu).frame().display
    assert right_pixels(painter).tobytes() == offscreen.tobytes()


def test_picture_in_full_is_measured_once_nothing_moves(painter: Painter, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    painter.resolution = AdaptiveResolution(budget_s=1e9)
    painter.paint(VIEW)
    view = turned(VIEW)
    assert painter.paint(view) and painter.scale == 1.0 and painter.measurement is None
    assert not painter.is_done(view)
    now += 0.3
    assert painter.paint(view) and painter.measurement is not None and painter.is_done(view)


def test_side_takes_the_time_of_its_own_passes_and_of_shared_ones(painter: Painter) -> None:
    assert painter.pass_times(0) == {}, "nothing is drawn yet"
    painter.paint(VIEW)
    assert painter.drawing is not None
    left, right = painter.pass_times(0), painter.pass_times(1)
    assert left.keys() & right.keys() and left.keys() ^ right.keys()
    assert painter.frame_ms(0) == sum(left.values()) > 0.0
    painter.drawing.graph.times.clear()
    assert painter.frame_ms(0) == 0.0, "passes that were not timed"
    painter.sides[0] = None
    assert painter.pass_times(0) == {}, "a reference without an estimate"


def test_pool_keeps_only_textures_of_the_present_methods(painter: Painter) -> None:
    def pooled(view: View) -> int:
        assert painter.paint(view)
        return sum(map(len, painter.gpu._free.values()))

    painter.gpu.trim()
    few = pooled(VIEW)
    many = pooled(with_left_method(VIEW, "texture+none"))
    assert many > few
    assert pooled(VIEW) < many


def test_device_objects_do_not_accumulate_over_frames_and_methods(painter: Painter) -> None:
    gpu, view = painter.gpu, VIEW
    painter.resolution = AdaptiveResolution(budget_s=1e9)

    def count_after_all_methods() -> list[int]:
        nonlocal view
        for name in ("texture+none", "screen+none", "lambert"):
            view = with_left_method(view, name)
            for _ in range(3):
                view = turned(view)
                assert painter.paint(view)
        stage = painter.renderer.stage(view.scene, view.methods)
        return [len(x) for x in (gpu._pipelines, gpu._shaders, gpu._views, stage._shared)]

    count_after_all_methods()
    assert count_after_all_methods() == count_after_all_methods()


@pytest.fixture
def module(painter: Painter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a shader in a copy of the folder, from which the painter draws."""
    shutil.copytree(wgsl.ROOT, tmp_path / "wgsl")
    monkeypatch.setattr(wgsl.load, "__defaults__", (tmp_path / "wgsl",))
    painter.shaders = Shaders(tmp_path / "wgsl")
    yield tmp_path / "wgsl" / "frame" / "tone_map.wgsl"
    for key in [key for key in wgsl.loaded if key[1] == tmp_path / "wgsl"]:
        del wgsl.loaded[key]


def save(path: Path, text: str) -> None:
    path.write_text(text)
    os.utime(path, ns=(time.time_ns(), time.time_ns()))


BROKEN = {
    "syntax": ("fn aces(", "fn aces((", r"tone_map\.wgsl:\d+:\d+"),
    "entry point": ("@fragment", "", "tone_map.*no entry point uses it"),
    "other entry point": (
        "@vertex\nfn vs(@builtin(vertex_index) i: u32) -> @builtin(position)",
        "fn vs(i: u32) ->",
        "no @vertex",
    ),
    "binding": ("radiance:", "brightness:", "unknown: radiance"),
    "unused binding": ("textureLoad(radiance", "vec4f(1.0);//", "tone_map"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_broken_shader_is_reported_while_the_last_good_one_stays_in_use(
    painter: Painter, module: Path, fault: str
) -> None:
    good, bad, message = BROKEN[fault]
    text, view = module.read_text(), VIEW
    assert good in text
    assert painter.paint(view) and not painter.error_message
    before = right_pixels(painter).tobytes()
    save(module, text.replace(good, bad))
    assert painter.reload_shaders()
    assert not painter.paint(view) and re.search(message, painter.error_message)
    assert right_pixels(painter).tobytes() == before
    assert not painter.is_done(view), "it is to be drawn again with the last good shader"
    assert painter.paint(view) and painter.is_done(view) and right_pixels(painter).tobytes() == before
    view = turned(view)
    assert painter.paint(view) and right_pixels(painter).tobytes() != before and painter.error_message
    save(module, text.replace("vec3f(1.0)), sample.a", "vec3f(0.0)) + 0.5, 1.0"))
    assert painter.reload_shaders() and painter.paint(view) and not painter.error_message
    assert set(right_pixels(painter)[..., :3].flat) <= {187, 188}, "half of white, encoded"


def test_failure_of_a_method_is_reported_until_a_view_can_be_drawn(
    painter: Painter, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    view = VIEW
    assert painter.paint(view)
    before = right_pixels(painter).tobytes()
    lambert = type(view.methods[0])
    for error, message in ((InputError("not on slabs"), "not on slabs"), (KeyError("slab"), "KeyError('slab')")):
        with monkeypatch.context() as patch:
            patch.setattr(lambert, "passes", Mock(side_effect=error))
            view = turned(view)
            assert not painter.paint(view)
        assert painter.error_message == message and right_pixels(painter).tobytes() == before
    assert "Traceback" in capsys.readouterr().err, "an unexpected error is printed with its traceback"
    view = turned(view)
    assert painter.paint(view) and not painter.error_message
