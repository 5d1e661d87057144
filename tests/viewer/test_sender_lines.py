"""The lines of a vertex end at its senders."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wgsss.gpu import Gpu
from wgsss.methods.sam.method import SamTranslucency
from wgsss.registry import make_method
from wgsss.scene import load_scene
from wgsss.stage import Stage
from wgsss.viewer.sender_lines import find_sam, sender_lines


@pytest.fixture
def stage(gpu: Gpu) -> Stage:
    return Stage(gpu, load_scene("slab", vertices=300))


def sam_of(name: str, knobs: dict[str, Any]) -> SamTranslucency:
    sam = find_sam(make_method(name, knobs))
    assert sam is not None
    return sam


def test_lines_to_vertices_reach_the_far_side_with_the_weights_of_the_map(stage: Stage) -> None:
    sam, body = sam_of("screen+sam", {"select": "top", "samples": 4}), stage.bodies[0]
    sender_map, mesh = sam.sender_map(body), body.rest.mesh
    vertex = int(np.argmax(sender_map.weight.sum(axis=(1, 2))))
    lines = sender_lines(stage, sam, body.rest.placed[vertex] + 1e-4)
    np.testing.assert_allclose(lines.vertex, body.rest.placed[vertex])
    order = np.argsort(sender_map.sender[vertex])
    np.testing.assert_allclose(lines.senders, body.rest.placed[sender_map.sender[vertex][order]])
    np.testing.assert_allclose(lines.weights, sender_map.weight[vertex].mean(axis=1)[order])
    assert ((lines.senders - lines.vertex) @ mesh.normals[vertex] < 0.0).all()


def test_line_to_a_mean_over_vertices_ends_among_them(stage: Stage) -> None:
    sam, body = sam_of("sam", {"select": "fit"}), stage.bodies[0]
    sender_map = sam.sender_map(body)
    assert sender_map.tree is not None
    assert sender_map.smoothed_means is not None and sender_map.neighbour_mixture is not None
    vertex, slot = np.argwhere(sender_map.sender[: len(sender_map.neighbour_mixture.row)] >= sender_map.sender_count)[0]
    node = sender_map.smoothed_means.node[sender_map.sender[vertex, slot] - sender_map.sender_count, 0]
    first, count = sender_map.tree.first[node], sender_map.tree.count[node]
    below = body.rest.placed[sender_map.tree.order[first : first + count]]
    ends = sender_lines(stage, sam, body.rest.placed[vertex]).senders
    assert ((below.min(axis=0) - 1e-6 <= ends) & (ends <= below.max(axis=0) + 1e-6)).all(axis=1).any()


def test_lines_of_a_vertex_that_mixes_rows_are_those_of_all_its_rows(stage: Stage) -> None:
    sam, body = sam_of("sam", {"select": "fit"}), stage.bodies[0]
    sender_map = sam.sender_map(body)
    mixture = sender_map.neighbour_mixture
    assert mixture is not None
    row_sums = mixture.apply(sender_map.weight.sum(axis=1)).mean(axis=1)
    vertex = int(row_sums.argmax())
    lines = sender_lines(stage, sam, body.rest.placed[vertex])
    senders = sender_map.sender[mixture.row[vertex][mixture.weight[vertex] > 0.0]]
    assert len(lines.weights) == len(np.unique(senders[senders >= 0])) > 3
    np.testing.assert_allclose(lines.weights.sum(), row_sums[vertex], rtol=1e-3)


def test_methods_without_spatial_adjacency_maps_have_no_lines() -> None:
    assert find_sam(make_method("lambert")) is None
    assert find_sam(make_method("screen+none")) is None
