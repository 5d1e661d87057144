"""Spatial adjacency maps with known random entries, and quantities that tests of the method compare."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wgsss import frame as shared
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.point_tree import point_tree
from wgsss.bake.samples import vertex_samples
from wgsss.graph import Graph
from wgsss.methods.sam import method as sam
from wgsss.methods.sam.method import SamTranslucency
from wgsss.scene import MATERIALS, DirectionalLight, Mesh, OrthographicCamera
from wgsss.stage import Stage

MARBLE = replace(MATERIALS["marble"], specular=0.0)
SIDE = DirectionalLight((-0.7, -0.5, -0.5), (1, 2, 3))
FRONT = OrthographicCamera((0, 0, 50), (0, 0, 0), height=24)
PLAIN = SamTranslucency(select="top")


def rms(values: Any) -> float:
    """Return the root mean square of an array."""
    return float(np.sqrt(np.square(values, dtype=np.float64).mean()))


def random_sender_map(mesh: Mesh, entries_per_vertex: int = 5, *, few: bool = False) -> SenderMap:
    """Return a map whose senders are random vertices and nodes of a tree.

    With `few`, only every fifth vertex has entries, and only a few vertices and finest nodes are senders.
    """
    random = np.random.default_rng(4)
    V, tree = len(mesh.positions), point_tree(mesh.positions)
    sender = random.integers(-1, V + len(tree.first), (V, entries_per_vertex))
    if few:
        finest = V + random.integers(0, tree.levels[1], (V, entries_per_vertex))
        sender = np.where(random.random((V, entries_per_vertex)) < 0.5, sender % 7, V + finest % 11)
        sender[random.random(V) < 0.8] = -1
    weight = random.random((V, entries_per_vertex, 3)) * (sender >= 0)[..., None]
    return SenderMap(sender.astype(np.int32), weight.astype(np.float32), V, None, tree)


def use_sender_map(monkeypatch, make):
    """Let the method use `make(mesh)` as the map of each mesh; return the list of its calls."""
    calls = []

    def spatial_adjacency_map(gpu, mesh, profile, entries_per_vertex, select):
        calls.append((mesh, profile, entries_per_vertex, select))
        return make(mesh)

    monkeypatch.setattr(sam, "spatial_adjacency_map", spatial_adjacency_map)
    return calls


def light_at_vertices(stage: Stage) -> Any:
    """Return L_d (V, 3), W/m^2, at all vertices of the only object."""
    graph, body = Graph(stage.gpu), stage.bodies[0]
    vertices = vertex_samples(body.rest.mesh)
    V = len(vertices.face)
    light = shared.irradiance_points(shared.begin(graph, stage, (8, 8)), body, body.points(vertices), V, vertices)
    graph.run(light)
    return graph.read(light)[:, :3].astype(float)
