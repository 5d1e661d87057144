"""The tree over points: its levels, its nodes, and how compact the nodes are."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from wgsss.bake.sam.point_tree import PointTree, point_tree


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return np.random.default_rng(4).random((1371, 3)) * (4.0, 2.0, 1.0)


@pytest.fixture(scope="module")
def tree(points) -> PointTree:
    return point_tree(points)


@pytest.mark.parametrize("V", [1, 2, 3, 4, 5, 15, 16, 17, 1000])
def test_each_level_covers_all_points_once(V):
    tree = point_tree(np.random.default_rng(V).random((V, 2)))
    assert sorted(tree.order) == list(range(V))
    sizes = np.diff(tree.levels)
    assert sizes[-1] == 1 and np.all(sizes[:-1] == 4 * sizes[1:])
    for a, b in pairwise(tree.levels):
        first, count = tree.first[a:b], tree.count[a:b]
        assert first[0] == 0 and np.all(first[1:] == (first + count)[:-1]) and (first + count)[-1] == V
    finest = tree.count[: sizes[0]]
    assert 1 <= finest.min() and finest.max() <= 4


def test_a_node_covers_the_points_of_its_children(tree):
    for level in range(1, len(tree.levels) - 1):
        for k in range(tree.levels[level + 1] - tree.levels[level]):
            children = tree.levels[level - 1] + 4 * k + np.arange(4)
            node = tree.levels[level] + k
            assert tree.first[node] == tree.first[children[0]]
            assert tree.count[node] == tree.count[children].sum()


def test_sums_are_over_the_points_of_each_node(tree, points):
    sums = tree.sums(points)
    for node in (0, 57, len(tree.first) - 1):
        under = tree.order[tree.first[node] : tree.first[node] + tree.count[node]]
        np.testing.assert_allclose(sums[node], points[under].sum(axis=0))


def test_nodes_are_compact(tree, points):
    """Four nodes of a 4 x 2 x 1 box fit in cubes with an edge of about 2; random quarters would fill the whole box."""
    quarters = range(tree.levels[-3], tree.levels[-2])
    for node in quarters:
        under = points[tree.order[tree.first[node] : tree.first[node] + tree.count[node]]]
        assert np.ptp(under, axis=0).max() < 2.2


def test_scaled_normals_separate_the_two_sides_of_a_sheet():
    """The third coordinate is a normal, scaled to be larger than the extent of the sheet."""
    x = np.random.default_rng(1).random((400, 2))
    side = np.repeat([-1.0, 1.0], 200)
    tree = point_tree(np.column_stack([x, 3.0 * side]))
    halves = np.split(side[tree.order], 2)
    assert all(np.ptp(half) == 0.0 for half in halves)
