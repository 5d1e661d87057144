"""Which few senders stand for many: orthogonal matching pursuit with weights that are not negative."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.sam.fit.batched_nnls import batched_nnls

Array = npt.NDArray[Any]

ROUNDS = 2
"""times that each choice is made once more; of the worst triples, one in two is then the best that there is"""
_OWN = 0.01
"""of a candidate's square, at least, that counts as not told by the other choices: less is rounding"""


def omp(seen: Array, response: Array, n: int) -> tuple[Array, Array]:
    """The `n` candidates, and their weights, by whose sum a response is nearest in the least squares.

    Args:
        seen: float32 (B, C, T), T numbers for each of C candidates of B problems; all 0 where there is none.
        response: float32 (B, 3, P, T), those of P responses in three channels.

    Returns:
        int64 (B, P, n), of the candidates, different ones where there are as many, and float32 (B, P, n, 3), their
        weights: at least 0, and 0 where a candidate adds nothing.

    They are chosen for the sum of the channels, each by how much it lessens the error if the weights of the others
    follow (orthogonal least squares, Chen, Billings & Luo 1989); then each choice is made anew, the others being known,
    ROUNDS times. The weights are each channel's own.
    """
    (B, C, T), P = seen.shape, response.shape[2]
    rows, count = B * P, min(n, C)
    problem = np.repeat(np.arange(B), P)
    across = seen.transpose(0, 2, 1)
    goal = response.sum(axis=1)
    wanted = (goal @ across).reshape(rows, C)
    square = np.einsum("bct,bct->bc", seen, seen)[problem] + np.float32(1e-30)
    chosen = np.zeros((rows, count), np.int64)
    product = np.zeros((rows, count, C), np.float32)
    """of what was chosen with all candidates"""

    def best(others: Array) -> Array:
        """The candidate (rows,) that adds most to what was chosen in some of the places."""
        there, by = chosen[:, others], product[:, others]
        left, own = wanted, square
        if len(others):
            weight, gram, _ = fitted(there, by)
            left = wanted - (weight[:, None] @ by)[:, 0]
            damped = gram + 1e-6 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(len(others))
            told = np.linalg.inv(damped + 1e-30 * np.eye(len(others))).astype(np.float32) @ by
            told *= by
            own = np.maximum(square - told.sum(axis=1), _OWN * square)
        score = np.maximum(left, 0.0)
        score *= score
        score /= own
        np.put_along_axis(score, there, -1.0, axis=1)
        return score.argmax(axis=1)

    def fitted(there: Array, by: Array) -> tuple[Array, Array, Array]:
        """Weights (rows, k) of choices, their products with each other, and by how much they lessen the error."""
        gram = np.take_along_axis(by, np.broadcast_to(there[:, None], (*there.shape, there.shape[1])), axis=2)
        moment = np.take_along_axis(wanted, there, axis=1)
        weight = batched_nnls(gram, moment[..., None])[..., 0]
        gain = 2.0 * (weight * moment).sum(axis=1) - np.einsum("ri,rij,rj->r", weight, gram, weight)
        return weight, gram, gain

    def products(which: Array) -> Array:
        return (seen[problem, which].reshape(B, P, T) @ across).reshape(rows, C)

    for k in range(count):
        chosen[:, k] = best(np.arange(k))
        product[:, k] = products(chosen[:, k])
    gain = fitted(chosen, product)[2]
    for k in ROUNDS * list(range(count)) if count > 1 else ():
        other = best(np.delete(np.arange(count), k))
        there, by = chosen.copy(), product.copy()
        there[:, k], by[:, k] = other, products(other)
        now = fitted(there, by)[2]
        better = (now > gain) & (other != chosen[:, k])
        chosen[better], product[better], gain[better] = there[better], by[better], now[better]
    support = seen[problem[:, None], chosen]
    of_channels = response.transpose(0, 2, 3, 1).reshape(rows, T, 3)
    weights = batched_nnls(fitted(chosen, product)[1], support @ of_channels)
    missing = ((0, 0), (0, 0), (0, n - count))
    return np.pad(chosen.reshape(B, P, count), missing), np.pad(weights.reshape(B, P, count, 3), (*missing, (0, 0)))
