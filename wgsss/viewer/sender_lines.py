"""The senders that a vertex reads in its spatial adjacency map, as end points of lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.methods import Method
from wgsss.methods.pair import Pair
from wgsss.methods.sam.method import SamTranslucency
from wgsss.methods.sam.rest_state import clusters_at_rest
from wgsss.stage import Stage

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class SenderLines:
    """Lines from one vertex to its senders; positions in world mm, at rest."""

    vertex: Array
    """(3,)"""
    senders: Array
    """(n, 3); of a sender that is a mean over vertices, their centre"""
    weights: Array
    """(n,): mean of the three channels"""


def find_sam(method: Method) -> SamTranslucency | None:
    """Return the part of a method that uses spatial adjacency maps; None: it has no such part."""
    if isinstance(method, Pair):
        return next((part for part in method.instances() if isinstance(part, SamTranslucency)), None)
    return method if isinstance(method, SamTranslucency) else None


def sender_lines(stage: Stage, sam: SamTranslucency, point: npt.ArrayLike) -> SenderLines:
    """Return the lines of the vertex nearest to a point, world mm.

    If the map mixes rows of entries, the lines are those of all rows that the vertex mixes, with their shares.
    """
    index, vertex = _nearest_vertex(stage, point)
    body = stage.bodies[index]
    sender_map, matrix = sam.sender_map(body), body.rest.matrix
    mixture, means = sender_map.neighbour_mixture, sender_map.smoothed_means
    rows, shares = np.array([vertex]), np.ones((1, 3))
    if mixture is not None:
        rows, shares = mixture.row[vertex], mixture.weight[vertex, :, None] * mixture.tint[vertex]
    weight = (sender_map.weight[rows] * shares[:, None]).mean(axis=2)
    used = weight > 0.0
    sender, inverse = np.unique(sender_map.sender[rows][used], return_inverse=True)
    weights = np.bincount(inverse.ravel(), weight[used], len(sender))
    if means is not None:  # a smoothed mean stands where its first node does
        node = means.node[np.maximum(sender - sender_map.sender_count, 0), 0]
        sender = np.where(sender < sender_map.sender_count, sender, sender_map.sender_count + node)
    positions = stage.shared(
        ("clusters at rest", id(sender_map)), lambda: clusters_at_rest(body.rest.mesh, sender_map)["position"]
    )
    senders = positions[sender] @ matrix[:3, :3].T + matrix[:3, 3]
    return SenderLines(body.rest.placed[vertex], senders, weights)


def _nearest_vertex(stage: Stage, point: npt.ArrayLike) -> tuple[int, int]:
    """Return the indices of the body and of its vertex that are nearest to a point, world mm."""
    distances = [np.linalg.norm(np.subtract(item.placed, point), axis=1) for item in stage.scene.objects]
    index = min(range(len(stage.bodies)), key=lambda i: float(distances[i].min()))
    return index, int(distances[index].argmin())
