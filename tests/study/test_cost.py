"""The cost of a frame: which frames are timed, and which memory counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from scenes import lit

from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight
from wgsss.study import cost
from wgsss.study.cost import footprint, frame_cost


class Clockwork:
    """A renderer whose frames have two passes of given durations, with a clock that they advance."""

    def __init__(self, gpu: Gpu, milliseconds: list[float]) -> None:
        self.left, self.now, self.at = milliseconds, 0.0, []
        self.graph = Graph(gpu)

    def frame(self, time_s: float) -> Any:
        ms = self.left.pop(0)
        self.now += 1e-3 * ms
        self.at.append(time_s)
        return SimpleNamespace(timings={"a": 0.25 * ms, "b": 0.75 * ms}, graph=self.graph)


@pytest.fixture
def cost_of(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> Any:
    def measure(milliseconds: list[float], fewest: int, seconds: float) -> Any:
        renderer: Any = Clockwork(gpu, milliseconds)
        monkeypatch.setattr(cost.time, "perf_counter", lambda: renderer.now)
        return frame_cost(renderer, 1.5, fewest, seconds), renderer

    return measure


def test_the_cost_is_the_median_frame_without_the_first(cost_of: Any) -> None:
    result, renderer = cost_of([900.0, 8.0, 2.0, 4.0, 6.0, 100.0], 5, 0.0)
    assert (result.frame_ms, result.quartiles, result.frames) == (6.0, (4.0, 8.0), 5)
    assert result.passes == {"a": 1.5, "b": 4.5} and not renderer.left and set(renderer.at) == {1.5}
    assert result.clock == renderer.graph.clock and result.bytes == 0


def test_the_median_of_an_even_number_is_between_two_frames(cost_of: Any) -> None:
    result, _ = cost_of([1.0, 2.0, 8.0], 2, 0.0)
    assert (result.frame_ms, result.quartiles) == (5.0, (3.5, 6.5))


@pytest.mark.parametrize(("ms", "frames"), [(100.0, 10), (900.0, 3), (1.0, cost.MOST_FRAMES)])
def test_frames_are_timed_as_long_as_time_allows(cost_of: Any, ms: float, frames: int) -> None:
    result, _ = cost_of([ms] * (cost.MOST_FRAMES + 2), 3, 0.95)
    assert result.frames == frames


def test_the_footprint_counts_a_persistent_resource_once(gpu: Gpu) -> None:
    renderer = Renderer(lit(DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0))), make_method("lambert"), (32, 24), gpu)
    graph = renderer.frame().graph
    held = {id(h): h for p in graph.ran for h in p.imports.values()}
    vertices = renderer.stage.bodies[0].vertices
    assert id(vertices) in held and footprint(graph) > graph.peak_bytes + vertices.size
    assert footprint(Graph(gpu)) == 0
