"""Blended means over nodes of a tree."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fit.smoothed_means import WIDTHS, smoothed_means
from wgsss.bake.sam.point_tree import PointTree, point_tree
from wgsss.bake.sam.sender_map import SmoothedMeans


@pytest.fixture(scope="module")
def square() -> tuple[PointTree, np.ndarray, np.ndarray]:
    """A tree over a square grid, its nodes' middles and areas, each point having an area of 1."""
    x = np.stack([*np.meshgrid(np.arange(32.0), np.arange(32.0)), np.zeros((32, 32))], axis=-1).reshape(-1, 3)
    made = point_tree(x)
    area = made.sums(np.ones(len(x)))
    return made, made.sums(x) / area[:, None], area


@pytest.fixture(scope="module")
def flat(square) -> SmoothedMeans:
    made, x, area = square
    return smoothed_means(made, x, np.tile((0.0, 0.0, 1.0), (len(x), 1)), area)


def test_what_is_even_stays_even(flat, square):
    np.testing.assert_allclose(flat.apply(np.full(len(square[2]), 2.5)), 2.5, rtol=1e-6)
    assert np.all(flat.node[:, 0] == np.tile(np.arange(len(square[2])), len(WIDTHS)))


def test_weights_are_gaussian_in_units_of_a_node(flat, square):
    """On a regular grid of nodes: exp(-1 / 2 s^2) for the four beside a node, squared across the corners."""
    made, x, area = square
    level = slice(made.levels[1], made.levels[2])
    inside = np.flatnonzero(np.abs(x[level] - 15.5).max(axis=1) < 10.0) + made.levels[1]
    for width, of_width in zip(WIDTHS, np.split(flat.weight, len(WIDTHS)), strict=True):
        side = np.exp(-0.5 / width**2)
        weight = np.sort(of_width[inside], axis=1)[:, ::-1]
        np.testing.assert_allclose(weight[:, 1:5] / weight[:, :1], side, rtol=1e-4)
        np.testing.assert_allclose(weight[:, 5:] / weight[:, :1], side**2, rtol=1e-4)
        assert np.ptp(area[level]) == 0.0 and weight.shape[1] == 9


def test_neighbours_are_of_the_same_level(flat, square):
    levels = np.searchsorted(square[0].levels, flat.node, side="right")
    real = flat.weight > 0.0
    assert np.all(levels[real] == np.broadcast_to(levels[:, :1], levels.shape)[real])


def test_the_other_side_of_a_sheet_does_not_count(square):
    made, x, area = square
    n = np.where((x[:, :1] < 15.0), [[0.0, 0.0, 1.0]], [[0.0, 0.0, -1.0]])
    found = smoothed_means(made, x, n, area)
    finest = slice(0, made.levels[1])
    across = n[found.node[finest], 2] != n[finest, None, 2]
    assert found.weight[finest][across].max() < np.exp(-(1.0 + 4.0) / 2 / WIDTHS[0] ** 2) * 1.01


def test_each_mean_is_its_own_even_where_nodes_are_at_one_place():
    x = np.zeros((64, 3))
    made = point_tree(x)
    found = smoothed_means(made, np.zeros((len(made.first), 3)), np.zeros((len(made.first), 3)), made.sums(np.ones(64)))
    np.testing.assert_array_equal(found.node[: len(made.first), 0], np.arange(len(made.first)))
    assert all(len(set(row)) == 9 for row in found.node[: made.levels[1]])


def test_a_root_alone():
    one = smoothed_means(point_tree(np.zeros((1, 3))), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1))
    np.testing.assert_array_equal(one.weight[0], [1.0] + [0.0] * 8)
