"""The tree over points: who is under whom, and how compact that is."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from wgsss.bake.sam.point_tree import PointTree, point_tree


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return np.random.default_rng(4).random((1371, 3)) * (4.0, 2.0, 1.0)


@pytest.fixture(scope="module")
def made(points) -> PointTree:
    return point_tree(points)


@pytest.mark.parametrize("V", [1, 2, 3, 4, 5, 15, 16, 17, 1000])
def test_levels_cover_all_points(V):
    made = point_tree(np.random.default_rng(V).random((V, 2)))
    assert sorted(made.order) == list(range(V))
    sizes = np.diff(made.levels)
    assert sizes[-1] == 1 and np.all(sizes[:-1] == 4 * sizes[1:])
    for a, b in pairwise(made.levels):
        first, count = made.first[a:b], made.count[a:b]
        assert first[0] == 0 and np.all(first[1:] == (first + count)[:-1]) and (first + count)[-1] == V
    finest = made.count[: sizes[0]]
    assert 1 <= finest.min() and finest.max() <= 4


def test_a_node_holds_what_its_children_hold(made):
    for level in range(1, len(made.levels) - 1):
        for k in range(made.levels[level + 1] - made.levels[level]):
            children = made.levels[level - 1] + 4 * k + np.arange(4)
            node = made.levels[level] + k
            assert made.first[node] == made.first[children[0]]
            assert made.count[node] == made.count[children].sum()


def test_sums(made, points):
    found = made.sums(points)
    for node in (0, 57, len(made.first) - 1):
        under = made.order[made.first[node] : made.first[node] + made.count[node]]
        np.testing.assert_allclose(found[node], points[under].sum(axis=0))


def test_nodes_are_compact(made, points):
    """A quarter of a 4 x 2 x 1 box is a cube with an edge of 2 at most; without an order it would be the whole box."""
    quarters = range(made.levels[-3], made.levels[-2])
    for node in quarters:
        under = points[made.order[made.first[node] : made.first[node] + made.count[node]]]
        assert np.ptp(under, axis=0).max() < 2.2


def test_what_faces_another_way_is_elsewhere():
    """The two sides of a sheet, when normals count for more than its thickness."""
    x = np.random.default_rng(1).random((400, 2))
    side = np.repeat([-1.0, 1.0], 200)
    made = point_tree(np.column_stack([x, 3.0 * side]))
    halves = np.split(side[made.order], 2)
    assert all(np.ptp(half) == 0.0 for half in halves)
