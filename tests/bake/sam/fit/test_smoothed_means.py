"""Smoothed means over nodes of a tree."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fit.smoothed_means import WIDTHS, smoothed_means
from wgsss.bake.sam.point_tree import PointTree, point_tree
from wgsss.bake.sam.sender_map import SmoothedMeans


@pytest.fixture(scope="module")
def square() -> tuple[PointTree, np.ndarray, np.ndarray]:
    """Return a tree over a square grid of points of area 1, and the centroids and areas of its nodes."""
    x = np.stack([*np.meshgrid(np.arange(32.0), np.arange(32.0)), np.zeros((32, 32))], axis=-1).reshape(-1, 3)
    tree = point_tree(x)
    area = tree.sums(np.ones(len(x)))
    return tree, tree.sums(x) / area[:, None], area


@pytest.fixture(scope="module")
def flat(square) -> SmoothedMeans:
    """Return the smoothed means of the grid, with equal normals."""
    tree, x, area = square
    return smoothed_means(tree, x, np.tile((0.0, 0.0, 1.0), (len(x), 1)), area)


def test_smoothed_means_of_a_constant_are_constant(flat, square):
    np.testing.assert_allclose(flat.apply(np.full(len(square[2]), 2.5)), 2.5, rtol=1e-6)
    assert np.all(flat.node[:, 0] == np.tile(np.arange(len(square[2])), len(WIDTHS)))


def test_weights_are_gaussian_in_the_distance_over_the_size_of_a_node(flat, square):
    """On a regular grid of nodes: exp(-1 / 2 s^2) for the four nearest neighbours, its square for the diagonal ones."""
    tree, x, area = square
    level = slice(tree.levels[1], tree.levels[2])
    inside = np.flatnonzero(np.abs(x[level] - 15.5).max(axis=1) < 10.0) + tree.levels[1]
    for width, weight_of_width in zip(WIDTHS, np.split(flat.weight, len(WIDTHS)), strict=True):
        side = np.exp(-0.5 / width**2)
        weight = np.sort(weight_of_width[inside], axis=1)[:, ::-1]
        np.testing.assert_allclose(weight[:, 1:5] / weight[:, :1], side, rtol=1e-4)
        np.testing.assert_allclose(weight[:, 5:] / weight[:, :1], side**2, rtol=1e-4)
        assert np.ptp(area[level]) == 0.0 and weight.shape[1] == 9


def test_the_neighbours_of_a_node_are_on_its_level(flat, square):
    levels = np.searchsorted(square[0].levels, flat.node, side="right")
    is_used = flat.weight > 0.0
    assert np.all(levels[is_used] == np.broadcast_to(levels[:, :1], levels.shape)[is_used])


def test_nodes_with_opposite_normals_have_small_weights(square):
    tree, x, area = square
    n = np.where((x[:, :1] < 15.0), [[0.0, 0.0, 1.0]], [[0.0, 0.0, -1.0]])
    means = smoothed_means(tree, x, n, area)
    finest = slice(0, tree.levels[1])
    across = n[means.node[finest], 2] != n[finest, None, 2]
    assert means.weight[finest][across].max() < np.exp(-(1.0 + 4.0) / 2 / WIDTHS[0] ** 2) * 1.01


def test_the_first_node_of_a_mean_is_its_own_even_if_all_nodes_coincide():
    x = np.zeros((64, 3))
    tree = point_tree(x)
    zero = np.zeros((len(tree.first), 3))
    means = smoothed_means(tree, zero, zero, tree.sums(np.ones(64)))
    np.testing.assert_array_equal(means.node[: len(tree.first), 0], np.arange(len(tree.first)))
    assert all(len(set(row)) == 9 for row in means.node[: tree.levels[1]])


def test_a_tree_of_one_node_has_one_mean():
    one = smoothed_means(point_tree(np.zeros((1, 3))), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1))
    np.testing.assert_array_equal(one.weight[0], [1.0] + [0.0] * 8)
