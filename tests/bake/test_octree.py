"""The octree over points: a traversal meets each point once, whichever subtrees it skips."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.octree import LEAF, Octree, octree


def scattered(count: int) -> np.ndarray:
    """Return points on a bent sheet, a tenth of them at the same point."""
    u, v = np.random.default_rng(4).random((2, count))
    points = np.stack([u, v, 0.2 * np.sin(6 * u)], axis=1) * 30.0
    points[: count // 10] = points[-1]
    return points


def children(tree: Octree, k: int) -> list[int]:
    found, child = [], k + 1
    while child < tree.next[k]:
        found.append(child)
        child = int(tree.next[child])
    return found


@pytest.mark.parametrize("count", [1, 2, LEAF, LEAF + 1, 700])
def test_each_point_of_a_node_belongs_to_one_of_its_children(count: int) -> None:
    tree, order = octree(scattered(count))
    assert sorted(order) == list(range(count))
    assert tree.first[0] == 0 and tree.count[0] == count and tree.next[0] == len(tree.next)
    points = np.flatnonzero(tree.count == 1)
    np.testing.assert_array_equal(tree.first[points], np.arange(count))
    for k in range(len(tree.first)):
        below = children(tree, k)
        assert (tree.height[k] == 0) == (tree.count[k] == 1) == (not below)
        if below:
            assert len(below) > 1
            starts = tree.first[k] + np.cumsum([0, *tree.count[below]])
            np.testing.assert_array_equal(tree.first[below], starts[:-1])
            assert starts[-1] == tree.first[k] + tree.count[k]
            assert tree.height[k] == 1 + tree.height[below].max()


def test_a_traversal_that_skips_subtrees_at_random_meets_each_point_once() -> None:
    tree, _ = octree(scattered(500))
    random = np.random.default_rng(1)
    met = np.zeros(500, int)
    k = 0
    while k < len(tree.next):
        stands = tree.count[k] == 1 or random.random() < 0.3
        if stands:
            met[tree.first[k] : tree.first[k] + tree.count[k]] += 1
        k = int(tree.next[k]) if stands else k + 1
    assert (met == 1).all()


def test_cells_are_cubes_with_halved_sides_and_are_not_divided_further_than_needed() -> None:
    points = scattered(3000)[300:]
    tree, order = octree(points)
    points = points[order]
    low, side = points.min(axis=0), np.ptp(points, axis=0).max()
    for k in np.flatnonzero(tree.count > LEAF):
        inside = points[tree.first[k] : tree.first[k] + tree.count[k]]
        below = children(tree, k)
        assert 2 <= len(below) <= 8
        # The children of a node lie in different octants of the smallest cell that contains it.
        level = 0
        while (
            np.ptp(np.floor((inside - low) / side * 2 ** (level + 1)).clip(max=2 ** (level + 1) - 1), axis=0) == 0
        ).all():
            level += 1
        middle = low + side * (np.floor((inside[0] - low) / side * 2**level).clip(max=2**level - 1) + 0.5) / 2**level
        octants = [np.unique(points[tree.first[c] : tree.first[c] + tree.count[c]] >= middle, axis=0) for c in below]
        assert all(len(octant) == 1 for octant in octants)
        assert len(np.unique(np.concatenate(octants), axis=0)) == len(below)
    cells = np.flatnonzero((tree.count > 1) & (tree.count <= LEAF))
    assert (tree.height[cells] == 1).all()


def test_sums_and_least_values_are_those_of_the_points_of_the_node() -> None:
    tree, _ = octree(scattered(300))
    values = np.random.default_rng(2).normal(size=(300, 3))
    for k in range(len(tree.first)):
        own = values[tree.first[k] : tree.first[k] + tree.count[k]]
        np.testing.assert_allclose(tree.sums(values)[k], own.sum(axis=0), atol=1e-12)
        np.testing.assert_array_equal(tree.lowest(values)[k], own.min(axis=0))
        if k > 40:
            break
