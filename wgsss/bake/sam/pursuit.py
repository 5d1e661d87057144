"""Which few senders stand for many: orthogonal matching pursuit with weights that are not negative."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

_DAMPING = 1e-4  # of the mean square of a support: two senders that see the same light share it
_SWEEPS = 32  # of coordinate descent where a weight would be negative


def pursue(gram: Array, moment: Array, n: int) -> tuple[Array, Array]:
    """The `n` candidates, and their weights, by whose sum a response is nearest in the least squares.

    Args:
        gram: float32 (B, C, C), the products of C candidates with each other, of B problems; all 0 where there is none.
        moment: float32 (B, P, C, 3), the products of candidates with P responses in three channels.

    Returns:
        int64 (B, P, n), of the candidates, different ones where there are as many, and float32 (B, P, n, 3), their
        weights: at least 0, and 0 where a candidate adds nothing.

    Batch-OMP (Rubinstein et al. 2008) with one support for the channels; then each choice is made once more, the others
    being known.
    """
    B, P, C, _ = moment.shape
    square = np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-30)[:, None]
    chosen = np.zeros((B, P, 0), np.int64)
    weight = np.zeros((B, P, 0, 3), np.float32)

    def add(kept: Array, weight: Array) -> tuple[Array, Array, Array]:
        left = moment - _seen(gram, kept, weight)
        useful = np.maximum(left, 0.0)
        score = np.einsum("bpck,bpck->bpc", useful, useful) / square
        np.put_along_axis(score, kept, -1.0, axis=2)
        grown = np.concatenate([kept, score.argmax(axis=2)[..., None]], axis=2)
        return grown, *_solve(gram, moment, grown)

    gained = np.zeros((B, P))
    for _ in range(min(n, C)):
        chosen, weight, gained = add(chosen, weight)
    for k in range(min(n, C) if n > 1 else 0):
        kept = np.delete(chosen, k, axis=2)
        other, other_weight, other_gained = add(kept, _solve(gram, moment, kept)[0])
        better = other_gained > gained
        # The others keep their places, so that each is asked once.
        other = np.insert(other[..., :-1], k, other[..., -1], axis=2)
        other_weight = np.insert(other_weight[..., :-1, :], k, other_weight[..., -1, :], axis=2)
        chosen = np.where(better[..., None], other, chosen)
        weight = np.where(better[..., None, None], other_weight, weight)
        gained = np.maximum(gained, other_gained)
    missing = n - chosen.shape[2]
    return np.pad(chosen, ((0, 0), (0, 0), (0, missing))), np.pad(weight, ((0, 0), (0, 0), (0, missing), (0, 0)))


def _seen(gram: Array, chosen: Array, weight: Array) -> Array:
    """What of the moments (B, P, C, 3) the chosen ones account for."""
    B, P, k = chosen.shape
    rows = gram[np.arange(B)[:, None, None], chosen].reshape(B * P, k, gram.shape[1])
    return (rows.transpose(0, 2, 1) @ weight.reshape(B * P, k, 3)).reshape(B, P, gram.shape[1], 3)


def _solve(gram: Array, moment: Array, chosen: Array) -> tuple[Array, Array]:
    """Weights (B, P, k, 3) of chosen candidates, none negative, and by how much they lessen squared errors (B, P)."""
    B, P, k = chosen.shape
    problem = np.arange(B)[:, None, None, None]
    G = gram[problem, chosen[..., None], chosen[..., None, :]].reshape(B * P, k, k)
    b = np.take_along_axis(moment, chosen[..., None], axis=2).reshape(B * P, k, 3)
    if not k:
        return np.zeros((B, P, 0, 3), np.float32), np.zeros((B, P))
    damped = G + (_DAMPING * np.trace(G, axis1=1, axis2=2) / k + 1e-30)[:, None, None] * np.eye(k, dtype=np.float32)
    weight = np.linalg.solve(damped, b)
    wrong = np.flatnonzero((weight < 0.0).any(axis=(1, 2)))
    if len(wrong):
        g, r = damped[wrong], b[wrong]
        w = np.zeros_like(r)  # from nothing it only grows better; senders that see nearly the same would start afar
        for _ in range(_SWEEPS):
            for j in range(k):
                others = np.einsum("rk,rkc->rc", g[:, j], w) - g[:, j, j, None] * w[:, j]
                w[:, j] = np.maximum((r[:, j] - others) / g[:, j, j, None], 0.0)
        weight[wrong] = w
    gained = 2.0 * (b * weight).sum(axis=(1, 2)) - np.einsum("rkc,rkj,rjc->r", weight, G, weight)
    return weight.reshape(B, P, k, 3).astype(np.float32), gained.reshape(B, P)
