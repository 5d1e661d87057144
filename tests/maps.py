"""Spatial adjacency maps whose entries are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wgsss import frame as shared
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.point_tree import point_tree
from wgsss.graph import Graph
from wgsss.methods.sam import method as sam
from wgsss.methods.sam.method import SpatialAdjacencyMaps
from wgsss.methods.sam.upload import at_vertices
from wgsss.scene import MATERIALS, DirectionalLight, Mesh, OrthographicCamera
from wgsss.stage import Stage

MARBLE = replace(MATERIALS["marble"], specular=0.0)
SIDE = DirectionalLight((-0.7, -0.5, -0.5), (1, 2, 3))
FRONT = OrthographicCamera((0, 0, 50), (0, 0, 0), height=24)
PLAIN = SpatialAdjacencyMaps(select="top", surface="none")


def rms(values: Any) -> float:
    return float(np.sqrt(np.square(values, dtype=np.float64).mean()))


def random_sender_map(mesh: Mesh, samples: int = 5, *, few: bool = False) -> SenderMap:
    """Weights of vertices and nodes: of any, or of few, which few vertices have."""
    random = np.random.default_rng(4)
    V, over = len(mesh.positions), point_tree(mesh.positions)
    sender = random.integers(-1, V + len(over.first), (V, samples))
    if few:
        finest = V + random.integers(0, over.levels[1], (V, samples))
        sender = np.where(random.random((V, samples)) < 0.5, sender % 7, V + finest % 11)
        sender[random.random(V) < 0.8] = -1
    weight = random.random((V, samples, 3)) * (sender >= 0)[..., None]
    return SenderMap(sender.astype(np.int32), weight.astype(np.float32), V, None, over)


def use_sender_map(monkeypatch, make):
    """Maps that are made by `make(mesh)`."""
    calls = []

    def spatial_adjacency_map(gpu, mesh, profile, samples, select):
        calls.append((mesh, profile, samples, select))
        return make(mesh)

    monkeypatch.setattr(sam, "spatial_adjacency_map", spatial_adjacency_map)
    return calls


def light_at_vertices(stage: Stage) -> Any:
    """L_d at all vertices of the one object."""
    graph, body = Graph(stage.gpu), stage.bodies[0]
    everywhere = at_vertices(body.rest.mesh)
    V = len(everywhere.face)
    light = shared.irradiance_points(shared.begin(graph, stage, (8, 8)), body, body.points(everywhere), V, everywhere)
    graph.run(light)
    return graph.read(light)[:, :3].astype(float)
