"""What the graph keeps of a declared pass, and how a pass is turned into commands and timed."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from wgsss import wgsl
from wgsss.gpu import Gpu, TextureKey
from wgsss.wgsl import Module


@dataclass(eq=False)
class Resource:
    """A texture or buffer that passes of one graph write."""

    name: str
    format: str  # of a texture; empty for a buffer
    size: tuple[int, int, int]  # width, height, layers; for a buffer (elements, 1, 1)
    layout: wgsl.Layout | None = None  # of a buffer: its array
    usage: int = 0
    version: int = 0
    drawn: set[int] = field(default_factory=set)  # layers that a raster pass has cleared and drawn
    gpu: Any = None
    key: Any = None

    @property
    def nbytes(self) -> int:
        if self.layout is not None:
            return self.size[0] * self.layout.size
        return TextureKey(self.size, self.format, 0).nbytes


@dataclass(frozen=True)
class Handle:
    """What a pass wrote: a resource as it is after that pass."""

    resource: Resource
    version: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.resource.size[:2]

    @property
    def format(self) -> str:
        return self.resource.format

    def layer(self, asked: int) -> int:
        """The layer that a pass for layer `asked` draws to: the only one, where there are no more."""
        return asked if self.resource.size[2] > 1 else 0

    def __repr__(self) -> str:
        return f"{self.resource.name}@{self.version}"


@dataclass(eq=False)
class Pass:
    """One declared pass. `uploads` holds the packed bytes of arguments that are values, by binding name."""

    name: str
    module: Module
    constants: dict[str, float]
    reads: dict[str, Handle] = field(default_factory=dict)
    writes: dict[str, Handle] = field(default_factory=dict)
    imports: dict[str, Any] = field(default_factory=dict)
    uploads: dict[str, bytes] = field(default_factory=dict)
    state: Any = None  # Draw or Dispatch


@dataclass(frozen=True)
class Draw:
    targets: tuple[tuple[str, bool], ...]  # name in `writes`, whether earlier content is kept
    keep_depth: bool  # of the depth buffer, where "depth" is in `writes`
    layer: int
    indices: Any
    count: int


@dataclass(frozen=True)
class Dispatch:
    groups: tuple[int, int, int]


@lru_cache(maxsize=256)
def view_dimension(kind: str) -> str:
    """The dimension of the view that a binding of WGSL type `kind` wants."""
    for suffix, dimension in (("cube_array", "cube-array"), ("cube", "cube"), ("2d_array", "2d-array"), ("3d", "3d")):
        if kind.split("<")[0].endswith(suffix):
            return dimension
    return "2d"


def pipeline(gpu: Gpu, item: Pass) -> tuple[Any, Any]:
    """The key of a pass's pipeline, which is its complete state, and the function that makes it."""
    module, constants = item.module, item.constants
    key = (module.source, tuple(sorted(constants.items())))
    if isinstance(item.state, Dispatch):
        return key, lambda: gpu.device.create_compute_pipeline(
            layout="auto", compute=_stage(gpu, module, "compute", constants), label=module.name
        )
    state: Draw = item.state
    formats = tuple(item.writes[name].format for name, _ in state.targets)
    depth = None
    if "depth" in item.writes:
        depth = {"format": "depth32float", "depth_compare": "less", "depth_write_enabled": True}

    def make() -> Any:
        fragment = None
        if "fragment" in module.stages:
            targets = [{"format": name} for name in formats]
            fragment = {**_stage(gpu, module, "fragment", constants), "targets": targets}
        return gpu.device.create_render_pipeline(
            layout="auto",
            vertex=_stage(gpu, module, "vertex", constants),
            primitive={"topology": "triangle-list"},
            depth_stencil=depth,
            fragment=fragment,
            label=module.name,
        )

    return (*key, formats, depth is not None), make


def _stage(gpu: Gpu, module: Module, stage: str, constants: dict[str, float]) -> dict[str, Any]:
    if stage not in module.stages:
        raise wgsl.WgslError(f"{module.name}: no @{stage} entry point")
    return {"module": gpu.shader(module), "entry_point": module.stages[stage], "constants": constants}


class Encoder:
    """Encodes passes, all into one submission or, to time them on CPU adapters, each in its own and fenced.

    `times` has ms by pass name, complete after `finish`.
    """

    def __init__(self, gpu: Gpu, passes: list[Pass], timed: bool) -> None:
        self.gpu, self.passes = gpu, passes
        self.times: dict[str, float] = {}
        self.stamps = timed and self.gpu.has_timestamps
        self.walls = timed and not self.stamps
        self.queries = (
            self.gpu.device.create_query_set(type="timestamp", count=2 * max(len(passes), 1)) if self.stamps else None
        )
        self.encoder: Any = None
        if self.walls:
            self.gpu.fence()

    def encode(self, i: int, item: Pass, bound: tuple[Any, Any]) -> None:
        """Record pass number i with its pipeline and bind group."""
        if self.encoder is None:
            self.encoder = self.gpu.device.create_command_encoder()
        stamps: dict[str, Any] = {}
        if self.stamps:
            stamps = {
                "timestamp_writes": {
                    "query_set": self.queries,
                    "beginning_of_pass_write_index": 2 * i,
                    "end_of_pass_write_index": 2 * i + 1,
                }
            }
        start = time.perf_counter()
        for handle in item.writes.values():
            if handle.version == 1 and handle.resource.layout is not None:  # pooled buffers hold what was there before
                self.encoder.clear_buffer(handle.resource.gpu)
        encode = _encode_dispatch if isinstance(item.state, Dispatch) else _encode_draw
        encode(self.gpu, self.encoder, item, *bound, stamps)
        if self.walls:
            self._submit()
            self.gpu.fence()
            self.times[item.name] = 1e3 * (time.perf_counter() - start)

    def _submit(self) -> None:
        self.gpu.queue.submit([self.encoder.finish()])
        self.encoder = None

    def finish(self) -> None:
        """Submit what is left and collect the times."""
        import wgpu

        if self.encoder is None:
            return
        if not self.stamps:
            return self._submit()
        count = 2 * len(self.passes)
        resolved = self.gpu.device.create_buffer(
            size=8 * count, usage=wgpu.BufferUsage.QUERY_RESOLVE | wgpu.BufferUsage.COPY_SRC
        )
        self.encoder.resolve_query_set(self.queries, 0, count, resolved, 0)
        self._submit()
        ticks = np.frombuffer(self.gpu.queue.read_buffer(resolved), np.uint64).reshape(-1, 2)
        ms = (ticks[:, 1] - ticks[:, 0]).astype(np.float64) * (self.gpu.ns_per_tick * 1e-6)
        self.times = {p.name: float(t) for p, t in zip(self.passes, ms, strict=True)}


def _encode_dispatch(gpu: Gpu, encoder: Any, item: Pass, pipeline: Any, group: Any, stamps: dict[str, Any]) -> None:
    compute = encoder.begin_compute_pass(label=item.name, **stamps)
    compute.set_pipeline(pipeline)
    compute.set_bind_group(0, group)
    compute.dispatch_workgroups(*item.state.groups)
    compute.end()


def _encode_draw(gpu: Gpu, encoder: Any, item: Pass, pipeline: Any, group: Any, stamps: dict[str, Any]) -> None:
    state: Draw = item.state

    def view(handle: Handle) -> Any:
        return gpu.view(handle.resource.gpu, layer=handle.layer(state.layer))

    colors = [
        {
            "view": view(item.writes[name]),
            "load_op": "load" if kept else "clear",
            "store_op": "store",
            "clear_value": (0, 0, 0, 0),
        }
        for name, kept in state.targets
    ]
    depth = None
    if "depth" in item.writes:
        depth = {
            "view": view(item.writes["depth"]),
            "depth_load_op": "load" if state.keep_depth else "clear",
            "depth_store_op": "store",
            "depth_clear_value": 1.0,
        }
    render = encoder.begin_render_pass(
        color_attachments=colors, depth_stencil_attachment=depth, label=item.name, **stamps
    )
    render.set_pipeline(pipeline)
    if group is not None:
        render.set_bind_group(0, group)
    if state.indices is not None:
        render.set_index_buffer(state.indices, "uint32")
        render.draw_indexed(state.count)
    else:
        render.draw(state.count)
    render.end()
