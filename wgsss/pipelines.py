"""Pipelines and bind groups of declared passes, and the buffer with the values that passes bind."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from typing import Any

from wgsss import wgsl
from wgsss.gpu import Buffer, Gpu, check_size
from wgsss.passes import Draw, Pass
from wgsss.wgsl import Module

_ALIGNMENT = 256  # the largest that WebGPU allows as the alignment of uniform and storage bindings


class Uploads:
    """One buffer, from the pool, with all values that some passes bind; equal values are in it once."""

    def __init__(self, gpu: Gpu, passes: Sequence[Pass]) -> None:
        import wgpu

        self._gpu = gpu
        self._buffer: Buffer | None = None
        self.nbytes = 0
        offset_of: dict[bytes, int] = {}
        self._offsets: dict[tuple[Pass, str], int] = {}
        chunks = []
        for item in passes:
            for name, data in item.uploads.items():
                if data not in offset_of:
                    offset_of[data] = self.nbytes
                    chunks.append(data + bytes(-len(data) % _ALIGNMENT))
                    self.nbytes += len(chunks[-1])
                self._offsets[item, name] = offset_of[data]
        if chunks:
            usage = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_DST
            self._buffer, self._key = gpu.acquire_buffer(self.nbytes, usage)
            gpu.queue.write_buffer(self._buffer, 0, b"".join(chunks))

    def binding(self, item: Pass, name: str) -> dict[str, Any]:
        """Return the part of the buffer that holds one binding's value."""
        return {"buffer": self._buffer, "offset": self._offsets[item, name], "size": len(item.uploads[name])}

    def release(self) -> None:
        """Give the buffer back to the pool."""
        if self._buffer is not None:
            self._gpu.release(self._key, self._buffer)


def bind(gpu: Gpu, item: Pass, uploads: Uploads) -> tuple[Any, Sequence[Any]]:
    """Return the pipeline of a pass whose resources are allocated, and its bind groups."""
    used = item.module.used
    groups: list[list[dict[str, Any]]] = [[] for _ in range(max((b.group + 1 for b in used.values()), default=0))]
    for name, binding in used.items():
        resource: Any
        if binding.space == "sampler":
            resource = gpu.sampler(name)
        elif name in item.uploads:
            resource = uploads.binding(item, name)
        else:
            handle = item.reads.get(name) or item.writes.get(name)
            resource = handle.resource.gpu if handle else item.imports[name]
            if binding.space in ("texture", "storage_texture"):
                resource = gpu.view(resource, _view_dimension(binding.type))
            elif handle:
                resource = {"buffer": resource, "offset": 0, "size": handle.resource.nbytes}
            if binding.space == "storage":
                size = handle.resource.nbytes if handle else resource.size
                check_size(size, gpu.most_bound, f"{item.name}: {name}")
        groups[binding.group].append({"binding": binding.number, "resource": resource})
    key, make = _pipeline(gpu, item)
    pipeline, layouts = gpu.pipeline(key, make, len(groups))
    create = gpu.device.create_bind_group
    return pipeline, [create(layout=layout, entries=entries) for layout, entries in zip(layouts, groups, strict=True)]


@lru_cache(maxsize=256)
def _view_dimension(kind: str) -> str:
    """Return the dimension of the view that a binding of WGSL type `kind` takes."""
    for suffix, dimension in (("cube_array", "cube-array"), ("cube", "cube"), ("2d_array", "2d-array"), ("3d", "3d")):
        if kind.split("<")[0].endswith(suffix):
            return dimension
    return "2d"


def _pipeline(gpu: Gpu, item: Pass) -> tuple[Hashable, Callable[[], Any]]:
    """Return the key of a pass's pipeline, which is its complete state, and the function that makes the pipeline."""
    module, constants, state = item.module, item.constants, item.state
    key = (module.source, tuple(sorted(constants.items())))
    if not isinstance(state, Draw):
        return key, lambda: gpu.device.create_compute_pipeline(
            layout="auto", compute=_stage(gpu, module, "compute", constants), label=module.name
        )
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
