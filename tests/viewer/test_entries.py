"""Lines of a vertex end where its senders are."""

from __future__ import annotations

import numpy as np

from wgsss.gpu import Gpu
from wgsss.registry import make_method
from wgsss.scene import load_scene
from wgsss.stage import Stage
from wgsss.viewer.entries import adjacency, links


def test_lines_of_vertices_go_to_the_far_side_and_have_the_weights_of_the_map(gpu: Gpu) -> None:
    stage = Stage(gpu, load_scene("slab", vertices=300))
    maps = adjacency(make_method("screen+sam", {"select": "top", "samples": 4}))
    assert maps is not None
    body = stage.bodies[0]
    entries, mesh = maps.map(body), body.rest.mesh
    vertex = int(np.argmax(entries.weight.sum(axis=(1, 2))))
    found = links(stage, maps, body.rest.placed[vertex] + 1e-4)
    np.testing.assert_allclose(found.vertex, body.rest.placed[vertex])
    order = np.argsort(entries.sender[vertex])
    np.testing.assert_allclose(found.senders, body.rest.placed[entries.sender[vertex][order]])
    np.testing.assert_allclose(found.weights, entries.weight[vertex].mean(axis=1)[order])
    assert ((found.senders - found.vertex) @ mesh.normals[vertex] < 0.0).all()


def test_lines_of_means_go_to_their_middles(gpu: Gpu) -> None:
    stage = Stage(gpu, load_scene("slab", vertices=300))
    maps = adjacency(make_method("sam", {"select": "fit"}))
    assert maps is not None
    entries, body = maps.map(stage.bodies[0]), stage.bodies[0]
    assert entries.tree is not None and entries.smoothed_means is not None
    vertex, slot = np.argwhere(entries.sender[: len(entries.neighbour_mixture.row)] >= entries.sender_count)[0]
    node = entries.smoothed_means.node[entries.sender[vertex, slot] - entries.sender_count, 0]
    first, count = entries.tree.first[node], entries.tree.count[node]
    below = body.rest.placed[entries.tree.order[first : first + count]]
    ends = links(stage, maps, body.rest.placed[vertex]).senders
    assert ((below.min(axis=0) - 1e-6 <= ends) & (ends <= below.max(axis=0) + 1e-6)).all(axis=1).any()


def test_lines_of_a_mixture_are_of_all_that_is_in_it(gpu: Gpu) -> None:
    stage = Stage(gpu, load_scene("slab", vertices=300))
    maps, body = adjacency(make_method("sam", {"select": "fit"})), stage.bodies[0]
    assert maps is not None
    entries = maps.map(body)
    assert entries.neighbour_mixture is not None
    even = entries.neighbour_mixture.apply(entries.weight.sum(axis=1)).mean(axis=1)
    vertex = int(even.argmax())
    found = links(stage, maps, body.rest.placed[vertex])
    read = entries.sender[entries.neighbour_mixture.row[vertex][entries.neighbour_mixture.weight[vertex] > 0.0]]
    assert len(found.weights) == len(np.unique(read[read >= 0])) > 3
    np.testing.assert_allclose(found.weights.sum(), even[vertex], rtol=1e-3)


def test_other_methods_have_none() -> None:
    assert adjacency(make_method("lambert")) is None
    assert adjacency(make_method("screen+none")) is None
