"""The render graph: declare passes, cull back from what is wanted, pool, run, time.

A pass is a WGSL module called by the names of its bindings; what it gives back are handles to what it writes:

    blurred = graph.draw("texture_space/blur", source=irradiance, stretch=stretch, params=dict(sigma=0.7, axis=0))

Declaration order is execution order. A graph is built for one frame and dropped; nothing is allocated until `run`.
"""

from __future__ import annotations

import difflib
import weakref
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from wgsss import wgsl
from wgsss.gpu import Gpu, TextureKey, check_size
from wgsss.passes import Dispatch, Draw, Encoder, Handle, Pass, Resource, pipeline, view_dimension
from wgsss.wgsl import Binding, Module, WgslError

Size = int | tuple[int, int] | tuple[int, int, int]
_UPLOAD_ALIGNMENT = 256  # the largest minimum that WebGPU allows for offsets of uniform and storage bindings


class Graph:
    """The passes of one frame.

    After `run`: `times` (pass name -> ms, where timed), `clock` ("gpu timestamps" or "fenced wall clock"), `ran` and
    `culled` (passes), `peak_bytes` (most transient bytes live at once). `str(graph)` is the table of all that.
    """

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.passes: list[Pass] = []
        self.ran: list[Pass] = []
        self.culled: list[Pass] = []
        self.times: dict[str, float] = {}
        self.clock = "gpu timestamps" if gpu.has_timestamps else "fenced wall clock"
        self.peak_bytes = 0
        self.uploaded_bytes = 0
        self._names: dict[str, int] = {}
        self._held: list[Resource] = []  # what is left of it goes back to the pool with the graph
        weakref.finalize(self, _release, gpu, self._held).atexit = False

    # declaring

    def texture(self, name: str, size: tuple[int, int, int], texture_format: str) -> Handle:
        """A texture (width, height, layers) that several passes will write in turn, by `into` or `depth_buffer`."""
        return Handle(Resource(name, texture_format, size), 0)

    def draw(
        self,
        module: str,
        *,
        size: tuple[int, int] | None = None,
        indices: Any = None,
        count: int = 3,
        into: Handle | Mapping[str, Handle] | None = None,
        depth_buffer: Handle | Literal["new"] | None = None,
        layer: int = 0,
        constants: Mapping[str, float] | None = None,
        label: str = "",
        **bindings: Any,
    ) -> Any:
        """Declare a raster pass of `wgsl/<module>.wgsl`; without `indices` (a u32 index buffer) a full-screen triangle.

        Args:
            size: of the targets made, in texels; by default that of `into`, `depth_buffer` or the first texture bound.
            into: targets to draw onto instead of new, cleared ones (a handle, or handles by output name).
            depth_buffer: "new" for a cleared depth buffer, or one to test against and write.
            layer: of array textures given as `into` or `depth_buffer`.
            bindings: the module's bindings by name: handles, GPU resources that persist, or values to pack and upload.

        Returns:
            The handle written; where there are several, a namespace by output name, `depth` among them.

        Raises:
            WgslError: for a missing, unknown or ill-typed name, listing what the module wants and what it was given.
        """
        loaded = wgsl.load(module)
        item = self._declare(loaded, label, constants, bindings)
        given = (
            dict(into) if isinstance(into, Mapping) else {t[0]: into for t in loaded.targets[:1] if into is not None}
        )
        if size is None:
            size = self._default_size([*given.values(), depth_buffer, *item.reads.values()], loaded)
        targets = []
        for name, texture_format in loaded.targets:
            if name in given:
                self._write_on(item, name, given[name])
            else:
                self._write_new(item, name, Resource(f"{item.name}.{name}", texture_format, (*size, 1)))
            targets.append((name, item.writes[name].layer(layer) in item.writes[name].resource.drawn))
        if depth_buffer == "new":
            self._write_new(item, "depth", Resource(f"{item.name}.depth", "depth32float", (*size, 1)))
        elif isinstance(depth_buffer, Handle):
            self._write_on(item, "depth", depth_buffer)
        if not item.writes:
            raise WgslError(f"{item.name}: draws nothing: it has neither targets nor a depth buffer")
        written = item.writes.get("depth")
        keep_depth = written is not None and written.layer(layer) in written.resource.drawn
        import wgpu

        for handle in item.writes.values():
            handle.resource.usage |= wgpu.TextureUsage.RENDER_ATTACHMENT
            handle.resource.drawn.add(handle.layer(layer))
        if indices is not None and count == 3:
            count = indices.size // 4
        item.state = Draw(tuple(targets), keep_depth, layer, indices, count)
        return self._outputs(item)

    def dispatch(
        self,
        module: str,
        *,
        size: Size | None = None,
        constants: Mapping[str, float] | None = None,
        label: str = "",
        **bindings: Any,
    ) -> Any:
        """Declare a compute pass of `wgsl/<module>.wgsl` over `size` (items, or width, height[, layers]).

        Storage that the module writes and that is not among `bindings` is made with `size`; a handle given for it is
        written in place. Returns and raises as `draw`.
        """
        loaded = wgsl.load(module)
        written = {
            n: b for n, b in loaded.bindings.items() if b.access in ("write", "read_write") and b.space != "sampler"
        }
        item = self._declare(loaded, label, constants, bindings, made=frozenset(written) - set(bindings))
        if size is None:
            size = self._default_size(
                [bindings[n] for n in written if isinstance(bindings.get(n), Handle)] or list(item.reads.values()),
                loaded,
            )
        extent = (size, 1, 1) if isinstance(size, int) else (*size, 1)[:3]
        for name, binding in written.items():
            handle = item.reads.get(name)
            if handle is not None:
                self._write_on(item, name, handle)
            elif name not in item.imports:
                resource = Resource(f"{item.name}.{name}", binding.format, extent)
                if binding.space == "storage":
                    resource.layout = loaded.layout(binding.type)
                    resource.size = (extent[0] * extent[1] * extent[2], 1, 1)
                self._write_new(item, name, resource)
        groups = [-(-n // w) for n, w in zip(extent, loaded.workgroup_size(constants or {}), strict=True)]
        item.state = Dispatch((groups[0], groups[1], groups[2]))
        return self._outputs(item)

    def _declare(
        self, module: Module, label: str, constants: Any, bindings: dict[str, Any], made: frozenset[str] = frozenset()
    ) -> Pass:
        name = f"{module.name} {label}".strip()
        self._names[name] = self._names.get(name, 0) + 1
        item = Pass(name if self._names[name] == 1 else f"{name} #{self._names[name]}", module, dict(constants or {}))
        wanted = {n: b for n, b in module.bindings.items() if b.space != "sampler" and n not in made}
        if set(bindings) != set(wanted):
            raise WgslError(_mismatch(module, wanted, bindings))
        unknown = set(item.constants) - set(module.overrides)
        if unknown:
            known = ", ".join(module.overrides)
            raise WgslError(f"{module.name}: no override is called {', '.join(sorted(unknown))} (known: {known})")
        for key, value in bindings.items():
            self._bind(item, wanted[key], value)
        self.passes.append(item)
        return item

    def _bind(self, item: Pass, binding: Binding, value: Any) -> None:
        import wgpu

        wants_texture = binding.space in ("texture", "storage_texture")
        if isinstance(value, Handle):
            if wants_texture == (value.resource.layout is not None):
                raise WgslError(f"{item.module.name}: '{binding.name}' is a {binding.type}, got {value!r}")
            if value.version == 0 and binding.access == "read":
                raise WgslError(f"{item.module.name}: '{binding.name}' is {value!r}, which no pass has written")
            value.resource.usage |= {
                "texture": wgpu.TextureUsage.TEXTURE_BINDING,
                "storage_texture": wgpu.TextureUsage.STORAGE_BINDING,
            }.get(binding.space, wgpu.BufferUsage.STORAGE)
            item.reads[binding.name] = self._checked(value)
        elif isinstance(value, wgpu.GPUTexture if wants_texture else wgpu.GPUBuffer):
            item.imports[binding.name] = value
        elif not wants_texture and not isinstance(value, wgpu.GPUTexture):
            item.uploads[binding.name] = item.module.layout(binding.type).pack(value)
        else:
            raise WgslError(f"{item.module.name}: '{binding.name}' is a {binding.type}, got {type(value).__name__}")

    def _checked(self, handle: Handle) -> Handle:
        if handle.version != handle.resource.version:
            raise WgslError(f"{handle!r} is stale: a later pass wrote {handle.resource.name}@{handle.resource.version}")
        return handle

    def _default_size(self, handles: list[Any], module: Module) -> tuple[int, int]:
        for handle in handles:
            if isinstance(handle, Handle) and handle.format:
                return handle.size
        raise WgslError(f"{module.name}: give a size, since no texture says it")

    def _write_new(self, item: Pass, name: str, resource: Resource) -> None:
        import wgpu

        resource.version = 1
        resource.usage |= wgpu.BufferUsage.STORAGE if resource.layout else 0
        if resource.format and name in item.module.bindings:
            resource.usage |= wgpu.TextureUsage.STORAGE_BINDING
        item.writes[name] = Handle(resource, 1)

    def _write_on(self, item: Pass, name: str, handle: Handle) -> None:
        if self._checked(handle).version:
            item.reads.setdefault(name, handle)
        handle.resource.version += 1
        item.writes[name] = Handle(handle.resource, handle.version + 1)

    @staticmethod
    def _outputs(item: Pass) -> Any:
        return next(iter(item.writes.values())) if len(item.writes) == 1 else SimpleNamespace(**item.writes)

    # running

    def needed(self, *wanted: Handle) -> list[Pass]:
        """The passes without which these handles would not be written, in declaration order."""
        read = set(wanted)
        kept: list[Pass] = []
        for item in reversed(self.passes):
            if read & set(item.writes.values()):
                kept.append(item)
                read |= set(item.reads.values())
        return kept[::-1]

    def run(self, *wanted: Handle, timed: bool = False) -> None:
        """Run what the wanted handles need, in declaration order.

        With `timed`, `times` is filled: from timestamps on hardware; on CPU adapters each pass is submitted alone
        and fenced.
        """
        import wgpu

        shown = wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.TEXTURE_BINDING
        for handle in wanted:
            handle.resource.usage |= shown if handle.format else wgpu.BufferUsage.COPY_SRC
        self.ran = self.needed(*wanted)
        chosen = set(self.ran)
        self.culled = [p for p in self.passes if p not in chosen]
        keep = {h.resource for h in wanted}
        last_use = {h.resource: i for i, p in enumerate(self.ran) for h in (*p.reads.values(), *p.writes.values())}

        arena, arena_key, offsets = self._upload()
        live = 0
        self.peak_bytes = 0
        encoder = Encoder(self.gpu, self.ran, timed)
        for i, item in enumerate(self.ran):
            for handle in (*item.reads.values(), *item.writes.values()):
                if handle.resource.gpu is None:
                    self._allocate(handle.resource)
                    live += handle.resource.nbytes
            self.peak_bytes = max(self.peak_bytes, live)
            try:
                bound = self._bind_group(item, arena, offsets)
            except wgpu.GPUValidationError as error:
                raise WgslError(f"{item.name}: {item.module.explain(str(error))}") from None
            encoder.encode(i, item, bound)
            for handle in {*item.reads.values(), *item.writes.values()}:
                resource = handle.resource
                if last_use[resource] == i and resource.gpu is not None and resource not in keep:
                    self.gpu.release(resource.key, resource.gpu)
                    resource.gpu = None
                    live -= resource.nbytes
        encoder.finish()
        self.times = encoder.times
        if arena is not None:
            self.gpu.release(arena_key, arena)

    def read(self, handle: Handle) -> np.ndarray:
        """What a wanted handle holds after `run`: texels (height, width, channels), or a buffer's elements."""
        if handle.resource.gpu is None:
            raise WgslError(f"{handle!r} was not among the handles that run() was asked for")
        if handle.resource.layout is None:
            return self.gpu.read_texture(handle.resource.gpu)
        raw = self.gpu.queue.read_buffer(handle.resource.gpu, 0, handle.resource.nbytes)
        return np.frombuffer(raw, handle.resource.layout.dtype)

    def _allocate(self, resource: Resource) -> None:
        import wgpu

        if resource.layout is not None:
            usage = resource.usage | wgpu.BufferUsage.COPY_DST
            resource.gpu, resource.key = self.gpu.acquire_buffer(resource.nbytes, usage)
        else:
            resource.key = TextureKey(resource.size, resource.format, resource.usage)
            resource.gpu = self.gpu.acquire(resource.key)
        self._held.append(resource)

    def _upload(self) -> tuple[Any, Any, dict[tuple[Pass, str], int]]:
        """One buffer with all values that the kept passes were given, and the offset of each."""
        import wgpu

        offsets: dict[tuple[Pass, str], int] = {}
        seen: dict[bytes, int] = {}
        chunks, end = [], 0
        for item in self.ran:
            for name, data in item.uploads.items():
                if data not in seen:
                    seen[data] = end
                    chunks.append(data + bytes(-len(data) % _UPLOAD_ALIGNMENT))
                    end += len(chunks[-1])
                offsets[item, name] = seen[data]
        if not chunks:
            return None, None, offsets
        usage = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_DST
        arena, key = self.gpu.acquire_buffer(end, usage)
        self.gpu.queue.write_buffer(arena, 0, b"".join(chunks))
        self.uploaded_bytes = end
        return arena, key, offsets

    def _bind_group(self, item: Pass, arena: Any, offsets: Mapping[tuple[Pass, str], int]) -> tuple[Any, Any]:
        state, layout = self.gpu.pipeline(*pipeline(self.gpu, item))
        entries = []
        for name, binding in item.module.bindings.items():
            resource: Any
            if binding.space == "sampler":
                resource = self.gpu.sampler(name)
            elif name in item.uploads:
                resource = {"buffer": arena, "offset": offsets[item, name], "size": len(item.uploads[name])}
            else:
                handle = item.reads.get(name) or item.writes.get(name)
                resource = handle.resource.gpu if handle else item.imports[name]
                if binding.space in ("texture", "storage_texture"):
                    resource = self.gpu.view(resource, view_dimension(binding.type))
                elif handle:
                    resource = {"buffer": resource, "offset": 0, "size": handle.resource.nbytes}
                if binding.space == "storage":
                    size = handle.resource.nbytes if handle else resource.size
                    check_size(size, self.gpu.most_bound, f"{item.name}: {name}")
            entries.append({"binding": binding.number, "resource": resource})
        group = self.gpu.device.create_bind_group(layout=layout, entries=entries) if entries else None
        return state, group

    def __str__(self) -> str:
        rows = [("pass", "reads", "writes", "ms")]
        for item in self.passes:
            ms = f"{self.times[item.name]:.2f}" if item.name in self.times else "culled" if item in self.culled else ""
            reads = " ".join(sorted(item.reads)) or "-"
            writes = " ".join(f"{n}:{h.size[0]}x{h.size[1]}:{h.format or 'buffer'}" for n, h in item.writes.items())
            rows.append((item.name, reads, writes, ms))
        widths = [max(len(row[c]) for row in rows) for c in range(4)]
        lines = [
            "  ".join([*(cell.ljust(w) for cell, w in zip(row[:3], widths[:3], strict=True)), row[3].rjust(widths[3])])
            for row in rows
        ]
        total = sum(self.times.values())
        lines.append(
            f"{len(self.ran)} passes ran, {len(self.culled)} culled; {total:.2f} ms ({self.clock}); "
            f"{self.peak_bytes / 2**20:.1f} MiB of transients live at most"
        )
        return "\n".join(lines)

    def dot(self) -> str:
        """The graph for Graphviz: passes are boxes, grey where culled; edges carry the resource."""
        lines = ["digraph frame {", "  rankdir=LR; node [shape=box, fontname=sans];"]
        writer = {handle: item.name for item in self.passes for handle in item.writes.values()}
        for item in self.passes:
            ms = f"\\n{self.times[item.name]:.2f} ms" if item.name in self.times else ""
            style = ", color=grey, fontcolor=grey" if item in self.culled else ""
            lines.append(f'  "{item.name}" [label="{item.name}{ms}"{style}];')
            lines += [f'  "{writer[h]}" -> "{item.name}" [label="{n}"];' for n, h in item.reads.items() if h in writer]
        return "\n".join([*lines, "}"]) + "\n"


def _release(gpu: Gpu, resources: list[Resource]) -> None:
    for resource in resources:
        if resource.gpu is not None:
            gpu.release(resource.key, resource.gpu)


def _mismatch(module: Module, wanted: Mapping[str, Binding], given: Mapping[str, Any]) -> str:
    parts = [f"{module.name} wants {', '.join(f'{n}: {b.type}' for n, b in wanted.items()) or 'nothing'}"]
    parts.append(f"was given {', '.join(given) or 'nothing'}")
    if missing := [n for n in wanted if n not in given]:
        parts.append(f"missing: {', '.join(missing)}")
    for name in (n for n in given if n not in wanted):
        near = difflib.get_close_matches(name, list(wanted), n=1)
        parts.append(f"unknown: {name}" + (f" (did you mean '{near[0]}'?)" if near else ""))
    return "; ".join(parts)


__all__ = ["Graph", "Handle", "Pass", "Resource"]
