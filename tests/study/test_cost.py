"""What a frame costs: which frames count, and what of the device's memory."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from scenes import lit

from wgsss.gpu import Gpu
from wgsss.graph import Graph
from wgsss.methods import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight
from wgsss.study import cost
from wgsss.study.cost import footprint, frame_cost


class Clockwork:
    """Draws frames of two passes that take as long as it was told, by a clock that runs on meanwhile."""

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
    def measured(milliseconds: list[float], fewest: int, seconds: float) -> Any:
        made: Any = Clockwork(gpu, milliseconds)
        monkeypatch.setattr(cost.time, "perf_counter", lambda: made.now)
        return frame_cost(made, 1.5, fewest, seconds), made

    return measured


def test_the_median_frame_counts_and_the_first_does_not(cost_of: Any) -> None:
    found, made = cost_of([900.0, 8.0, 2.0, 4.0, 6.0, 100.0], 5, 0.0)
    assert (found.frame_ms, found.quartiles, found.frames) == (6.0, (4.0, 8.0), 5)
    assert found.passes == {"a": 1.5, "b": 4.5} and not made.left and set(made.at) == {1.5}
    assert found.clock == made.graph.clock and found.bytes == 0


def test_of_an_even_number_the_median_is_between_two(cost_of: Any) -> None:
    found, _ = cost_of([1.0, 2.0, 8.0], 2, 0.0)
    assert (found.frame_ms, found.quartiles) == (5.0, (3.5, 6.5))


@pytest.mark.parametrize(("ms", "frames"), [(100.0, 10), (900.0, 3), (1.0, cost.MOST)])
def test_as_many_as_there_is_time_for(cost_of: Any, ms: float, frames: int) -> None:
    found, _ = cost_of([ms] * (cost.MOST + 2), 3, 0.95)
    assert found.frames == frames


def test_footprint_counts_what_persists_once(gpu: Gpu) -> None:
    renderer = Renderer(lit(DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0))), make_method("lambert"), (32, 24), gpu)
    graph = renderer.frame().graph
    held = {id(h): h for p in graph.ran for h in p.imports.values()}
    vertices = renderer.stage.bodies[0].vertices
    assert id(vertices) in held and footprint(graph) > graph.peak_bytes + vertices.size
    assert footprint(Graph(gpu)) == 0
