"""What is drawn, when and how finely; and what is left where that fails."""

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
from wgsss.viewer import controls
from wgsss.viewer.pace import Pace
from wgsss.viewer.painter import Painter
from wgsss.viewer.reload import Shaders
from wgsss.viewer.state import Source, State

SIZE = (48, 32)


@pytest.fixture
def state() -> State:
    return State.open(Source("slab", vertices=300), [make_method("lambert"), make_method("screen+none", {"taps": 9})])


@pytest.fixture
def painter(gpu: Gpu) -> Painter:
    return Painter(gpu)


def turn(state: State) -> None:
    state.scene = replace(state.scene, camera=controls.orbit(state.camera, 0.1, 0.05))


def right(painter: Painter) -> Any:
    assert painter.drawing is not None and painter.sides[1] is not None and painter.sides[1].display is not None
    return painter.drawing.graph.read(painter.sides[1].display)


def test_it_is_coarse_while_things_move_and_in_full_once_they_are_still(
    painter: Painter, state: State, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    painter.pace = Pace(budget_s=0.0, step=2)  # and so it stays
    assert painter.paint(state, SIZE) and painter.scale == 1.0, "the first picture is in full"
    assert painter.is_done(state, SIZE) and not painter.paint(state, SIZE)
    turn(state)
    assert not painter.is_done(state, SIZE)
    assert painter.paint(state, SIZE) and right(painter).shape[:2] == (8, 12)
    assert not painter.paint(state, SIZE), "nothing has changed"
    now += 0.2
    turn(state)
    assert painter.paint(state, SIZE) and painter.scale < 1.0
    now += 0.3
    assert painter.paint(state, SIZE) and painter.is_done(state, SIZE)
    wanted = Renderer(state.scene, state.methods[1], SIZE, painter.gpu).frame().display
    assert right(painter).tobytes() == wanted.tobytes()


def test_what_moved_in_full_is_measured_once_it_is_still(
    painter: Painter, state: State, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    painter.pace = Pace(budget_s=1e9)
    painter.paint(state, SIZE)
    turn(state)
    assert painter.paint(state, SIZE) and painter.scale == 1.0 and painter.measured is None
    assert not painter.is_done(state, SIZE)
    now += 0.3
    assert painter.paint(state, SIZE) and painter.measured is not None and painter.is_done(state, SIZE)


def test_the_pool_is_of_what_is_shown(painter: Painter, state: State) -> None:
    def pooled() -> int:
        assert painter.paint(state, SIZE)
        return sum(map(len, painter.gpu._free.values()))

    painter.gpu.trim()
    few = pooled()
    state.methods[0] = make_method("texture+none")
    many = pooled()
    assert many > few
    state.methods[0] = make_method("lambert")
    assert pooled() < many


def test_what_the_device_holds_does_not_grow_with_frames_and_switches(painter: Painter, state: State) -> None:
    gpu = painter.gpu
    painter.pace = Pace(budget_s=1e9)

    def held_after_a_round() -> list[int]:
        for name in ("texture+none", "screen+none", "lambert"):
            state.methods[0] = make_method(name)
            for _ in range(3):
                turn(state)
                assert painter.paint(state, SIZE)
        stage = painter.easel.stage(state.scene, state.methods)
        return [len(x) for x in (gpu._pipelines, gpu._shaders, gpu._views, stage._shared)]

    held_after_a_round()
    assert held_after_a_round() == held_after_a_round()


@pytest.fixture
def module(painter: Painter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A shader that may be broken."""
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
    "entry point": ("@fragment", "", "tone_map: draws nothing"),
    "other entry point": (
        "@vertex\nfn vs(@builtin(vertex_index) i: u32) -> @builtin(position)",
        "fn vs(i: u32) ->",
        "no @vertex",
    ),
    "binding": ("radiance:", "brightness:", "unknown: radiance"),
    "unused binding": ("textureLoad(radiance", "vec4f(1.0);//", "tone_map"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_shader_that_breaks_is_said_until_it_is_mended_and_the_last_goes_on(
    painter: Painter, state: State, module: Path, fault: str
) -> None:
    good, bad, said = BROKEN[fault]
    text = module.read_text()
    assert good in text
    assert painter.paint(state, SIZE) and not painter.fault
    before = right(painter).tobytes()
    save(module, text.replace(good, bad))
    assert painter.reread()
    assert not painter.paint(state, SIZE) and re.search(said, painter.fault)
    assert right(painter).tobytes() == before
    assert not painter.is_done(state, SIZE), "what is drawn is drawn by the last that was good"
    assert painter.paint(state, SIZE) and painter.is_done(state, SIZE) and right(painter).tobytes() == before
    turn(state)
    assert painter.paint(state, SIZE) and right(painter).tobytes() != before and painter.fault
    save(module, text.replace("vec3f(1.0)), sample.a", "vec3f(0.0)) + 0.5, 1.0"))
    assert painter.reread() and painter.paint(state, SIZE) and not painter.fault
    assert set(right(painter)[..., :3].flat) <= {187, 188}, "half of white, encoded"


def test_what_a_method_cannot_draw_is_said_until_another_is_chosen(
    painter: Painter, state: State, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert painter.paint(state, SIZE)
    before = right(painter).tobytes()
    lambert = type(state.methods[0])
    for error, said in ((InputError("not on slabs"), "not on slabs"), (KeyError("slab"), "KeyError('slab')")):
        with monkeypatch.context() as patch:
            patch.setattr(lambert, "passes", Mock(side_effect=error))
            turn(state)
            assert not painter.paint(state, SIZE)
        assert painter.fault == said and right(painter).tobytes() == before
    assert "Traceback" in capsys.readouterr().err, "what nobody foresaw is told in full"
    turn(state)
    assert painter.paint(state, SIZE) and not painter.fault
