"""Mixtures of what neighbours gather, against least squares one by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.mix import Mix, mix

RNG = np.random.default_rng(11)
LINE = np.column_stack([np.arange(12.0), np.zeros((12, 2))])
UP = np.tile((0.0, 0.0, 1.0), (12, 1))


def line(seen: np.ndarray, wanted: np.ndarray, even: np.ndarray, total: np.ndarray) -> Mix:
    """Of vertices in a row, one mm apart."""
    return mix(LINE, UP, 1.0, even, lambda v: seen[v].astype(np.float32), wanted.astype(np.float32), total)


def test_weights_are_the_best_of_those_that_are_not_negative():
    wanted = RNG.random((12, 40)) + np.linspace(1.0, 3.0, 40)
    seen = wanted * (1.0 + 0.4 * RNG.normal(size=(12, 40)))
    found = line(seen, wanted, np.ones((12, 3)), np.ones((12, 3)))
    for v in range(12):
        chosen = found.vertex[v]
        assert chosen[0] == v and set(chosen) == set(np.argsort(np.abs(np.arange(12) - v), kind="stable")[:7]) | set(
            chosen
        )
        assert np.abs(chosen - v).max() <= 6
        best = nnls(seen[chosen].T, wanted[v])[1]
        off = np.linalg.norm(found.weight[v].astype(float) @ seen[chosen] - wanted[v])
        assert best <= off < 1.02 * best
        assert off < 0.7 * np.linalg.norm(seen[v] - wanted[v])


def test_parts_are_alike_where_neighbours_are_and_as_large_as_what_is_wanted():
    """Where all see the same light, each adds as much, however strong it is: not what is near a bright spot."""
    size = np.geomspace(1.0, 1e2, 12)
    seen = size[:, None] * np.linspace(1.0, 2.0, 9)
    found = line(seen, seen, np.ones((12, 3)), np.ones((12, 3)))
    parts = found.weight.astype(float) * size[found.vertex] / size[:, None]
    inner = size[found.vertex].min(axis=1) / size > 0.04
    np.testing.assert_allclose(parts, 1.0 / 7.0, rtol=0.05)
    assert inner.all()


def test_even_light_is_what_it_should_be_in_each_channel():
    even, total = RNG.random((12, 3)) + 0.5, RNG.random((12, 3)) + 0.5
    seen = RNG.random((12, 20)) + 0.2
    found = line(seen, seen, even, total)
    np.testing.assert_allclose(found.of(even), total, rtol=2e-3)  # halves
    both = found.of(np.stack([even, 2.0 * even], axis=1))
    np.testing.assert_allclose(both, np.stack([total, 2.0 * total], axis=1), rtol=2e-3)


def test_who_gathers_nothing_neither_lends_nor_borrows():
    even = np.ones((12, 3)) * (np.arange(12) % 3 > 0)[:, None]
    seen = RNG.random((12, 20)) * even[:, :1]
    found = line(seen, seen, even, even)
    none = np.flatnonzero(~even.any(axis=1))
    assert not found.weight[none].any() and np.isin(found.vertex[even.any(axis=1)], none).sum() == 0
    nobody = line(seen, seen, 0.0 * even, even)
    assert not nobody.weight.any()


def test_opposite_sides_do_not_mix():
    n = UP * np.where(np.arange(12) % 2, 1.0, -1.0)[:, None]
    x = LINE * 0.5
    seen = RNG.random((12, 30)) + 0.5
    found = mix(
        x, n, 1.0, np.ones((12, 3)), lambda v: seen[v].astype(np.float32), seen.astype(np.float32), np.ones((12, 3))
    )
    near = np.abs(found.vertex[:, :3] - np.arange(12)[:, None])
    assert np.all(near % 2 == 0)


def test_fewer_vertices_than_neighbours():
    seen = RNG.random((2, 10)).astype(np.float32)
    found = mix(LINE[:2], UP[:2], 1.0, np.ones((2, 3)), lambda v: seen[v], seen, np.ones((2, 3)))
    assert found.vertex.shape == (2, 7) and not found.weight[:, 2:].any()
    np.testing.assert_allclose(found.weight[:, 0], 1.0, atol=0.1)
    with pytest.raises(IndexError):
        found.of(np.ones((1, 3)))
