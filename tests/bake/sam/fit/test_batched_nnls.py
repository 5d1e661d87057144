"""Weights that are not negative, against a solver of one problem at a time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.fit.batched_nnls import batched_nnls


@pytest.mark.parametrize("k", [1, 4, 9])
def test_nearest_of_all_that_are_not_negative(k):
    """Columns that are alike, so that most problems have weights that would be negative, several at once."""
    rng = np.random.default_rng(k)
    columns = rng.random((60, k, 20)) * 0.3 + rng.random((60, 1, 20))
    wanted = np.einsum("bkt,bck->bct", columns, rng.normal(size=(60, 3, k)) + 0.3)
    gram, moment = columns @ columns.transpose(0, 2, 1), columns @ wanted.transpose(0, 2, 1)
    weight = batched_nnls(gram.astype(np.float32), moment.astype(np.float32))
    assert weight.shape == (60, k, 3) and weight.min() == 0.0
    off, best = np.zeros((2, 60, 3))
    for b in range(60):
        for c in range(3):
            best[b, c] = nnls(columns[b].T, wanted[b, c])[1]
            off[b, c] = np.linalg.norm(columns[b].T @ weight[b, :, c] - wanted[b, c])
    assert np.all(off < best + 2e-3 * np.linalg.norm(wanted, axis=2))
    assert off.sum() < best.sum() + 1e-4 * np.linalg.norm(wanted, axis=2).sum()
