"""Batched nonnegative least squares, compared with a solver of single problems."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.fit.batched_nnls import batched_nnls


@pytest.mark.parametrize("k", [1, 4, 9])
def test_weights_have_the_smallest_error_of_all_nonnegative_ones(k):
    """The columns are similar, so that unconstrained least squares has several negative weights in most problems."""
    rng = np.random.default_rng(k)
    columns = rng.random((60, k, 20)) * 0.3 + rng.random((60, 1, 20))
    target = np.einsum("bkt,bck->bct", columns, rng.normal(size=(60, 3, k)) + 0.3)
    gram, moment = columns @ columns.transpose(0, 2, 1), columns @ target.transpose(0, 2, 1)
    weight = batched_nnls(gram.astype(np.float32), moment.astype(np.float32))
    assert weight.shape == (60, k, 3) and weight.min() == 0.0
    error, best = np.zeros((2, 60, 3))
    for b in range(60):
        for c in range(3):
            best[b, c] = nnls(columns[b].T, target[b, c])[1]
            error[b, c] = np.linalg.norm(columns[b].T @ weight[b, :, c] - target[b, c])
    assert np.all(error < best + 2e-3 * np.linalg.norm(target, axis=2))
    assert error.sum() < best.sum() + 1e-4 * np.linalg.norm(target, axis=2).sum()
