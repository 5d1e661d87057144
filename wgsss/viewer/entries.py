"""What a vertex has in its spatial adjacency map, as lines to where it reads from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.methods import Method
from wgsss.methods.pair import Pair
from wgsss.methods.sam.deform import places_at_rest
from wgsss.methods.sam.method import Adjacency
from wgsss.stage import Stage

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Links:
    """Of one vertex, world mm, at rest."""

    vertex: Array
    """(3,)"""
    senders: Array
    """(n, 3): where they are; of a mean, its middle"""
    weights: Array
    """(n,): the mean of the channels"""


def adjacency(method: Method) -> Adjacency | None:
    """What of a method has spatial adjacency maps."""
    if isinstance(method, Pair):
        return next((part for part in method.made() if isinstance(part, Adjacency)), None)
    return method if isinstance(method, Adjacency) else None


def links(stage: Stage, maps: Adjacency, point: Any) -> Links:
    """Those of the vertex nearest to a point, world mm; of a mixture, those of all rows that are in it."""

    def nearest(index: int) -> tuple[float, int]:
        distance = np.linalg.norm(stage.scene.objects[index].placed - point, axis=1)
        return float(distance.min()), int(distance.argmin())

    index = min(range(len(stage.bodies)), key=lambda i: nearest(i)[0])
    body, vertex = stage.bodies[index], nearest(index)[1]
    entries, matrix = maps.map(body), body.rest.matrix
    rows, parts = np.array([vertex]), np.ones((1, 3))
    if entries.neighbour_mixture is not None:
        rows, parts = (
            entries.neighbour_mixture.row[vertex],
            entries.neighbour_mixture.weight[vertex, :, None] * entries.neighbour_mixture.tint[vertex],
        )
    weight = (entries.weight[rows] * parts[:, None]).mean(axis=2)
    used = weight > 0.0
    sender, at_once = np.unique(entries.sender[rows][used], return_inverse=True)
    weights = np.bincount(at_once.ravel(), weight[used], len(sender))
    if entries.smoothed_means is not None:  # of a blend, the node that it takes the place of
        node = entries.smoothed_means.node[np.maximum(sender - entries.sender_count, 0), 0]
        sender = np.where(sender < entries.sender_count, sender, entries.sender_count + node)
    places = stage.shared(("places", id(entries)), lambda: places_at_rest(body.rest.mesh, entries)["position"])
    at = places[sender] @ matrix[:3, :3].T + matrix[:3, 3]
    return Links(body.rest.placed[vertex], at, weights)
