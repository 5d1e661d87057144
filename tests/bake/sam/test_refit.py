"""Entries refitted to mixtures, against one least squares over all of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.mix import Mix
from wgsss.bake.sam.refit import refit

V, N, T, K = 9, 2, 60, 3  # vertices, entries of each, lights, vertices of a mixture


def problem(seed: int) -> tuple[Mix, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A mixture of each vertex and the next two, of entries from 20 senders; a response that others would give."""
    rng = np.random.default_rng(seed)
    vertex = (np.arange(V)[:, None] + np.arange(K)) % V
    mix = Mix(vertex.astype(np.int32), rng.uniform(0.2, 0.5, (V, K)).astype(np.float16), np.ones((V, 3), np.float16))
    light = rng.random((20, T)).astype(np.float32)
    sender = np.stack([rng.permutation(20)[:N] for _ in range(V)]).astype(np.int32)
    weight = rng.uniform(0.2, 1.0, (V, N, 3)).astype(np.float32)
    scaled = weight * rng.uniform(0.5, 2.0, (V, N, 1))
    response = mixed(mix, sender, scaled, light) * rng.normal(1.0, 0.1, (V, T))
    return mix, sender, weight, light, response.astype(np.float32)


def mixed(mix: Mix, sender: np.ndarray, weight: np.ndarray, light: np.ndarray) -> np.ndarray:
    gathered = np.einsum("vnc,vnt->vt", weight.astype(float), light[sender])
    return np.einsum("vk,vkt->vt", mix.weight.astype(float), gathered[mix.vertex])


def test_it_comes_to_the_least_squares_of_all_entries_together():
    mix, sender, weight, light, response = problem(1)
    columns = []
    for v in range(V):
        for n in range(N):
            one = np.zeros_like(weight)
            one[v, n] = weight[v, n]
            columns.append(mixed(mix, sender, one, light).ravel())
    factor, least = nnls(np.stack(columns, axis=1), response.ravel().astype(float))
    assert factor.min() > 0.2, "none is at the bound"
    before = weight.copy()
    errors = []
    for _ in range(60):
        refit(mix, np.arange(V), sender, weight, light, response)
        errors.append(np.linalg.norm(mixed(mix, sender, weight, light) - response))
    assert np.all(np.diff(errors) < 1e-6), "no turn makes it worse"
    assert errors[-1] == pytest.approx(least, rel=1e-3)
    np.testing.assert_allclose(weight / before, np.repeat(factor.reshape(V, N, 1), 3, axis=2), rtol=0.03)


def test_who_gathers_nothing_and_who_is_in_no_mixture_stay_as_they_are():
    mix, sender, weight, light, response = problem(2)
    mix.weight[mix.vertex == 4] = 0.0
    weight[0] = 0.0
    mix.vertex[mix.vertex == 0] = 1
    before = weight.copy()
    refit(mix, np.arange(1, V), sender, weight, light, response)
    np.testing.assert_array_equal(weight[[0, 4]], before[[0, 4]])
    assert np.all(weight[[1, 2, 3, 5]] != before[[1, 2, 3, 5]])


def test_no_entry_vanishes():
    mix, sender, weight, light, response = problem(3)
    before = weight.copy()
    refit(mix, np.arange(V), sender, weight, light, 0.0 * response)
    assert np.all(weight >= 0.0999 * before) and weight.sum() < 0.5 * before.sum()
