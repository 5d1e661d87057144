"""The training lights and their principal components."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.fit.training import (
    COMPONENTS,
    SKIES,
    SKY_WEIGHT,
    SUNS,
    UNIFORM_WEIGHT,
    compressed,
    training_lights,
)
from wgsss.scene.geometry import fibonacci_sphere
from wgsss.scene.mesh import Mesh
from wgsss.scene.shapes import sphere


def two_balls() -> Mesh:
    """Return a small ball and a large one to its right, which casts a shadow on it for light from the right."""
    small, large = sphere(1.0, 100), sphere(4.0, 200)
    return Mesh(
        np.concatenate([small.positions, large.positions + np.array([8.0, 0.0, 0.0])]),
        np.concatenate([small.faces, large.faces + len(small.positions)]),
    )


def test_suns_cast_shadows():
    mesh = two_balls()
    n, small = mesh.normals, np.arange(len(mesh.positions)) < len(sphere(1.0, 100).positions)
    towards = fibonacci_sphere(SUNS)
    light = training_lights(mesh)[:SUNS]
    right, left = np.argmax(towards[:, 0]), np.argmin(towards[:, 0])
    assert not light[right][small].any()
    np.testing.assert_allclose(light[left][small], np.maximum(n[small] @ towards[left], 0.0), atol=1e-5)
    np.testing.assert_allclose(light[right][~small], np.maximum(n[~small] @ towards[right], 0.0), atol=1e-5)


def test_skies_and_uniform_light_reach_every_vertex():
    lights = training_lights(two_balls())
    assert lights.shape[0] == SUNS + SKIES + 1
    np.testing.assert_allclose(lights[-1], UNIFORM_WEIGHT)
    skies = lights[SUNS:-1] / SKY_WEIGHT
    assert skies.min() >= 0.0 and skies.max() <= 1.0 + 1e-6
    np.testing.assert_allclose(skies.mean(axis=0), 0.5, atol=0.02)  # half of every sky is above


def test_compressed_lights_have_the_same_dot_products():
    """The dot products of smooth means over parts of the surface are nearly those under all lights."""
    mesh = two_balls()
    lights, V = training_lights(mesh), len(mesh.positions)
    few = compressed(lights, np.ones(V))
    assert few.shape == (V, COMPONENTS)
    nearness = np.exp(-np.square(mesh.positions[::40, None] - mesh.positions).sum(axis=2) / 2.0)
    means = nearness / nearness.sum(axis=1, keepdims=True)
    products = (means @ lights.T) @ (means @ lights.T).T
    np.testing.assert_allclose((means @ few) @ (means @ few).T, products, rtol=2e-3)
    weighted = compressed(lights, np.where(np.arange(V) == 7, 1e6, 1.0))
    np.testing.assert_allclose(np.square(weighted[7]).sum(), np.square(lights[:, 7]).sum(), rtol=1e-4)
