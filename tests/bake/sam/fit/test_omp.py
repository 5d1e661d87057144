"""Matching pursuit against what it must find, and a search through all pairs."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.fit.omp import omp

RNG = np.random.default_rng(5)


def problem(seen: np.ndarray, response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of candidates (C, T) and responses (P, T, 3), as one batch."""
    return seen[None].astype(np.float32), response.transpose(2, 0, 1)[None].astype(np.float32)


def error(seen: np.ndarray, response: np.ndarray, chosen: np.ndarray, weight: np.ndarray) -> float:
    return float(np.square(np.einsum("kt,kc->tc", seen[chosen], weight) - response).sum())


def best_of(seen: np.ndarray, response: np.ndarray, support: tuple[int, ...]) -> float:
    """The least squared error with a support, by weights that are not negative."""
    return sum(nnls(seen[list(support)].T, response[:, c])[1] ** 2 for c in range(3))


def test_finds_what_a_response_is_made_of():
    seen = RNG.random((30, 80))
    weights = np.array([[0.5, 0.2, 0.1], [0.3, 0.3, 0.0], [0.7, 0.0, 0.4]])
    response = np.einsum("kt,kc->tc", seen[[4, 11, 27]], weights)[None]
    chosen, found = omp(*problem(seen, response), 3)
    order = np.argsort(chosen[0, 0])
    assert chosen[0, 0][order].tolist() == [4, 11, 27]
    np.testing.assert_allclose(found[0, 0][order], weights, atol=2e-3)


def test_choices_are_nearly_the_best_pairs_and_never_negative():
    seen = RNG.random((14, 40)) ** 3
    response = np.einsum(
        "pc,ctk->ptk", RNG.random((12, 14)) ** 4, np.repeat(seen[..., None], 3, 2) * RNG.random((14, 1, 3))
    )
    chosen, weight = omp(*problem(seen, response), 2)
    assert weight.min() >= 0.0 and np.all(chosen[0, :, 0] != chosen[0, :, 1])
    ratios = []
    for p in range(12):
        best = min(best_of(seen, response[p], pair) for pair in combinations(range(14), 2))
        ratios.append(error(seen, response[p], chosen[0, p], weight[0, p]) / best)
    assert np.median(ratios) < 1.01 and np.mean(ratios) < 1.3


def test_triples_of_candidates_that_are_much_alike():
    """Means over parts of a surface overlap: what a candidate adds is not what it alone would tell."""
    rng = np.random.default_rng(5)
    x = np.linspace(0.0, 1.0, 60)
    width = rng.choice([0.05, 0.15, 0.4], 24)
    seen = np.exp(-np.square((x - rng.random(24)[:, None]) / width[:, None])) + 0.3
    response = np.repeat((rng.random((20, 24)) ** 6 @ seen)[..., None], 3, axis=2)
    chosen, weight = omp(*problem(seen, response), 3)
    ratios = []
    for p in range(20):
        best = min(best_of(seen, response[p], triple) for triple in combinations(range(24), 3))
        ratios.append(error(seen, response[p], chosen[0, p], weight[0, p]) / best)
    assert np.median(ratios) < 1.02 and np.mean(ratios) < 1.5


@pytest.mark.parametrize("n", [2, 3])
def test_weights_are_the_best_of_their_support(n):
    """Among candidates that are alike, least squares alone would make weights negative."""
    seen = RNG.random((8, 30)) * 0.1 + RNG.random(30)
    response = (seen[0] * 3.0 - seen[1])[None, :, None] * np.ones(3)
    chosen, weight = omp(*problem(seen, np.maximum(response, 0.0)), n)
    found = error(seen, np.maximum(response[0], 0.0), chosen[0, 0], weight[0, 0])
    assert found < 1.05 * best_of(seen, np.maximum(response[0], 0.0), tuple(chosen[0, 0])) + 1e-6
    assert weight.min() >= 0.0


def test_a_second_look_mends_a_first_choice():
    """One candidate is nearest to the sum of two others, which together are the response."""
    a, b = np.eye(6)[0], np.eye(6)[1]
    seen = np.stack([a + b + np.eye(6)[2], a, b])
    chosen, weight = omp(*problem(seen, (a + b)[None, :, None] * np.ones(3)), 2)
    assert set(chosen[0, 0]) == {1, 2}
    np.testing.assert_allclose(weight, 1.0, atol=1e-3)


def test_fewer_candidates_than_asked_for():
    seen = np.eye(4)[:2]
    chosen, weight = omp(*problem(seen, seen[:1, :, None] * np.ones(3)), 5)
    assert chosen.shape == (1, 1, 5) and weight.shape == (1, 1, 5, 3)
    np.testing.assert_allclose(weight.sum(axis=2), 1.0, atol=1e-3)
