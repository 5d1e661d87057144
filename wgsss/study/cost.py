"""What a frame costs: the time of its passes, and the memory that they need."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wgsss.gpu import texel_bytes
from wgsss.graph import Graph
from wgsss.rendering import Renderer

if TYPE_CHECKING:
    import wgpu

MOST_FRAMES = 200
"""Largest number of frames that are timed."""


@dataclass(frozen=True)
class Cost:
    """The cost of a frame without extra outputs."""

    frame_ms: float
    """Median over `frames` frames of the time that the passes of a frame take, by `clock`."""
    quartiles: tuple[float, float]
    frames: int
    clock: str
    passes: dict[str, float]
    """Time of each pass in the median frame, ms."""
    bytes: int
    """Size of textures and buffers, transient and persistent."""


def frame_cost(renderer: Renderer, time_s: float, fewest: int, seconds: float = 0.0) -> Cost:
    """Time as many frames as `seconds` allow, but at least `fewest`.

    The renderer must have drawn a frame before, because the first one includes compilation.
    """
    graph = renderer.frame(time_s).graph  # this frame allocates the textures that the pool lacks
    frames: list[dict[str, float]] = []
    start = time.perf_counter()
    while len(frames) < fewest or (time.perf_counter() - start < seconds and len(frames) < MOST_FRAMES):
        frames.append(renderer.frame(time_s).timings)
    frames.sort(key=lambda passes: sum(passes.values()))
    low, median, high = np.quantile([sum(passes.values()) for passes in frames], (0.25, 0.5, 0.75)).tolist()
    return Cost(median, (low, high), len(frames), graph.clock, frames[len(frames) // 2], footprint(graph))


def footprint(graph: Graph) -> int:
    """Return the bytes of textures and buffers that a graph needed when it ran.

    This counts every persistent resource once, and the largest number of transient bytes alive at the same time.
    """
    persistent: dict[int, wgpu.GPUTexture | wgpu.GPUBuffer] = {}
    for item in graph.ran:
        indices = getattr(item.state, "indices", None)
        persistent |= {id(resource): resource for resource in (*item.imports.values(), indices) if resource is not None}
    return graph.peak_bytes + graph.uploaded_bytes + sum(_bytes_of(resource) for resource in persistent.values())


def _bytes_of(resource: wgpu.GPUTexture | wgpu.GPUBuffer) -> int:
    if not hasattr(resource, "format"):
        return int(resource.size)
    mips = range(resource.mip_level_count)
    texels = sum(max(resource.width >> i, 1) * max(resource.height >> i, 1) for i in mips)
    return texels * resource.depth_or_array_layers * texel_bytes(resource.format)
