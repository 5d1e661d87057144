"""A level patch of layers whose thickness varies, and the light that it scatters once, by brute force in float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scenes import lit, plane
from scipy.ndimage import map_coordinates

from wgsss.optics import Layer
from wgsss.scene import DirectionalLight, Material, OrthographicCamera, Scene
from wgsss.scene.material import LayerMaps, Maps
from wgsss.view import view_of

Array = npt.NDArray[Any]

SIDE = 40.0  # mm, of the patch
TEXELS = 512  # of the maps
SCALE = 0.98 / SIDE  # of texture coordinates, 1/mm: those of scenes.plane
COEFFICIENTS = (
    ((0.1, 0.1, 0.2), (0.7, 0.6, 0.5)),
    ((1.2, 1.6, 2.0), (0.8, 0.4, 0.4)),
    ((0.3, 0.3, 0.4), (0.9, 0.9, 0.8)),
)
"""sigma_a and sigma_s of the layers, 1/mm"""
MEAN_COSINES = (0.0, 0.3, 0.0)
KINDS = ("flat", "gentle", "blobs", "veins")


def interfaces(kind: str) -> Array:
    """Return the depths of the two interfaces, mm, (2, TEXELS, TEXELS)."""
    t = ((np.arange(TEXELS) + 0.5) / TEXELS - 0.5) / 0.98 * SIDE
    x, z = np.meshgrid(t, t)
    period = SIDE / 0.98
    wave = [2 * np.pi * k / period for k in (7, 9)]
    if kind == "flat":
        return np.stack([np.full_like(x, 0.7), np.full_like(x, 1.9)])
    if kind == "gentle":
        first = 0.8 + 0.35 * np.sin(wave[0] * x) * np.cos(wave[1] * z)
        return np.stack([first, first + 0.7 + 0.3 * np.cos(wave[1] * x + 1) * np.sin(wave[0] * z)])
    if kind == "blobs":
        bump = np.sin(wave[0] * x) * np.sin(wave[1] * z)
        first = 1.4 * np.clip(bump, 0, None) ** 0.75
        return np.stack([first, first + 0.6])
    spacing = period / 16  # veins: tubes of radius 0.35 mm, 0.9 mm deep
    off = (x + 0.4 * np.sin(wave[0] * z)) / spacing
    half = np.sqrt(np.clip(0.35**2 - ((off - np.round(off)) * spacing) ** 2, 0, None))
    return np.stack([0.9 - half, 0.9 + half])


def material(kind: str, eta: float = 1.0, **fields: Any) -> Material:
    """Return the material of a patch."""
    depths = interfaces(kind)
    thickness = np.stack([depths[0], depths[1] - depths[0]])
    whites = thickness.max(axis=(1, 2))
    layers = [
        Layer(a, np.asarray(s) * (1 - g), eta, thickness=d, g=g)
        for (a, s), g, d in zip(COEFFICIENTS, MEAN_COSINES, (*whites, np.inf), strict=True)
    ]
    images = [np.round(65535 * t / white).astype(np.uint16) for t, white in zip(thickness, whites, strict=True)]
    maps = Maps(layers=(*(LayerMaps(thickness=image) for image in images), LayerMaps()))
    return Material(kind, layers=tuple(layers), maps=maps, **{"specular": 0.0, **fields})


def patch(kind: str, light: float, view: float = 30.0, eta: float = 1.0) -> Scene:
    """Return a scene of a patch, lit and seen at angles from its normal, degrees, in one plane and from one side."""
    a, b = np.radians(light), np.radians(view)
    camera = OrthographicCamera(
        (50 * np.sin(b), 50 * np.cos(b), 0), (0, 0, 0), up=(0, 0, -1), height=10 if view < 70 else 4
    )
    sun = DirectionalLight((-np.sin(a), -np.cos(a), 0), (1, 1, 1))
    return lit(sun, mesh=plane(SIDE), material=material(kind, eta), camera=camera)


def brute_force(scene: Scene, size: int, view_samples: int = 200, light_samples: int = 60) -> Array:
    """Return M of single scattering at the pixels of a patch without reflection, (size, size, 3)."""
    made = scene.objects[0].material
    layers = made.layers
    assert layers is not None
    eta, maps = made.eta, [one.thickness for one in made.maps.layers[:-1]]
    images = np.cumsum([lay.thickness * m / 65535.0 for lay, m in zip(layers[:-1], maps, strict=True)], axis=0)
    sigma_t = np.stack([lay.sigma_a + lay.sigma_s for lay in layers])
    view = view_of(scene, 1.0)
    w_o, w_i = np.array(view.eye[:3]), -np.array(scene.lights[0].direction)
    inside_o, inside_i = (np.array([w[0] / eta, np.sqrt(1 - (w[0] / eta) ** 2), 0.0]) for w in (w_o, w_i))
    t = 2 * (np.arange(size) + 0.5) / size - 1
    ndc = np.stack([*np.meshgrid(t, -t), np.full((size, size), 0.5), np.ones((size, size))], -1)
    x = (ndc @ view.clip_to_world.T)[..., :3]
    P = (x - w_o * (x[..., 1] / w_o[1])[..., None]).reshape(-1, 3)

    def layer_of(points: Array) -> Array:
        uv = points[..., ::2] * SCALE + 0.5
        at = np.stack([uv[..., 1], uv[..., 0]]).reshape(2, -1) * TEXELS - 0.5
        depth = -points[..., 1].ravel()
        below = [depth >= map_coordinates(image, at, order=1, mode="grid-wrap") for image in images]
        return np.sum(below, axis=0).reshape(points.shape[:-1])

    edges = -np.log(1 - np.arange(view_samples + 1) / view_samples * (1 - np.exp(-9.0))) / 9.0 * 18.0 / inside_o[1]
    middles, steps = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    cosine = -float(inside_i @ inside_o)
    total, carried = np.zeros((len(P), 3)), np.ones((len(P), 3))
    fractions = (np.arange(light_samples) + 0.5) / light_samples
    for middle, step in zip(middles, steps, strict=True):
        m = P - middle * inside_o
        layer = layer_of(m)
        length = middle * inside_o[1] / inside_i[1]
        met = layer_of(m[:, None] + length * fractions[:, None] * inside_i)
        to_light = length * sigma_t[met].mean(axis=1)
        g, sigma_s = np.array([lay.g for lay in layers])[layer], np.stack([lay.sigma_s for lay in layers])[layer]
        phase = (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * cosine) ** 1.5)
        half = np.exp(-0.5 * step * sigma_t[layer])
        mean = -np.expm1(-step * sigma_t[layer]) / (step * sigma_t[layer]) / half  # of exp over the step
        total += carried * half * mean * step * sigma_s * phase[:, None] * np.exp(-to_light)
        carried *= half**2
    entering = w_i[1] / inside_i[1]
    result: Array = np.pi / eta**2 * entering * total.reshape(size, size, 3)
    return result


def relative_error(estimate: Array, exact: Array) -> float:
    """Return the root mean square error over that of the exact values, of the worst channel."""
    errors = np.sqrt(((estimate - exact) ** 2).mean(axis=(0, 1)) / (exact**2).mean(axis=(0, 1)))
    return float(errors.max())
