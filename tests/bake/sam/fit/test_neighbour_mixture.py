"""Mixtures of the sums of neighbouring rows, compared with nonnegative least squares for single vertices."""

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


def line(sums: np.ndarray, target: np.ndarray, rows: np.ndarray = EVERY, owner: np.ndarray = EVERY) -> NeighbourMixture:
    """Return the mixtures of twelve vertices in a line, 1 mm apart, whose rows have the sums `sums` (R, T)."""
    return neighbour_mixture(
        LINE, UP, 1.0, owner, rows, lambda r: sums[r].astype(np.float32), target.astype(np.float32)
    )


def test_weights_have_nearly_the_smallest_error_of_all_nonnegative_ones():
    target = RNG.random((12, 40)) + np.linspace(1.0, 3.0, 40)
    sums = target * (1.0 + 0.4 * RNG.normal(size=(12, 40)))
    mixture = line(sums, target)
    for v in range(12):
        chosen = mixture.row[v]
        assert chosen[0] == v and len(set(chosen)) == 7
        best = nnls(sums[chosen].T, target[v])[1]
        error = np.linalg.norm(mixture.weight[v].astype(float) @ sums[chosen] - target[v])
        assert best <= error < 1.02 * best
        assert error < 0.7 * np.linalg.norm(sums[v] - target[v])


def test_mixtures_have_the_rows_that_lessen_the_error_most():
    """Every fourth row has the exact sums: the mixtures of all vertices use it, even if other rows are nearer."""
    target = np.tile(RNG.random(40) + np.linspace(1.0, 3.0, 40), (12, 1))
    sums = np.where((EVERY % 4 == 3)[:, None], target, RNG.random((12, 40)) * np.linspace(3.0, 0.0, 40))
    mixture = line(sums, target)
    assert all({3, 7, 11} <= set(chosen) for chosen in mixture.row)
    assert np.all(np.diff(np.abs(mixture.row - EVERY[:, None]), axis=1) >= 0), "sorted by distance"


def test_a_mixture_has_both_rows_of_its_own_vertex():
    """A vertex uses its second row even if that adds little; neighbours use it only if it adds much."""
    target = RNG.random((12, 40)) + np.linspace(1.0, 3.0, 40)
    sums = target * (1.0 + 0.4 * RNG.normal(size=(12, 40)))
    rest = np.maximum(target[4] - 0.6 * sums[4], 0.0)
    mixture = line(np.append(sums, [rest], axis=0), target, np.arange(13), np.append(EVERY, 4))
    alone = line(sums, target)
    error, error_alone = (
        np.linalg.norm(m.weight[4].astype(float) @ np.append(sums, [rest], axis=0)[m.row[4]] - target[4])
        for m in (mixture, alone)
    )
    assert {4, 12} <= set(mixture.row[4]) and error < 0.4 * error_alone
    faint = line(np.append(sums, [0.0 * rest], axis=0), target, np.arange(13), np.append(EVERY, 4))
    assert {4, 12} <= set(faint.row[4]) and not np.isin(12, faint.row[[0, 8]])


def test_proportional_rows_have_equal_parts():
    """Rows whose sums differ by a factor only contribute equally, so that bright neighbours do not dominate."""
    size = np.geomspace(1.0, 1e2, 12)
    sums = size[:, None] * np.linspace(1.0, 2.0, 9)
    mixture = line(sums, sums)
    parts = mixture.weight.astype(float) * size[mixture.row] / size[:, None]
    is_scaled = size[mixture.row].min(axis=1) / size > 0.04
    np.testing.assert_allclose(parts, 1.0 / 7.0, rtol=0.05)
    assert is_scaled.all()


def test_tints_make_uniform_light_exact_in_each_channel():
    uniform, total = RNG.random((12, 3)) + 0.5, RNG.random((12, 3)) + 0.5
    sums = RNG.random((12, 20)) + 0.2
    mixture = line(sums, sums)
    fit_tint(mixture, uniform, total)
    fit_tint(mixture, uniform, total)  # the tint of before does not matter
    np.testing.assert_allclose(mixture.apply(uniform), total, rtol=2e-3)  # float16
    both = mixture.apply(np.stack([uniform, 2.0 * uniform], axis=1))
    np.testing.assert_allclose(both, np.stack([total, 2.0 * total], axis=1), rtol=2e-3)


def test_empty_rows_are_in_no_mixture_and_have_none():
    none, used = EVERY[EVERY % 3 == 0], EVERY[EVERY % 3 > 0]
    sums = RNG.random((12, 20))
    mixture = line(sums, sums, used)
    assert not mixture.weight[none].any() and not np.isin(mixture.row[used], none).any()
    assert not line(sums, sums, EVERY[:0]).weight.any()


def test_opposite_sides_of_a_sheet_do_not_mix():
    """Two sides, half a spacing apart, each with more than enough rows."""
    along = 0.4 * np.arange(5.0)
    x = np.stack([*np.meshgrid(along, along, (0.0, 0.5))], axis=-1).reshape(-1, 3)
    n = np.array([0.0, 0.0, 1.0]) * np.where(x[:, 2:] > 0.0, 1.0, -1.0)
    sums = (RNG.random((50, 30)) + 0.5).astype(np.float32)
    mixture = neighbour_mixture(x, n, 1.0, np.arange(50), np.arange(50), lambda r: sums[r], sums)
    assert np.all(x[mixture.row, 2] == x[:, None, 2])


def test_a_mesh_of_fewer_vertices_than_rows_of_a_mixture():
    sums = RNG.random((2, 10)).astype(np.float32)
    mixture = neighbour_mixture(LINE[:2], UP[:2], 1.0, EVERY[:2], EVERY[:2], lambda r: sums[r], sums)
    assert mixture.row.shape == (2, 7) and not mixture.weight[:, 2:].any()
    np.testing.assert_allclose(mixture.weight[:, 0], 1.0, atol=0.1)
    with pytest.raises(IndexError):
        mixture.apply(np.ones((1, 3)))
