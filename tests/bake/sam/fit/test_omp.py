"""Orthogonal matching pursuit, compared with known solutions and with a search through all pairs or triples."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.fit.omp import omp

RNG = np.random.default_rng(5)


def problem(candidates: np.ndarray, response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return candidates (C, T) and responses (P, T, 3) in the form that `omp` takes, as a batch of one problem."""
    return candidates[None].astype(np.float32), response.transpose(2, 0, 1)[None].astype(np.float32)


def squared_error(candidates: np.ndarray, response: np.ndarray, chosen: np.ndarray, weight: np.ndarray) -> float:
    return float(np.square(np.einsum("kt,kc->tc", candidates[chosen], weight) - response).sum())


def least_squared_error(candidates: np.ndarray, response: np.ndarray, support: tuple[int, ...]) -> float:
    """Return the smallest squared error by nonnegative weights of the candidates of a support."""
    return sum(nnls(candidates[list(support)].T, response[:, c])[1] ** 2 for c in range(3))


def test_the_candidates_that_a_response_is_a_sum_of_are_found():
    candidates = RNG.random((30, 80))
    weights = np.array([[0.5, 0.2, 0.1], [0.3, 0.3, 0.0], [0.7, 0.0, 0.4]])
    response = np.einsum("kt,kc->tc", candidates[[4, 11, 27]], weights)[None]
    chosen, weight = omp(*problem(candidates, response), 3)
    order = np.argsort(chosen[0, 0])
    assert chosen[0, 0][order].tolist() == [4, 11, 27]
    np.testing.assert_allclose(weight[0, 0][order], weights, atol=2e-3)


def test_pairs_are_nearly_optimal_and_weights_nonnegative():
    candidates = RNG.random((14, 40)) ** 3
    response = np.einsum(
        "pc,ctk->ptk", RNG.random((12, 14)) ** 4, np.repeat(candidates[..., None], 3, 2) * RNG.random((14, 1, 3))
    )
    chosen, weight = omp(*problem(candidates, response), 2)
    assert weight.min() >= 0.0 and np.all(chosen[0, :, 0] != chosen[0, :, 1])
    ratios = []
    for p in range(12):
        best = min(least_squared_error(candidates, response[p], pair) for pair in combinations(range(14), 2))
        ratios.append(squared_error(candidates, response[p], chosen[0, p], weight[0, p]) / best)
    assert np.median(ratios) < 1.01 and np.mean(ratios) < 1.3


def test_triples_of_similar_candidates_are_nearly_optimal():
    """Means over parts of a surface overlap, so what a candidate adds depends on the other ones chosen."""
    rng = np.random.default_rng(5)
    x = np.linspace(0.0, 1.0, 60)
    width = rng.choice([0.05, 0.15, 0.4], 24)
    candidates = np.exp(-np.square((x - rng.random(24)[:, None]) / width[:, None])) + 0.3
    response = np.repeat((rng.random((20, 24)) ** 6 @ candidates)[..., None], 3, axis=2)
    chosen, weight = omp(*problem(candidates, response), 3)
    ratios = []
    for p in range(20):
        best = min(least_squared_error(candidates, response[p], triple) for triple in combinations(range(24), 3))
        ratios.append(squared_error(candidates, response[p], chosen[0, p], weight[0, p]) / best)
    assert np.median(ratios) < 1.02 and np.mean(ratios) < 1.5


@pytest.mark.parametrize("n", [2, 3])
def test_weights_are_optimal_for_the_chosen_candidates(n):
    """With similar candidates, unconstrained least squares would have negative weights."""
    candidates = RNG.random((8, 30)) * 0.1 + RNG.random(30)
    response = (candidates[0] * 3.0 - candidates[1])[None, :, None] * np.ones(3)
    chosen, weight = omp(*problem(candidates, np.maximum(response, 0.0)), n)
    error = squared_error(candidates, np.maximum(response[0], 0.0), chosen[0, 0], weight[0, 0])
    assert error < 1.05 * least_squared_error(candidates, np.maximum(response[0], 0.0), tuple(chosen[0, 0])) + 1e-6
    assert weight.min() >= 0.0


def test_revising_the_choices_corrects_the_first_one():
    """The first candidate is nearest to the response, but the response is the sum of the two others."""
    a, b = np.eye(6)[0], np.eye(6)[1]
    candidates = np.stack([a + b + np.eye(6)[2], a, b])
    chosen, weight = omp(*problem(candidates, (a + b)[None, :, None] * np.ones(3)), 2)
    assert set(chosen[0, 0]) == {1, 2}
    np.testing.assert_allclose(weight, 1.0, atol=1e-3)


def test_with_fewer_candidates_than_n_the_rest_of_the_weights_are_zero():
    candidates = np.eye(4)[:2]
    chosen, weight = omp(*problem(candidates, candidates[:1, :, None] * np.ones(3)), 5)
    assert chosen.shape == (1, 1, 5) and weight.shape == (1, 1, 5, 3)
    np.testing.assert_allclose(weight.sum(axis=2), 1.0, atol=1e-3)
