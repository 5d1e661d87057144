"""Spatial adjacency maps whose entries are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wgsss.bake.sam import Entries
from wgsss.bake.sam.tree import tree
from wgsss.methods import sam
from wgsss.methods.sam import SpatialAdjacencyMaps
from wgsss.scene import MATERIALS, DirectionalLight, OrthographicCamera

MARBLE = replace(MATERIALS["marble"], specular=0.0)
SIDE = DirectionalLight((-0.7, -0.5, -0.5), (1, 2, 3))
FRONT = OrthographicCamera((0, 0, 50), (0, 0, 0), height=24)
PLAIN = SpatialAdjacencyMaps(surface="none")


def rms(values: Any) -> float:
    return float(np.sqrt(np.square(values, dtype=np.float64).mean()))


def random_entries(mesh, samples=5, *, nodes=True):
    random = np.random.default_rng(4)
    V = len(mesh.positions)
    over = tree(mesh.positions) if nodes else None
    sender = random.integers(-1, V + (len(over.first) if nodes else 0), (V, samples))
    weight = random.random((V, samples, 3)) * (sender >= 0)[..., None]
    return Entries(sender.astype(np.int32), weight.astype(np.float32), V, None, over)


def given(monkeypatch, make):
    """Maps that are made by `make(mesh)`."""
    calls = []

    def spatial_adjacency_map(gpu, mesh, profile, samples, select):
        calls.append((mesh, profile, samples, select))
        return make(mesh)

    monkeypatch.setattr(sam, "spatial_adjacency_map", spatial_adjacency_map)
    return calls
