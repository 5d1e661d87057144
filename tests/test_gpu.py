"""The device: upload and download of textures, errors, and both clocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from wgsss import gpu as gpu_module
from wgsss.errors import InputError
from wgsss.gpu import FORMATS, LIMITS, Gpu, TextureKey
from wgsss.graph import Graph
from wgsss.wgsl import WgslError


@pytest.mark.parametrize("texture_format", [f for f in FORMATS if not f.startswith("depth")])
@pytest.mark.parametrize("layers", [1, 3])
def test_downloaded_texels_equal_uploaded_ones(gpu, texture_format, layers):
    scalar, channels = FORMATS[texture_format]
    values = np.random.default_rng(0).integers(0, 200, (layers, 5, 7, channels)).astype(scalar)
    texture = gpu.texture(values if layers > 1 else values[0], texture_format)
    np.testing.assert_array_equal(gpu.read_texture(texture), values if layers > 1 else values[0])


def test_large_textures_are_read_in_strips(gpu, monkeypatch):
    values = np.random.default_rng(0).random((50, 40, 4), np.float32)
    texture = gpu.texture(values, "rgba32float")
    monkeypatch.setitem(LIMITS, "max-buffer-size", 10000)
    np.testing.assert_array_equal(gpu.read_texture(texture), values)


def test_the_device_has_the_default_limits_of_webgpu(gpu):
    for name, limit in LIMITS.items():
        assert gpu.device.limits[name] == limit or name.startswith("min-"), name


def test_an_unknown_sampler_is_refused_by_name(gpu):
    with pytest.raises(WgslError, match="no sampler is called 'cubic'"):
        gpu.sampler("cubic")


def test_no_adapter_is_bad_input(monkeypatch):
    monkeypatch.setattr(gpu_module, "adapters", list)
    with pytest.raises(InputError, match="no Vulkan adapter found"):
        Gpu()


def test_hardware_is_timed_by_its_own_timestamps(gpu, modules, monkeypatch):
    """Any adapter with timestamps can run this code; the times of a software adapter are not checked."""
    if "timestamp-query" not in gpu.adapter.features:
        pytest.skip("the adapter has no timestamp queries")
    adapter = gpu.adapter
    hardware = SimpleNamespace(
        info={**adapter.info, "adapter_type": "IntegratedGPU"},
        features=adapter.features,
        request_device_sync=adapter.request_device_sync,
    )
    monkeypatch.setattr(gpu_module, "adapters", lambda: [hardware])
    modules(
        count="""
@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3u) { numbers[id.x] = id.x; }"""
    )
    timed = Gpu()
    graph = Graph(timed)
    numbers = graph.dispatch("count", size=8)
    graph.run(numbers, timed=True)
    assert graph.clock == "gpu timestamps" and list(graph.times) == ["count"]
    assert 0 <= graph.times["count"] < 1e4 and timed.ns_per_tick > 0
    assert graph.read(numbers).tolist() == list(range(8))


def test_pooled_textures_are_reused_until_the_pool_is_trimmed():
    gpu = Gpu()
    key = TextureKey((3, 5, 1), "rgba8unorm", 4)
    first = gpu.acquire(key)
    gpu.view(first)
    gpu.release(key, first)
    assert gpu.acquire(key) is first
    gpu.release(key, first)
    gpu.trim()
    assert gpu.acquire(key) is not first and id(first) not in gpu._views
