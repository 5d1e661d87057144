"""Reflection of the environment at rough surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import WHITE, lit, write_environment

from wgsss.methods.lambert import Lambert
from wgsss.rendering import Renderer
from wgsss.scene import EnvironmentLight, OrthographicCamera


def share_beyond(roughness: float, angle: float) -> float:
    """Return the share of a lobe beyond the edge of a bright half sky, by random directions; the lobe's axis is `angle`
    away from the edge."""
    d = np.random.default_rng(0).normal(size=(400_000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    cosine = d @ [np.sin(angle), np.cos(angle), 0]
    a2 = roughness**4
    cos_h2 = (1 + cosine) / 2
    weight = np.where(cosine > 0, cosine / (cos_h2 * (a2 - 1) + 1) ** 2, 0)
    return weight[d[:, 0] < 0].sum() / weight.sum()


@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.8])
def test_the_bright_half_of_a_sky_is_reflected_towards_the_other_side(gpu, tmp_path, roughness):
    """Seen from -x, a level ground reflects the bright half around +x. Seen from +x it reflects the dark half and, the
    rougher it is, the more of the bright one."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[:, 64:] = 3.0
    sky = EnvironmentLight((1, 1, 1), write_environment(tmp_path / "half.exr", pixels))
    seen = {}
    for side in (-1, 1):
        camera = OrthographicCamera((side * 50, 50, 0), (0, 0, 0), up=(0, 1, 0), height=4)
        scene = lit(sky, material=replace(WHITE, roughness=roughness), camera=camera)
        seen[side] = Renderer(scene, Lambert(), (4, 4), gpu).frame(aovs=["specular"]).aovs["specular"].mean()
    dark = seen[1] / (seen[-1] + seen[1])
    assert dark == pytest.approx(share_beyond(roughness, np.pi / 4), abs=0.01)
