"""The render graph: declare passes, run those that are needed, reuse textures and buffers, measure times.

A pass is a WGSL module called with a value for each of its bindings, by name; it returns handles to its outputs:

    blurred = graph.draw("texture_space/blur", source=irradiance, params={"variance": 0.7, "direction": 0}, ...)

Passes run in the order of their declaration. A graph is built for one frame and dropped; nothing is allocated before
`run`.
"""

from __future__ import annotations

import difflib
import weakref
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import Any, Literal, ParamSpec

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.encoder import Encoder
from wgsss.gpu import Buffer, Gpu, TextureKey
from wgsss.passes import Bindings, Dispatch, Draw, Handle, Outputs, Pass, Resource, Size, Value
from wgsss.pipelines import Uploads, bind
from wgsss.wgsl import Binding, Module, WgslError

_P = ParamSpec("_P")


def _single(declare: Callable[_P, Outputs]) -> Callable[_P, Handle]:
    """Return the same method for modules with one output: it returns that output's handle."""

    @wraps(declare)
    def declare_single(*args: _P.args, **kwargs: _P.kwargs) -> Handle:
        outputs = declare(*args, **kwargs)
        if len(outputs) > 1:
            raise WgslError(f"{args[1]} has the outputs {', '.join(outputs)}: use {declare.__name__}")
        return next(iter(outputs.values()))

    return declare_single


class Graph:
    """The passes of one frame.

    Attributes:
        times: ms of each pass by name, after a timed `run`.
        clock: how they are measured, "gpu timestamps" or "fenced wall clock".
        ran, culled: the passes that the last `run` ran, and those that it did not need.
        peak_bytes: the most bytes of transient resources that the last `run` held at once.
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
        self._allocated: list[Resource] = []  # those of them that the graph still holds go back to the pool with it
        weakref.finalize(self, _release, gpu, self._allocated).atexit = False

    # declaring

    def texture(self, name: str, size: tuple[int, int, int], texture_format: str) -> Handle:
        """Return a texture (width, height, layers) that several passes write in turn, as `into` or `depth_buffer`."""
        return Handle(Resource(name, texture_format, size), 0)

    def draw_outputs(
        self,
        module: str,
        *,
        size: tuple[int, int] | None = None,
        indices: Buffer | None = None,
        count: int = 3,
        into: Handle | Mapping[str, Handle] | None = None,
        depth_buffer: Handle | Literal["new"] | None = None,
        layer: int = 0,
        constants: Mapping[str, float] | None = None,
        label: str = "",
        **bindings: Value,
    ) -> Outputs:
        """Declare a raster pass of `wgsl/<module>.wgsl`. Without `indices` and `count` it draws one triangle.

        Args:
            size: of the targets that it creates, in texels; by default that of `into`, of `depth_buffer` or of the
                first texture bound.
            indices: index buffer, u32.
            count: number of vertices, where there are no indices.
            into: targets to draw onto instead of new, cleared ones: one handle, or handles by output name.
            depth_buffer: "new" for a cleared depth buffer, or one to test against and write.
            layer: layer of the array textures among `into` and `depth_buffer`.
            constants: values of the module's `override` constants.
            label: what distinguishes this pass from others of the module, in names of passes.
            bindings: values of the module's bindings by name: handles, GPU resources that persist, or numbers.

        Returns:
            The handles written, by output name; that of the depth buffer is `depth`.

        Raises:
            WgslError: for a binding that is missing, unknown or of the wrong type.
        """
        loaded = wgsl.load(module)
        item = self._declare(loaded, label, constants, bindings)
        targets: dict[str, Handle] = {}
        if isinstance(into, Handle):
            targets = {name: into for name, _ in loaded.targets[:1]}
        elif into is not None:
            targets = dict(into)
        if size is None:
            size = _first_size([*targets.values(), depth_buffer, *item.reads.values()], loaded)
        is_kept = []
        for name, texture_format in loaded.targets:
            if name in targets:
                self._write_on(item, name, targets[name])
            else:
                self._write_new(item, name, Resource(f"{item.name}.{name}", texture_format, (*size, 1)))
            is_kept.append((name, item.writes[name].layer(layer) in item.writes[name].resource.drawn))
        if depth_buffer == "new":
            self._write_new(item, "depth", Resource(f"{item.name}.depth", "depth32float", (*size, 1)))
        elif isinstance(depth_buffer, Handle):
            self._write_on(item, "depth", depth_buffer)
        if not item.writes:
            raise WgslError(f"{item.name}: has neither targets nor a depth buffer to draw onto")
        depth = item.writes.get("depth")
        keep_depth = depth is not None and depth.layer(layer) in depth.resource.drawn
        import wgpu

        for handle in item.writes.values():
            handle.resource.usage |= wgpu.TextureUsage.RENDER_ATTACHMENT
            handle.resource.drawn.add(handle.layer(layer))
        if indices is not None and count == 3:
            count = indices.size // 4
        item.state = Draw(tuple(is_kept), keep_depth, layer, indices, count)
        return Outputs(item.writes)

    def dispatch_outputs(
        self,
        module: str,
        *,
        size: Size | None = None,
        constants: Mapping[str, float] | None = None,
        label: str = "",
        **bindings: Value,
    ) -> Outputs:
        """Declare a compute pass of `wgsl/<module>.wgsl` over `size` (items, or width, height[, layers]).

        Storage that the module writes is created with that size, unless `bindings` has a handle for it, which is then
        written in place. Returns and raises as `draw_outputs`.
        """
        loaded = wgsl.load(module)
        written = {n: b for n, b in loaded.used.items() if b.access in ("write", "read_write") and b.space != "sampler"}
        item = self._declare(loaded, label, constants, bindings, created=frozenset(written) - set(bindings))
        if size is None:
            bound = [bindings[name] for name in written if name in bindings]
            size = _first_size([*bound, *item.reads.values()], loaded)
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
        return Outputs(item.writes)

    draw = _single(draw_outputs)
    dispatch = _single(dispatch_outputs)

    def _declare(
        self,
        module: Module,
        label: str,
        constants: Mapping[str, float] | None,
        bindings: Mapping[str, Value],
        created: frozenset[str] = frozenset(),
    ) -> Pass:
        name = f"{module.name} {label}".strip()
        self._names[name] = self._names.get(name, 0) + 1
        item = Pass(name if self._names[name] == 1 else f"{name} #{self._names[name]}", module, dict(constants or {}))
        expected = {n: b for n, b in module.used.items() if b.space != "sampler" and n not in created}
        if set(bindings) != set(expected):
            raise WgslError(_mismatch(module, expected, bindings))
        unknown = set(item.constants) - set(module.overrides)
        if unknown:
            known = ", ".join(module.overrides)
            raise WgslError(f"{module.name}: no override is called {', '.join(sorted(unknown))} (known: {known})")
        for key, value in bindings.items():
            self._bind(item, expected[key], value)
        self.passes.append(item)
        return item

    def _bind(self, item: Pass, binding: Binding, value: Value) -> None:
        import wgpu

        takes_texture = binding.space in ("texture", "storage_texture")
        if isinstance(value, Handle):
            if takes_texture == (value.resource.layout is not None):
                raise WgslError(f"{item.module.name}: '{binding.name}' is a {binding.type}, got {value!r}")
            if value.version == 0 and binding.access == "read":
                raise WgslError(f"{item.module.name}: '{binding.name}' is {value!r}, which no pass has written")
            value.resource.usage |= {
                "texture": wgpu.TextureUsage.TEXTURE_BINDING,
                "storage_texture": wgpu.TextureUsage.STORAGE_BINDING,
            }.get(binding.space, wgpu.BufferUsage.STORAGE)
            item.reads[binding.name] = _current(value)
        elif isinstance(value, wgpu.GPUTexture if takes_texture else wgpu.GPUBuffer):
            item.imports[binding.name] = value
        elif not takes_texture and not isinstance(value, wgpu.GPUTexture):
            item.uploads[binding.name] = item.module.layout(binding.type).pack(value)
        else:
            raise WgslError(f"{item.module.name}: '{binding.name}' is a {binding.type}, got {type(value).__name__}")

    def _write_new(self, item: Pass, name: str, resource: Resource) -> None:
        import wgpu

        resource.version = 1
        resource.usage |= wgpu.BufferUsage.STORAGE if resource.layout else 0
        if resource.format and name in item.module.used:
            resource.usage |= wgpu.TextureUsage.STORAGE_BINDING
        item.writes[name] = Handle(resource, 1)

    def _write_on(self, item: Pass, name: str, handle: Handle) -> None:
        if _current(handle).version:
            item.reads.setdefault(name, handle)
        handle.resource.version += 1
        item.writes[name] = Handle(handle.resource, handle.version + 1)

    # running

    def needed(self, *outputs: Handle) -> list[Pass]:
        """Return the passes without which these handles would not be written, in the order of declaration."""
        read = set(outputs)
        needed: list[Pass] = []
        for item in reversed(self.passes):
            if read & set(item.writes.values()):
                needed.append(item)
                read |= set(item.reads.values())
        return needed[::-1]

    def run(self, *outputs: Handle, timed: bool = False) -> None:
        """Run the passes that these outputs need, in the order of declaration; `read` then reads the outputs.

        With `timed`, fill `times`: from timestamps on hardware; on CPU adapters by submitting and fencing each pass
        alone.
        """
        import wgpu

        readable = wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.TEXTURE_BINDING
        for handle in outputs:
            handle.resource.usage |= readable if handle.format else wgpu.BufferUsage.COPY_SRC
        self.ran = self.needed(*outputs)
        chosen = set(self.ran)
        self.culled = [p for p in self.passes if p not in chosen]
        keep = {h.resource for h in outputs}
        last_use = {h.resource: i for i, p in enumerate(self.ran) for h in (*p.reads.values(), *p.writes.values())}

        uploads = Uploads(self.gpu, self.ran)
        self.uploaded_bytes = uploads.nbytes
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
                pipeline, groups = bind(self.gpu, item, uploads)
            except wgpu.GPUValidationError as error:
                raise WgslError(f"{item.name}: {item.module.explain(str(error))}") from None
            encoder.encode(i, item, pipeline, groups)
            for handle in {*item.reads.values(), *item.writes.values()}:
                resource = handle.resource
                if last_use[resource] == i and resource.gpu is not None and resource not in keep:
                    _release(self.gpu, [resource])
                    live -= resource.nbytes
        encoder.finish()
        self.times = encoder.times
        uploads.release()

    def read(self, handle: Handle) -> npt.NDArray[Any]:
        """Return what an output holds after `run`: texels (height, width, channels), or the elements of a buffer."""
        resource = handle.resource
        if resource.gpu is None:
            raise WgslError(f"{handle!r} was not among the handles that run() was asked for")
        if resource.layout is None:
            return self.gpu.read_texture(resource.gpu)
        raw = self.gpu.queue.read_buffer(resource.gpu, 0, resource.nbytes)
        return np.frombuffer(raw, resource.layout.dtype)

    def _allocate(self, resource: Resource) -> None:
        import wgpu

        if resource.layout is not None:
            usage = resource.usage | wgpu.BufferUsage.COPY_DST
            resource.gpu, resource.key = self.gpu.acquire_buffer(resource.nbytes, usage)
        else:
            key = TextureKey(resource.size, resource.format, resource.usage)
            resource.gpu, resource.key = self.gpu.acquire(key), key
        self._allocated.append(resource)

    # describing

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
        """Return the graph for Graphviz: passes are boxes, grey where culled, and edges the resources between them."""
        lines = ["digraph frame {", "  rankdir=LR; node [shape=box, fontname=sans];"]
        writer = {handle: item.name for item in self.passes for handle in item.writes.values()}
        for item in self.passes:
            ms = f"\\n{self.times[item.name]:.2f} ms" if item.name in self.times else ""
            style = ", color=grey, fontcolor=grey" if item in self.culled else ""
            lines.append(f'  "{item.name}" [label="{item.name}{ms}"{style}];')
            lines += [f'  "{writer[h]}" -> "{item.name}" [label="{n}"];' for n, h in item.reads.items() if h in writer]
        return "\n".join([*lines, "}"]) + "\n"


def _current(handle: Handle) -> Handle:
    """Return the handle; raise WgslError where a later pass has written its resource."""
    if handle.version != handle.resource.version:
        raise WgslError(f"{handle!r} is stale: a later pass wrote {handle.resource.name}@{handle.resource.version}")
    return handle


def _first_size(values: Iterable[Any], module: Module) -> tuple[int, int]:
    """Return the size of the first texture among these values."""
    for value in values:
        if isinstance(value, Handle) and value.format:
            return value.size
    raise WgslError(f"{module.name}: give a size, since no texture among the bindings has one")


def _release(gpu: Gpu, resources: list[Resource]) -> None:
    for resource in resources:
        if resource.gpu is not None and resource.key is not None:
            gpu.release(resource.key, resource.gpu)
            resource.gpu = None


def _mismatch(module: Module, expected: Mapping[str, Binding], bindings: Mapping[str, Value]) -> str:
    parts = [f"{module.name} has the bindings {', '.join(f'{n}: {b.type}' for n, b in expected.items()) or 'none'}"]
    parts.append(f"got {', '.join(bindings) or 'none'}")
    if missing := [n for n in expected if n not in bindings]:
        parts.append(f"missing: {', '.join(missing)}")
    for name in (n for n in bindings if n not in expected):
        near = difflib.get_close_matches(name, list(expected), n=1)
        hint = f" (did you mean '{near[0]}'?)" if near else ""
        parts.append(f"unknown: {name}" + (" (no entry point uses it)" if name in module.bindings else hint))
    return "; ".join(parts)


__all__ = ["Bindings", "Graph", "Handle", "Outputs", "Pass", "Resource", "Value"]
