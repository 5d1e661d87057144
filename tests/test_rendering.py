"""Rendering many frames: no resources are left behind, and memory does not grow."""

from __future__ import annotations

import gc
import sys
import weakref
from pathlib import Path
from typing import Any

import pytest
from scenes import lit

from wgsss.gpu import TextureKey
from wgsss.registry import METHODS, make_method
from wgsss.rendering import Renderer
from wgsss.scene import EnvironmentLight, load_scene

KNOBS: dict[str, dict[str, Any]] = {
    "oat06": {"map_size": 64},
    "deon07": {"map_size": 64},
    "jimenez08": {"map_size": 64},
    "sam": {"surface": "screen"},
}


def test_scenes_without_shadows_leave_no_textures_behind(gpu):
    scene = lit(EnvironmentLight((1, 1, 1)))
    counts = []
    for _ in range(3):
        Renderer(scene, make_method("lambert"), (8, 8), gpu).frame()
        counts.append(len(gpu._views))
    assert counts[2] == counts[1]  # the first time there are those of other tests


def test_frames_of_earlier_sizes_leave_no_textures_behind(gpu):
    for width in (9, 10, 11):
        Renderer(lit(EnvironmentLight((1, 1, 1))), make_method("lambert"), (width, 7), gpu).frame()
        pooled = [key.size for key, free in gpu._free.items() if isinstance(key, TextureKey) and free]
        assert {size[0] for size in pooled if size[1] == 7} == {width}


@pytest.mark.parametrize("method", METHODS)
def test_the_resources_of_a_renderer_are_freed_with_it(gpu, method):
    """They are freed at once, not by the garbage collector, which does not know the memory of the device."""
    scene = load_scene("sphere", vertices=500)
    gc.disable()
    try:
        renderer = Renderer(scene, make_method(method, KNOBS.get(method)), (8, 8), gpu)
        renderer.frame(timed=False)
        stage = weakref.ref(renderer.stage)
        del renderer
        assert stage() is None
    finally:
        gc.enable()


def resident() -> int:
    """Return the bytes of memory that this process holds, with those of the driver."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory of the process from Linux")
@pytest.mark.parametrize("method", METHODS)
def test_memory_does_not_grow_from_frame_to_frame(gpu, method):
    renderer = Renderer(load_scene("wave", vertices=1000), make_method(method, KNOBS.get(method)), (32, 32), gpu)
    for number in range(10):
        renderer.frame(number / 25, timed=False)
    before = resident()
    for number in range(40):
        renderer.frame(number / 25, timed=False)
    assert resident() - before < 8 << 20
