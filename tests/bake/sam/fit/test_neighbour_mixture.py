"""Mixtures of what neighbours gather, against least squares one by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from wgsss.bake.sam.fit.neighbour_mixture import fit_tint, neighbour_mixture
from wgsss.bake.sam.sender_map import NeighbourMixture

RNG = np.random.default_rng(11)
LINE = np.column_stack([np.arange(12.0), np.zeros((12, 2))])
UP = np.tile((0.0, 0.0, 1.0), (12, 1))
EVERY = np.arange(12)


def line(seen: np.ndarray, wanted: np.ndarray, rows: np.ndarray = EVERY, owner: np.ndarray = EVERY) -> NeighbourMixture:
    """Of vertices in a line, one mm apart."""
    return neighbour_mixture(
        LINE, UP, 1.0, owner, rows, lambda r: seen[r].astype(np.float32), wanted.astype(np.float32)
    )


def test_weights_are_the_best_of_those_that_are_not_negative():
    wanted = RNG.random((12, 40)) + np.linspace(1.0, 3.0, 40)
    seen = wanted * (1.0 + 0.4 * RNG.normal(size=(12, 40)))
    found = line(seen, wanted)
    for v in range(12):
        chosen = found.row[v]
        assert chosen[0] == v and len(set(chosen)) == 7
        best = nnls(seen[chosen].T, wanted[v])[1]
        off = np.linalg.norm(found.weight[v].astype(float) @ seen[chosen] - wanted[v])
        assert best <= off < 1.02 * best
        assert off < 0.7 * np.linalg.norm(seen[v] - wanted[v])


def test_those_are_chosen_that_help_most():
    """One of four sees all that is wanted; a vertex between reads it, however many are nearer."""
    wanted = np.tile(RNG.random(40) + np.linspace(1.0, 3.0, 40), (12, 1))
    seen = np.where((EVERY % 4 == 3)[:, None], wanted, RNG.random((12, 40)) * np.linspace(3.0, 0.0, 40))
    found = line(seen, wanted)
    assert all({3, 7, 11} <= set(chosen) for chosen in found.row)
    assert np.all(np.diff(np.abs(found.row - EVERY[:, None]), axis=1) >= 0), "nearest first"


def test_a_second_row_is_read_with_the_first():
    """However little it adds by itself, and by its neighbours where it adds much."""
    wanted = RNG.random((12, 40)) + np.linspace(1.0, 3.0, 40)
    seen = wanted * (1.0 + 0.4 * RNG.normal(size=(12, 40)))
    rest = np.maximum(wanted[4] - 0.6 * seen[4], 0.0)
    found = line(np.append(seen, [rest], axis=0), wanted, np.arange(13), np.append(EVERY, 4))
    alone = line(seen, wanted)
    off, without = (
        np.linalg.norm(m.weight[4].astype(float) @ np.append(seen, [rest], axis=0)[m.row[4]] - wanted[4])
        for m in (found, alone)
    )
    assert {4, 12} <= set(found.row[4]) and off < 0.4 * without
    faint = line(np.append(seen, [0.0 * rest], axis=0), wanted, np.arange(13), np.append(EVERY, 4))
    assert {4, 12} <= set(faint.row[4]) and not np.isin(12, faint.row[[0, 8]])


def test_parts_are_alike_where_neighbours_are_and_as_large_as_what_is_wanted():
    """Where all see the same light, each adds as much, however strong it is: not what is near a bright spot."""
    size = np.geomspace(1.0, 1e2, 12)
    seen = size[:, None] * np.linspace(1.0, 2.0, 9)
    found = line(seen, seen)
    parts = found.weight.astype(float) * size[found.row] / size[:, None]
    inner = size[found.row].min(axis=1) / size > 0.04
    np.testing.assert_allclose(parts, 1.0 / 7.0, rtol=0.05)
    assert inner.all()


def test_even_light_is_what_it_should_be_in_each_channel():
    even, total = RNG.random((12, 3)) + 0.5, RNG.random((12, 3)) + 0.5
    seen = RNG.random((12, 20)) + 0.2
    found = line(seen, seen)
    fit_tint(found, even, total)
    fit_tint(found, even, total)  # what it was before does not count
    np.testing.assert_allclose(found.apply(even), total, rtol=2e-3)  # halves
    both = found.apply(np.stack([even, 2.0 * even], axis=1))
    np.testing.assert_allclose(both, np.stack([total, 2.0 * total], axis=1), rtol=2e-3)


def test_who_gathers_nothing_neither_lends_nor_borrows():
    none, some = EVERY[EVERY % 3 == 0], EVERY[EVERY % 3 > 0]
    seen = RNG.random((12, 20))
    found = line(seen, seen, some)
    assert not found.weight[none].any() and not np.isin(found.row[some], none).any()
    assert not line(seen, seen, EVERY[:0]).weight.any()


def test_opposite_sides_do_not_mix():
    """Two sheets half a spacing apart, on each of which there are enough."""
    along = 0.4 * np.arange(5.0)
    x = np.stack([*np.meshgrid(along, along, (0.0, 0.5))], axis=-1).reshape(-1, 3)
    n = np.array([0.0, 0.0, 1.0]) * np.where(x[:, 2:] > 0.0, 1.0, -1.0)
    seen = (RNG.random((50, 30)) + 0.5).astype(np.float32)
    found = neighbour_mixture(x, n, 1.0, np.arange(50), np.arange(50), lambda r: seen[r], seen)
    assert np.all(x[found.row, 2] == x[:, None, 2])


def test_fewer_vertices_than_neighbours():
    seen = RNG.random((2, 10)).astype(np.float32)
    found = neighbour_mixture(LINE[:2], UP[:2], 1.0, EVERY[:2], EVERY[:2], lambda r: seen[r], seen)
    assert found.row.shape == (2, 7) and not found.weight[:, 2:].any()
    np.testing.assert_allclose(found.weight[:, 0], 1.0, atol=0.1)
    with pytest.raises(IndexError):
        found.apply(np.ones((1, 3)))
