"""Refitting of entries to their mixtures, compared with one least squares over all entries."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.fit.refit import refit
from wgsss.bake.sam.sender_map import NeighbourMixture

V, R, N, T, K = 9, 11, 2, 60, 3  # vertices, rows, entries of a row, lights, rows of a mixture


def problem(seed: int) -> tuple[NeighbourMixture, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return mixtures of three rows each, senders and weights, light at 20 senders, and a response by other weights."""
    rng = np.random.default_rng(seed)
    row = (np.arange(V)[:, None] + np.arange(K)) % R
    mixture = NeighbourMixture(
        row.astype(np.int32), rng.uniform(0.2, 0.5, (V, K)).astype(np.float16), np.ones((V, 3), np.float16)
    )
    light = rng.random((20, T)).astype(np.float32)
    sender = np.stack([rng.permutation(20)[:N] for _ in range(R)]).astype(np.int32)
    weight = rng.uniform(0.2, 1.0, (R, N, 3)).astype(np.float32)
    scaled = weight * rng.uniform(0.5, 2.0, (R, N, 1))
    response = mixed(mixture, sender, scaled, light) * rng.normal(1.0, 0.1, (V, T))
    return mixture, sender, weight, light, response.astype(np.float32)


def mixed(mixture: NeighbourMixture, sender: np.ndarray, weight: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return the mixtures (V, T) of the sums of all rows, added over the channels."""
    gathered = np.einsum("vnc,vnt->vt", weight.astype(float), light[sender])
    return np.einsum("vk,vkt->vt", mixture.weight.astype(float), gathered[mixture.row])


def test_repeated_refits_converge_to_the_least_squares_of_all_entries():
    mixture, sender, weight, light, response = problem(1)
    columns = []
    for r in range(R):
        for n in range(N):
            one = np.zeros_like(weight)
            one[r, n] = weight[r, n]
            columns.append(mixed(mixture, sender, one, light).ravel())
    factor, least = nnls(np.stack(columns, axis=1), response.ravel().astype(float))
    assert factor.min() > 0.2, "no factor is at the bound"
    before = weight.copy()
    errors = []
    for _ in range(200):
        refit(mixture, np.arange(V), np.arange(R), sender, weight, light, response)
        errors.append(np.linalg.norm(mixed(mixture, sender, weight, light) - response))
    assert np.all(np.diff(errors) < 1e-6), "the error never grows"
    assert errors[-1] == pytest.approx(least, rel=1e-3)
    np.testing.assert_allclose(weight / before, np.repeat(factor.reshape(R, N, 1), 3, axis=2), rtol=0.03)


def test_empty_rows_and_rows_in_no_mixture_do_not_change():
    mixture, sender, weight, light, response = problem(2)
    mixture.weight[mixture.row == 4] = 0.0
    weight[0] = 0.0
    mixture.row[mixture.row == 0] = 1
    before = weight.copy()
    refit(mixture, np.arange(1, V), np.arange(1, R), sender, weight, light, response)
    np.testing.assert_array_equal(weight[[0, 4]], before[[0, 4]])
    assert np.all(weight[[1, 2, 3, 5, 10]] != before[[1, 2, 3, 5, 10]])


def test_no_entry_is_scaled_to_zero():
    mixture, sender, weight, light, response = problem(3)
    before = weight.copy()
    refit(mixture, np.arange(V), np.arange(R), sender, weight, light, 0.0 * response)
    assert np.all(weight >= 0.0999 * before) and weight.sum() < 0.5 * before.sum()
