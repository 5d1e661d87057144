"""The GPU device: textures and buffers, the pool that they come from, samplers and pipelines, and reading back."""

from __future__ import annotations

import os
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from wgsss import wgsl
from wgsss.errors import InputError
from wgsss.scene.images import MAX_SIDE

if TYPE_CHECKING:
    import wgpu

Buffer: TypeAlias = "wgpu.GPUBuffer"
Texture: TypeAlias = "wgpu.GPUTexture"

os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())  # unset, it makes drivers print noise

# The limits that every device is created with: WebGPU's defaults. Without them a device has the limits of its adapter,
# and a pass that runs with those of a software driver could fail on a GPU.
LIMITS = {
    "max-texture-dimension-2d": MAX_SIDE,
    "max-texture-array-layers": 256,
    "max-bind-groups": 4,
    "max-sampled-textures-per-shader-stage": 16,
    "max-samplers-per-shader-stage": 16,
    "max-storage-buffers-per-shader-stage": 8,
    "max-storage-textures-per-shader-stage": 4,
    "max-uniform-buffers-per-shader-stage": 12,
    "max-uniform-buffer-binding-size": 65536,
    "max-storage-buffer-binding-size": 128 << 20,
    "max-buffer-size": 256 << 20,
    "max-color-attachments": 8,
    "max-color-attachment-bytes-per-sample": 32,
    "max-compute-invocations-per-workgroup": 256,
    "max-compute-workgroup-size-x": 256,
    "max-compute-workgroup-size-y": 256,
    "max-compute-workgroup-storage-size": 16384,
    "max-compute-workgroups-per-dimension": 65535,
    "min-uniform-buffer-offset-alignment": 256,
    "min-storage-buffer-offset-alignment": 256,
}

# The graphics APIs whose adapters are considered: their names in wgpu, and those that adapters report.
BACKENDS = {
    "darwin": {"Metal": "Metal"},
    "win32": {"Vulkan": "Vulkan", "DX12": "D3D12"},
}.get(sys.platform, {"Vulkan": "Vulkan"})
INSTALL = {
    "darwin": "no Metal adapter found: wgsss needs a Mac whose graphics processor has Metal",
    "win32": "no Vulkan or Direct3D 12 adapter found: install the graphics driver of the card's maker",
}.get(
    sys.platform,
    "no Vulkan adapter found: install the GPU's driver, or Mesa's software driver (on Debian and Ubuntu the packages "
    "mesa-vulkan-drivers and libvulkan1)",
)

FORMATS: dict[str, tuple[str, int]] = {  # texture format -> numpy scalar, channels
    "r32float": ("<f4", 1),
    "rg32float": ("<f4", 2),
    "rgba32float": ("<f4", 4),
    "r16float": ("<f2", 1),
    "rg16float": ("<f2", 2),
    "rgba16float": ("<f2", 4),
    "r32uint": ("<u4", 1),
    "rg32uint": ("<u4", 2),
    "rgba32uint": ("<u4", 4),
    "r8unorm": ("u1", 1),
    "rg8unorm": ("u1", 2),
    "rgba8unorm": ("u1", 4),
    "rgba8unorm-srgb": ("u1", 4),
    "depth32float": ("<f4", 1),
}

SAMPLERS: dict[str, dict[str, str]] = {  # by the name of a module's binding
    "linear_clamp": {"mag_filter": "linear", "min_filter": "linear"},
    "linear_repeat": {
        "mag_filter": "linear",
        "min_filter": "linear",
        "address_mode_u": "repeat",
        "address_mode_v": "repeat",
    },
    "linear_wrap_u": {"mag_filter": "linear", "min_filter": "linear", "address_mode_u": "repeat"},
    "compare_less": {"mag_filter": "linear", "min_filter": "linear", "compare": "less-equal"},
}


def check_size(nbytes: int, most_bytes: int, purpose: str) -> None:
    """Raise InputError where a buffer is larger than devices allow. `purpose` begins the message."""
    if nbytes > most_bytes:
        needed, most = -(-nbytes >> 20), most_bytes >> 20
        raise InputError(
            f"{purpose} needs {needed} MiB in one buffer, more than the {most} MiB that devices allow: the mesh is too"
            " large, reduce it with --simplify"
        )


def texel_bytes(texture_format: str) -> int:
    """Return the bytes of one texel."""
    scalar, channels = FORMATS[texture_format]
    return np.dtype(scalar).itemsize * channels


def adapters() -> list[Any]:
    """Return the adapters of this machine that have one of BACKENDS. The environment variable WGPUPY_WGPU_ADAPTER_NAME
    limits them to those whose names contain it."""
    import wgpu

    _prepare_wgpu()
    part = os.environ.get("WGPUPY_WGPU_ADAPTER_NAME", "")
    return [
        a
        for a in wgpu.gpu.enumerate_adapters_sync()
        if part in a.info["device"] and a.info["backend_type"] in BACKENDS.values()
    ]


@lru_cache(maxsize=1)
def _prepare_wgpu() -> None:
    """Set up wgpu, once, before its first use."""
    from cffi import CDefError
    from wgpu.backends.wgpu_native import extras, ffi

    extras.set_instance_extras(backends=list(BACKENDS))  # others are never used, and slow to start
    # wgpu parses the C types of its calls one by one, which takes 15 ms each and a second in all, since each time all
    # names are declared again. Parsed in one go, all of them take as long as three. Without these internals wgpu works,
    # but starts more slowly.
    with suppress(AttributeError, CDefError):
        names = [name.split()[1] for name in ffi._parser._declarations if name.startswith("typedef WGPU")]
        pointers = ffi.typeof(f"void(*)({', '.join(f'{name} *' for name in names)})").args
        for name, pointer in zip(names, pointers, strict=True):
            ffi._parsed_types.setdefault(f"{name} *", (pointer, False))


@dataclass(frozen=True)
class TextureKey:
    """The properties that two textures share if one can take the place of the other in the pool."""

    size: tuple[int, int, int]  # width, height, layers
    format: str
    usage: int

    @property
    def nbytes(self) -> int:
        return self.size[0] * self.size[1] * self.size[2] * texel_bytes(self.format)


PoolKey: TypeAlias = TextureKey | tuple[int, int]
"""Which resources of the pool are interchangeable: of buffers, size and usage."""


class Gpu:
    """A device with its pipelines, samplers and pool of textures and buffers.

    Raises InputError where there is no adapter.
    """

    def __init__(self) -> None:
        kinds = ("DiscreteGPU", "IntegratedGPU", "VirtualGPU", "CPU", "Unknown")  # best first
        choice = sorted(adapters(), key=lambda a: kinds.index(a.info["adapter_type"]))
        if not choice:
            raise InputError(INSTALL)
        self.adapter = choice[0]
        self.info = self.adapter.info
        self.is_cpu = self.info["adapter_type"] == "CPU"
        # On lavapipe timestamps of compute passes are misattributed: passes on CPU adapters are timed by a wall clock.
        self.has_timestamps = not self.is_cpu and "timestamp-query" in self.adapter.features
        self.device = self.adapter.request_device_sync(
            required_features=["timestamp-query"] if self.has_timestamps else [], required_limits=LIMITS
        )
        self.queue = self.device.queue
        self.most_bound = LIMITS["max-storage-buffer-binding-size"]
        self._shaders: dict[str, Any] = {}
        self._pipelines: dict[Hashable, tuple[Any, list[Any]]] = {}
        self._samplers: dict[str, Any] = {}
        # By id of a texture that belongs to the pool, and so lives until `trim`.
        self._views: dict[int, dict[tuple[str, int | None], Any]] = {}
        self._free: defaultdict[PoolKey, list[Any]] = defaultdict(list)
        self._fence = self.buffer(np.zeros(1, np.uint32))

    @property
    def name(self) -> str:
        """The adapter's name and driver."""
        return f"{self.info['device']}, {self.info['description']}"

    # resources that persist

    def texture(self, pixels: npt.NDArray[Any], texture_format: str) -> Texture:
        """Return a texture that holds `pixels` (height, width[, channels]) or (layers, height, width, channels)."""
        import wgpu

        scalar, channels = FORMATS[texture_format]
        data = np.ascontiguousarray(pixels, np.dtype(scalar))
        data = data[..., None] if data.ndim == 2 else data
        data = data[None] if data.ndim == 3 else data
        layers, height, width, got = data.shape
        largest = LIMITS["max-texture-dimension-2d"]
        if max(width, height) > largest:
            raise InputError(f"a texture of {width} x {height} texels is larger than the {largest} that devices allow")
        if got != channels:
            raise ValueError(f"{texture_format} has {channels} channels, got {got}")
        usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.COPY_SRC
        texture = self.device.create_texture(size=(width, height, layers), format=texture_format, usage=usage)
        layout = {"bytes_per_row": width * texel_bytes(texture_format), "rows_per_image": height}
        self.queue.write_texture({"texture": texture}, data, layout, (width, height, layers))
        return texture

    def buffer(self, data: npt.NDArray[Any] | bytes) -> Buffer:
        """Return a buffer that holds `data`, to be bound as storage or used as an index buffer."""
        import wgpu

        usage = (
            wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.INDEX | wgpu.BufferUsage.COPY_SRC | wgpu.BufferUsage.COPY_DST
        )
        nbytes = data.nbytes if isinstance(data, np.ndarray) else len(data)
        check_size(nbytes, LIMITS["max-buffer-size"], "a mesh's data")
        raw = data if isinstance(data, bytes) else np.ascontiguousarray(data).tobytes()
        return self.device.create_buffer_with_data(data=raw + bytes(-len(raw) % 4), usage=usage)

    @cached_property
    def no_depth(self) -> Texture:
        """A depth texture of one texel, to bind where a module has a depth texture and there is none."""
        import wgpu

        return self.device.create_texture(
            size=(1, 1, 1), format="depth32float", usage=wgpu.TextureUsage.TEXTURE_BINDING
        )

    @cached_property
    def black(self) -> Texture:
        """A black texture of one texel, to bind where a module has a texture and there is none."""
        return self.texture(np.zeros((1, 1, 4)), "rgba16float")

    def read_texture(self, texture: Texture) -> npt.NDArray[Any]:
        """Return the texels of a texture, (height, width, channels) or (layers, height, width, channels)."""
        scalar, channels = FORMATS[texture.format]
        width, height, layers = texture.size
        row = width * texel_bytes(texture.format)
        strip = min(height, LIMITS["max-buffer-size"] // (row + 256))  # rows that fit in one staging buffer
        texels = np.empty((layers, height, width, channels), scalar)
        for layer, top in ((i, y) for i in range(layers) for y in range(0, height, strip)):
            rows = min(strip, height - top)
            source = {"texture": texture, "origin": (0, top, layer)}
            layout = {"bytes_per_row": row, "rows_per_image": rows}
            raw = self.queue.read_texture(source, layout, (width, rows, 1))
            texels[layer, top : top + rows] = np.frombuffer(raw, scalar).reshape(rows, width, channels)
        return texels[0] if layers == 1 else texels

    def fence(self) -> None:
        """Wait until all submitted work is done."""
        self.queue.read_buffer(self._fence)

    @property
    def ns_per_tick(self) -> float:
        """Nanoseconds per tick of the device's timestamps."""
        from wgpu.backends.wgpu_native import lib

        return float(lib.wgpuQueueGetTimestampPeriod(self.queue._internal))

    # samplers, shaders and pipelines

    def sampler(self, name: str) -> Any:
        """Return the sampler of SAMPLERS with this name."""
        if name not in self._samplers:
            if name not in SAMPLERS:
                raise wgsl.WgslError(f"no sampler is called '{name}' (known: {', '.join(SAMPLERS)})")
            self._samplers[name] = self.device.create_sampler(**SAMPLERS[name])
        return self._samplers[name]

    def shader(self, module: wgsl.Module) -> Any:
        """Return the compiled module. Raises WgslError, with file and line, where it does not compile."""
        import wgpu

        if module.source not in self._shaders:
            try:
                self._shaders[module.source] = self.device.create_shader_module(code=module.source, label=module.name)
            except wgpu.GPUError as error:
                raise wgsl.WgslError(module.explain(str(error))) from None
        return self._shaders[module.source]

    def pipeline(self, key: Hashable, make: Callable[[], Any], groups: int) -> tuple[Any, list[Any]]:
        """Return the pipeline of complete state `key`, which `make()` creates the first time, and the layouts of its
        bind groups."""
        if key not in self._pipelines:
            pipeline = make()
            self._pipelines[key] = pipeline, [pipeline.get_bind_group_layout(i) for i in range(groups)]
        return self._pipelines[key]

    def view(self, texture: Texture, dimension: str = "2d", layer: int | None = None) -> Any:
        """Return a view of a texture or of one layer. Views of a texture of the pool are created once."""
        views = self._views.get(id(texture), {})
        if (dimension, layer) not in views:
            layers = {} if layer is None else {"base_array_layer": layer, "array_layer_count": 1}
            views[dimension, layer] = texture.create_view(dimension=dimension, **layers)
        return views[dimension, layer]

    # the pool

    def acquire(self, key: TextureKey) -> Texture:
        """Return a texture from the pool, with undefined content."""
        if self._free[key]:
            return self._free[key].pop()
        texture = self.device.create_texture(size=key.size, format=key.format, usage=key.usage)
        self._views[id(texture)] = {}
        return texture

    def acquire_buffer(self, nbytes: int, usage: int) -> tuple[Buffer, PoolKey]:
        """Return a buffer of at least `nbytes` from the pool, with undefined content, and its key for `release`."""
        check_size(nbytes, LIMITS["max-buffer-size"], "a pass")
        key = (1 << max(nbytes - 1, 255).bit_length(), usage)
        if self._free[key]:
            return self._free[key].pop(), key
        return self.device.create_buffer(size=key[0], usage=usage), key

    def release(self, key: PoolKey, resource: Buffer | Texture) -> None:
        """Give a texture or buffer back to the pool."""
        self._free[key].append(resource)

    def trim(self) -> None:
        """Drop the textures and buffers in the pool, for frames of another size to need none of them."""
        for resources in self._free.values():
            for resource in resources:
                self._views.pop(id(resource), None)
        self._free.clear()


@lru_cache(maxsize=1)
def default_gpu() -> Gpu:
    """Return the device that all renderers share by default."""
    return Gpu()
