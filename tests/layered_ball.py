"""A ball of concentric layers, and the light that it scatters once, by brute force in float64."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from layered_patch import COEFFICIENTS

from wgsss.optics import Layer
from wgsss.scene import DirectionalLight, Material, Object, OrthographicCamera, Scene
from wgsss.scene.shapes import sphere

Array = npt.NDArray[Any]

THICKNESSES = (0.7, 1.2, np.inf)
HEIGHT = 2.2  # of the picture, radii


def ball(radius: float, light: float) -> Scene:
    """Return a scene of a ball seen along -z and lit at an angle from the viewer, degrees; eta is 1."""
    layers = tuple(Layer(a, s, 1.0, thickness=d) for (a, s), d in zip(COEFFICIENTS, THICKNESSES, strict=True))
    a = np.radians(light)
    made = Object(sphere(radius, vertices=4000), Material("ball", layers=layers, specular=0.0))
    sun = DirectionalLight((-np.sin(a), 0.0, -np.cos(a)), (1, 1, 1))
    camera = OrthographicCamera((0, 0, 50), (0, 0, 0), height=HEIGHT * radius)
    return Scene("ball", (made,), (sun,), camera, tone_map="none")


def by_brute_force(scene: Scene, radius: float, size: int, samples: int = 300) -> tuple[Array, Array]:
    """Return M (size, size, 3), and at which pixels it was computed: those within 0.9 radii of the centre."""
    layers, to_light = scene.objects[0].material.layers, -np.array(scene.lights[0].direction)
    assert layers is not None
    t = (2 * (np.arange(size) + 0.5) / size - 1) * HEIGHT * radius / 2
    x, y = np.meshgrid(t, -t)
    inside = np.hypot(x, y) < 0.9 * radius
    P = np.stack([x, y, np.sqrt(np.clip(radius**2 - x**2 - y**2, 0, None))], axis=-1)[inside]
    ahead = np.array([0.0, 0.0, -1.0])
    sigma_s = np.stack([layer.sigma_s for layer in layers])
    sigma_t = sigma_s + np.stack([layer.sigma_a for layer in layers])
    bounds = np.cumsum(THICKNESSES[:-1])

    def layer_of(points: Array) -> Array:
        depth = radius - np.linalg.norm(points, axis=-1)
        return (depth[..., None] >= bounds).sum(axis=-1)

    ends = np.minimum(2 * P[:, 2], 12.0)
    shares = -np.log(1 - np.arange(samples + 1) / samples * (1 - np.exp(-5.0))) / 5.0
    total, carried = np.zeros((len(P), 3)), np.ones((len(P), 3))
    fractions = (np.arange(100) + 0.5) / 100
    for first, last in pairwise(shares):
        step = ((last - first) * ends)[:, None]
        m = P + (0.5 * (first + last) * ends)[:, None] * ahead
        along = m @ to_light
        length = np.sqrt(along**2 + radius**2 - (m * m).sum(axis=1)) - along
        met = layer_of(m[:, None] + (length[:, None] * fractions)[..., None] * to_light)
        reached = np.exp(-length[:, None] * sigma_t[met].mean(axis=1))
        layer = layer_of(m)
        half = np.exp(-0.5 * step * sigma_t[layer])
        total += carried * half * step * sigma_s[layer] / (4 * np.pi) * reached
        carried *= half**2
    result = np.zeros((size, size, 3))
    result[inside] = np.pi * total
    return result, inside
