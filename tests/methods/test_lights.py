"""Every method under every type of light: finite, not negative, and dark where there is no light."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import pytest
from scenes import drawable

from wgsss.gpu import Gpu
from wgsss.registry import METHODS, make_method, methods_for
from wgsss.rendering import Renderer
from wgsss.scene import EnvironmentLight, Scene, SphereLight, load_scene
from wgsss.study.light_types import light_types

KNOBS: dict[str, dict[str, Any]] = {
    "oat06": {"map_size": 64},
    "deon07": {"map_size": 64},
    "jimenez08": {"map_size": 64},
    "sam": {"surface": "screen", "select": "top"},
    "jensen02": {"spacing": 4.0},
}
TYPES = "directional", "point", "area", "environment", "sphere", "all", "none"
SCENES = "leaf", "ear"
LEAST = -1e-4
"""the lowest value that rounding may cause, as a share of the largest one"""


@lru_cache
def lit(scene: str) -> dict[str, Scene]:
    found = light_types(load_scene(scene, vertices=1000))
    area: Any = found["area"].lights[0]
    found["area"] = replace(found["area"], lights=(replace(area, samples=2),))
    ball = SphereLight(area.position, 10.0, area.radiance, 4)
    every = tuple(found[name].lights[0] for name in ("directional", "point", "environment"))
    found["sphere"], found["all"] = (replace(found["area"], lights=lights) for lights in ((ball,), every))
    return {**found, "none": replace(found["area"], lights=(EnvironmentLight((0.0, 0.0, 0.0)),))}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", METHODS)
def test_all_types_of_light(gpu: Gpu, method: str, scene: str) -> None:
    if method not in methods_for(load_scene(scene, vertices=1000)):
        pytest.skip("the material of the scene is known by its profile only")
    for name in TYPES:
        renderer = Renderer(drawable(lit(scene)[name], method), make_method(method, KNOBS.get(method)), (24, 24), gpu)
        image = renderer.frame(aovs=["M_front", "M_back"], timed=False)  # raises where a pixel is not finite
        most = max(float(M.max()) for M in image.aovs.values())
        assert (most > 0.0) == (name != "none"), f"{name}: {most}"
        for slot, M in image.aovs.items():
            assert float(M.min()) >= LEAST * most, f"{name}: {slot} is {M.min()} somewhere"
