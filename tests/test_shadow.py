"""Shadows of slanted light: no light leaks below objects that nearly touch, and no acne on lit surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import MATTE, lit, plane

from wgsss import frame as shared
from wgsss.graph import Graph
from wgsss.scene import DirectionalLight, Object
from wgsss.stage import Stage

MAP = 256


def ground(gpu, scene):
    """Return L_d over the ground's atlas, and the positions of its texels."""
    stage = Stage(gpu, scene)
    stage.bodies[0].unwrap()
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (8, 8))
    handle = shared.irradiance_texels(frame, stage.bodies[0], MAP)
    graph.run(handle)
    t = (((np.arange(MAP) + 0.5) / MAP - 0.01) / 0.98 - 0.5) * 40
    return graph.read(handle)[..., 0] * frame.lighting.unit, *np.meshgrid(t, t)


@pytest.mark.parametrize("angle", [20, 45, 70])
@pytest.mark.parametrize("gap", [0.3, 2.0])
def test_a_sheet_close_to_the_ground_casts_a_shadow(gpu, angle, gap):
    a = np.radians(angle)
    light = DirectionalLight((np.sin(a), -np.cos(a), 0), (1, 1, 1))
    got, x, z = ground(gpu, lit(light, extra=(Object(plane(side=10.0, y=gap), MATTE),)))
    shadow = np.maximum(np.abs(x - gap * np.tan(a)), np.abs(z))
    texel = 40 / MAP  # and lifting off the ground moves the shadow's edge by up to four texels of the shadow map
    edge = texel + 4 * 42 / 2048 * max(np.tan(a), 1)
    assert got[shadow < 5 - edge].max() == 0
    np.testing.assert_allclose(got[(shadow > 5 + edge) & (np.abs(x) < 19.5) & (np.abs(z) < 19.5)], np.cos(a), rtol=1e-3)
