"""Turn the passes of a graph into GPU commands, and time them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from wgsss.gpu import Gpu
from wgsss.passes import Dispatch, Draw, Handle, Pass


class Encoder:
    """Encode passes into one submission or, to time them on CPU adapters, submit and fence each alone.

    `times` has ms by pass name, complete after `finish`.
    """

    def __init__(self, gpu: Gpu, passes: Sequence[Pass], timed: bool) -> None:
        self.gpu, self.passes = gpu, passes
        self.times: dict[str, float] = {}
        self._stamped = timed and gpu.has_timestamps
        self._fenced = timed and not gpu.has_timestamps
        self._queries = (
            gpu.device.create_query_set(type="timestamp", count=2 * max(len(passes), 1)) if self._stamped else None
        )
        self._encoder: Any = None
        if self._fenced:
            gpu.fence()

    def encode(self, number: int, item: Pass, pipeline: Any, groups: Sequence[Any]) -> None:
        """Record pass `number`, with its pipeline and bind groups."""
        if self._encoder is None:
            self._encoder = self.gpu.device.create_command_encoder()
        stamps: dict[str, Any] = {}
        if self._stamped:
            stamps["timestamp_writes"] = {
                "query_set": self._queries,
                "beginning_of_pass_write_index": 2 * number,
                "end_of_pass_write_index": 2 * number + 1,
            }
        start = time.perf_counter()
        for handle in item.writes.values():
            if handle.version == 1 and handle.resource.layout is not None:  # buffers of the pool keep their content
                self._encoder.clear_buffer(handle.resource.gpu)
        if isinstance(item.state, Draw):
            _encode_draw(self.gpu, self._encoder, item, item.state, pipeline, groups, stamps)
        elif isinstance(item.state, Dispatch):
            _encode_dispatch(self._encoder, item, item.state, pipeline, groups, stamps)
        if self._fenced:
            self._submit()
            self.gpu.fence()
            self.times[item.name] = 1e3 * (time.perf_counter() - start)

    def _submit(self) -> None:
        self.gpu.queue.submit([self._encoder.finish()])
        self._encoder = None

    def finish(self) -> None:
        """Submit the passes that are not yet submitted, and collect the times."""
        import wgpu

        if self._encoder is None:
            return
        if not self._stamped:
            return self._submit()
        count = 2 * len(self.passes)
        resolved = self.gpu.device.create_buffer(
            size=8 * count, usage=wgpu.BufferUsage.QUERY_RESOLVE | wgpu.BufferUsage.COPY_SRC
        )
        self._encoder.resolve_query_set(self._queries, 0, count, resolved, 0)
        self._submit()
        ticks = np.frombuffer(self.gpu.queue.read_buffer(resolved), np.uint64).reshape(-1, 2)
        ms = (ticks[:, 1] - ticks[:, 0]).astype(np.float64) * (self.gpu.ns_per_tick * 1e-6)
        self.times = {p.name: float(t) for p, t in zip(self.passes, ms, strict=True)}


def _encode_dispatch(
    encoder: Any, item: Pass, state: Dispatch, pipeline: Any, groups: Sequence[Any], stamps: dict[str, Any]
) -> None:
    compute = encoder.begin_compute_pass(label=item.name, **stamps)
    compute.set_pipeline(pipeline)
    for i, group in enumerate(groups):
        compute.set_bind_group(i, group)
    compute.dispatch_workgroups(*state.groups)
    compute.end()


def _encode_draw(
    gpu: Gpu, encoder: Any, item: Pass, state: Draw, pipeline: Any, groups: Sequence[Any], stamps: dict[str, Any]
) -> None:
    def view(handle: Handle) -> Any:
        return gpu.view(handle.resource.gpu, layer=handle.layer(state.layer))

    colors = [
        {
            "view": view(item.writes[name]),
            "load_op": "load" if is_kept else "clear",
            "store_op": "store",
            "clear_value": (0, 0, 0, 0),
        }
        for name, is_kept in state.targets
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
    for i, group in enumerate(groups):
        render.set_bind_group(i, group)
    if state.indices is not None:
        render.set_index_buffer(state.indices, "uint32")
        render.draw_indexed(state.count)
    else:
        render.draw(state.count)
    render.end()
