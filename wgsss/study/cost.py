"""What a frame costs: how long its passes take, and the memory that they need."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from wgsss.gpu import texel_bytes
from wgsss.graph import Graph
from wgsss.rendering import Renderer

MOST = 200
"""frames that are timed"""


@dataclass(frozen=True)
class Cost:
    """Of a frame without extra outputs."""

    frame_ms: float
    """the median over `frames` of the time that the passes of a frame take, by `clock`"""
    quartiles: tuple[float, float]
    frames: int
    clock: str
    passes: dict[str, float]
    """ms of each in the median frame"""
    bytes: int
    """textures and buffers, transient and persistent"""


def frame_cost(renderer: Renderer, time_s: float, fewest: int, seconds: float = 0.0) -> Cost:
    """Time as many frames as fit `seconds`, at least `fewest`. One, which compiles, should have been drawn before."""
    graph = renderer.frame(time_s).graph  # it pays for textures that the pool does not have yet
    frames: list[dict[str, float]] = []
    began = time.perf_counter()
    while len(frames) < fewest or (time.perf_counter() - began < seconds and len(frames) < MOST):
        frames.append(renderer.frame(time_s).timings)
    frames.sort(key=lambda passes: sum(passes.values()))
    low, middle, high = np.quantile([sum(passes.values()) for passes in frames], (0.25, 0.5, 0.75)).tolist()
    return Cost(middle, (low, high), len(frames), graph.clock, frames[len(frames) // 2], footprint(graph))


def footprint(graph: Graph) -> int:
    """Bytes of textures and buffers that a graph needed as it ran: what persists, and most transients live at once."""
    persistent: dict[int, Any] = {}
    for item in graph.ran:
        indices = getattr(item.state, "indices", None)
        persistent |= {id(held): held for held in (*item.imports.values(), indices) if held is not None}
    return graph.peak_bytes + graph.uploaded_bytes + sum(_nbytes(held) for held in persistent.values())


def _nbytes(held: Any) -> int:
    if not hasattr(held, "format"):
        return int(held.size)
    levels = [max(held.width >> i, 1) * max(held.height >> i, 1) for i in range(held.mip_level_count)]
    return sum(levels) * held.depth_or_array_layers * texel_bytes(held.format)
