"""A cylinder with the layers of a patch rolled around it, and the light that it scatters once, by brute force."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from layered_patch import SCALE, TEXELS, interfaces, material
from scenes import lit
from scipy.ndimage import map_coordinates

from wgsss.scene import DirectionalLight, Mesh, OrthographicCamera, Scene

Array = npt.NDArray[Any]

RADIUS, LENGTH = 8.0, 30.0  # mm
WIDTH = 10.0  # of the picture, mm
AROUND, ALONG = 256, 30  # faces


def cylinder() -> Mesh:
    """Build a closed cylinder along z whose top is at the origin, with texture coordinates in proportion to mm."""
    turn, z = np.linspace(-np.pi, np.pi, AROUND + 1), np.linspace(-LENGTH / 2, LENGTH / 2, ALONG + 1)
    a, along = np.meshgrid(turn[:-1], z)
    side = np.stack([RADIUS * np.sin(a), RADIUS * np.cos(a) - RADIUS, along], axis=-1).reshape(-1, 3)
    ends = [[0, -RADIUS, z[0]], [0, -RADIUS, z[-1]]]
    i, j = (k.ravel() for k in np.meshgrid(np.arange(AROUND), np.arange(ALONG)))
    corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
    quads = [np.stack([corners[k] for k in triple], axis=0) for triple in ((0, 1, 2), (0, 2, 3))]
    grid = np.concatenate([quad.transpose(2, 0, 1) for quad in quads])  # face, corner, i or j
    faces = grid[..., 1] * AROUND + grid[..., 0] % AROUND
    uvs = np.stack([RADIUS * turn[grid[..., 0]], z[grid[..., 1]]], axis=-1) * SCALE + 0.5
    rim, last = np.arange(AROUND), ALONG * AROUND
    following = (rim + 1) % AROUND
    near = np.stack([np.full(AROUND, len(side)), rim, following], axis=1)
    far = np.stack([np.full(AROUND, len(side) + 1), last + following, last + rim], axis=1)
    caps = np.concatenate([near, far])
    return Mesh(
        np.concatenate([side, ends]).astype(np.float32),
        np.concatenate([faces, caps]).astype(np.int32),
        corner_uvs=np.concatenate([uvs, np.zeros((len(caps), 3, 2))]).astype(np.float32),
    )


def rolled(kind: str, light: float) -> Scene:
    """Return a scene of a cylinder seen from above and lit at an angle from there, degrees; eta is 1."""
    a = np.radians(light)
    camera = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=WIDTH)
    sun = DirectionalLight((-np.sin(a), -np.cos(a), 0), (1, 1, 1))
    return lit(sun, mesh=cylinder(), material=material(kind), camera=camera)


def on_a_cylinder(kind: str, light: float, size: int, samples: int = 250) -> Array:
    """Return M of single scattering at the pixels of `rolled`, (size, size, 3)."""
    layers, images = material(kind).layers, interfaces(kind)
    assert layers is not None
    sigma_s, cosines = np.stack([layer.sigma_s for layer in layers]), np.array([layer.g for layer in layers])
    sigma_t = sigma_s + np.stack([layer.sigma_a for layer in layers])
    t = ((np.arange(size) + 0.5) / size - 0.5) * WIDTH
    x, z = np.meshgrid(t, t)
    P = np.stack([x, np.sqrt(RADIUS**2 - x**2), z], axis=-1).reshape(-1, 3)  # about the axis
    to_light, ahead = np.array([np.sin(np.radians(light)), np.cos(np.radians(light)), 0]), np.array([0.0, -1.0, 0.0])

    def layer_of(points: Array) -> Array:
        arc = RADIUS * np.arctan2(points[..., 0], points[..., 1])
        at = (np.stack([points[..., 2], arc]).reshape(2, -1) * SCALE + 0.5) * TEXELS - 0.5
        depth = (RADIUS - np.hypot(points[..., 0], points[..., 1])).ravel()
        below = [depth >= map_coordinates(image, at, order=1, mode="grid-wrap") for image in images]
        return np.sum(below, axis=0).reshape(points.shape[:-1])

    ends = np.minimum(2 * P[:, 1], 12.0)
    shares = -np.log(1 - np.arange(samples + 1) / samples * (1 - np.exp(-5.0))) / 5.0
    total, carried = np.zeros((len(P), 3)), np.ones((len(P), 3))
    fractions = (np.arange(80) + 0.5) / 80
    turn = to_light @ ahead
    for first, last in pairwise(shares):
        step = ((last - first) * ends)[:, None]
        m = P + (0.5 * (first + last) * ends)[:, None] * ahead
        along = m @ to_light
        length = np.sqrt(along**2 + RADIUS**2 - (m[:, :2] ** 2).sum(axis=1)) - along
        met = layer_of(m[:, None] + (length[:, None] * fractions)[..., None] * to_light)
        reached = np.exp(-length[:, None] * sigma_t[met].mean(axis=1))
        layer = layer_of(m)
        g = cosines[layer][:, None]
        phase = (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * turn) ** 1.5)
        half = np.exp(-0.5 * step * sigma_t[layer])
        total += carried * half * step * sigma_s[layer] * phase * reached
        carried *= half**2
    result: Array = np.pi * total.reshape(size, size, 3)
    return result
