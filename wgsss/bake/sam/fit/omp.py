"""Orthogonal matching pursuit with nonnegative weights: choose the few senders whose sum approximates a response best.

A response is what a receiver gets under T training lights, a vector of T numbers. Each candidate sender has such a
vector, too: its irradiance under each light. The pursuit adds the candidates one by one and then revises each choice.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.batched_nnls import batched_nnls

Array = npt.NDArray[Any]

ROUNDS = 2
"""number of times that all choices are revised: after two, half of the hardest triples in tests are optimal"""
_MIN_RESIDUAL = 0.01
"""smallest part of a candidate's squared norm that counts as independent of the other choices: less is rounding"""


def omp(candidates: Array, response: Array, n: int) -> tuple[Array, Array]:
    """Choose, for each response, the `n` candidates and weights whose weighted sum is nearest to it in least squares.

    Args:
        candidates: float32 (B, C, T), the vectors of C candidates of B problems; all 0 where there is none.
        response: float32 (B, 3, P, T), P responses of each problem in three colour channels.

    Returns:
        The indices of the chosen candidates, int64 (B, P, n), all different where there are enough, and their weights,
        float32 (B, P, n, 3), at least 0, and 0 where a candidate adds nothing.

    The choice is made for the sum of the channels. Each step takes the candidate that lessens the error most after the
    weights of the others are fitted again (orthogonal least squares, Chen, Billings & Luo 1989). Each choice is then
    revised with all others fixed, ROUNDS times. Finally each channel gets its own weights.
    """
    (B, C, T), P = candidates.shape, response.shape[2]
    rows, count = B * P, min(n, C)
    problem = np.repeat(np.arange(B), P)
    transposed = candidates.transpose(0, 2, 1)
    target = response.sum(axis=1)
    correlation = (target @ transposed).reshape(rows, C)
    square = np.einsum("bct,bct->bc", candidates, candidates)[problem] + np.float32(1e-30)
    chosen = np.zeros((rows, count), np.int64)
    product = np.zeros((rows, count, C), np.float32)
    """the dot products of the chosen candidates with all candidates"""

    def best_addition(slots: Array) -> Array:
        """Return the candidate (rows,) that lessens the error most when added to the choices in some slots."""
        choice, choice_product = chosen[:, slots], product[:, slots]
        residual, independent = correlation, square
        if len(slots):
            weight, gram, _ = fit(choice, choice_product)
            residual = correlation - (weight[:, None] @ choice_product)[:, 0]
            damped = gram + 1e-6 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(len(slots))
            inverse = np.linalg.inv(damped + 1e-30 * np.eye(len(slots))).astype(np.float32)
            projected = inverse @ choice_product
            projected *= choice_product
            independent = np.maximum(square - projected.sum(axis=1), _MIN_RESIDUAL * square)
        gain = np.maximum(residual, 0.0)
        gain *= gain
        gain /= independent
        np.put_along_axis(gain, choice, -1.0, axis=1)
        return gain.argmax(axis=1)

    def fit(choice: Array, choice_product: Array) -> tuple[Array, Array, Array]:
        """Return the weights (rows, k) of choices, their dot products (rows, k, k), and how much they lessen the error.

        `choice_product` (rows, k, C) holds their dot products with all candidates.
        """
        columns = np.broadcast_to(choice[:, None], (*choice.shape, choice.shape[1]))
        gram = np.take_along_axis(choice_product, columns, axis=2)
        moment = np.take_along_axis(correlation, choice, axis=1)
        weight = batched_nnls(gram, moment[..., None])[..., 0]
        gain = 2.0 * (weight * moment).sum(axis=1) - np.einsum("ri,rij,rj->r", weight, gram, weight)
        return weight, gram, gain

    def products(candidate: Array) -> Array:
        """Return the dot products (rows, C) of one candidate of each row (rows,) with all candidates."""
        return (candidates[problem, candidate].reshape(B, P, T) @ transposed).reshape(rows, C)

    for k in range(count):
        chosen[:, k] = best_addition(np.arange(k))
        product[:, k] = products(chosen[:, k])
    gain = fit(chosen, product)[2]
    for k in ROUNDS * list(range(count)) if count > 1 else ():
        other = best_addition(np.delete(np.arange(count), k))
        revised, revised_product = chosen.copy(), product.copy()
        revised[:, k], revised_product[:, k] = other, products(other)
        revised_gain = fit(revised, revised_product)[2]
        is_better = (revised_gain > gain) & (other != chosen[:, k])
        chosen[is_better], product[is_better] = revised[is_better], revised_product[is_better]
        gain[is_better] = revised_gain[is_better]
    support = candidates[problem[:, None], chosen]
    channels = response.transpose(0, 2, 3, 1).reshape(rows, T, 3)
    weights = batched_nnls(fit(chosen, product)[1], support @ channels)
    padding = ((0, 0), (0, 0), (0, n - count))
    return np.pad(chosen.reshape(B, P, count), padding), np.pad(weights.reshape(B, P, count, 3), (*padding, (0, 0)))
