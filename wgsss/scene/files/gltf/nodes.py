"""The nodes of a glTF file: their hierarchy at rest, and which of them its scene shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item, as_whole, shown
from wgsss.scene.rig import Nodes, Pose

Array = npt.NDArray[Any]

_UNIT = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Stage:
    """The nodes of a file, and what its scene shows of them."""

    items: list[Item]
    nodes: Nodes
    world: Array
    """float64 (N, 4, 4): from each node's space to that of the file, at rest; what is not finite is for `place`"""
    shown: tuple[int, ...]
    """the nodes of the scene from its roots down, hidden ones left out"""
    hidden: tuple[int, ...]
    """those of the scene that KHR_node_visibility hides"""

    def place(self, node: int) -> Array:
        """float64 (4, 4): from a node's space to that of the file. Raises InputError where it is not finite."""
        if not np.isfinite(self.world[node]).all():
            raise self.items[node].error("its place is beyond all bounds")
        return self.world[node]


def read_nodes(document: Document) -> Stage:
    """The nodes of a document. Raises InputError for bad transforms, and for nodes with two parents or in a ring."""
    items = document.all("node")
    children = [_children(document, item) for item in items]
    parents = np.full(len(items), -1)
    for parent, below in enumerate(children):
        for child in below:
            if parents[child] >= 0:
                raise InputError(f"node {child} is a child of two nodes")
            parents[child] = parent
    nodes = Nodes(parents, _fixed(items), _rest(document, items))
    shown, hidden = _walk(items, children, _roots(document, parents))
    return Stage(items, nodes, nodes.world(nodes.rest), shown, hidden)


def _children(document: Document, node: Item) -> list[int]:
    found = []
    for value in node.array("children"):
        child = as_whole(value)
        if child is None or not 0 <= child < len(document.all("node")):
            raise node.error(f"there is no node {shown(value)} to be its child")
        found.append(child)
    return found


def _roots(document: Document, parents: Array) -> list[int]:
    """Where the scene begins that the file names, else its first; without scenes, all nodes without parents."""
    scenes = document.all("scene")
    chosen = document.link(document.root, "scene", "scene")
    if not scenes:
        return np.flatnonzero(parents < 0).tolist()
    scene = scenes[chosen or 0]
    roots = []
    for value in scene.array("nodes"):
        document.at("node", value, scene.where)
        roots.append(int(value))
    return roots


def _walk(items: list[Item], children: list[list[int]], roots: list[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The nodes from the roots down, each once: those shown, and those hidden."""
    shown: list[int] = []
    hidden: list[int] = []
    seen: set[int] = set()
    waiting = [(root, True) for root in reversed(roots)]
    while waiting:
        node, visible = waiting.pop()
        if node in seen:
            continue
        seen.add(node)
        visibility = items[node].extension("KHR_node_visibility")
        visible = visible and (visibility is None or visibility.flag("visible", True))
        (shown if visible else hidden).append(node)
        waiting += [(child, visible) for child in reversed(children[node])]
    return tuple(shown), tuple(hidden)


def _fixed(items: list[Item]) -> dict[int, Array]:
    found = {}
    for number, item in enumerate(items):
        if item.has("matrix"):
            matrix = np.reshape(item.numbers("matrix", 16, _UNIT), (4, 4)).T
            matrix[3] = 0, 0, 0, 1
            found[number] = matrix
    return found


def _rest(document: Document, items: list[Item]) -> Pose:
    rotation = [item.numbers("rotation", 4, (0, 0, 0, 1)) for item in items]
    for item, quaternion in zip(items, rotation, strict=True):
        if not math.hypot(*quaternion) > 1e-100:
            raise item.error("rotation is zero")
    return Pose(
        np.reshape([item.numbers("translation", 3, (0, 0, 0)) for item in items], (-1, 3)).astype(np.float64),
        np.reshape(rotation, (-1, 4)).astype(np.float64),
        np.reshape([item.numbers("scale", 3, (1, 1, 1)) for item in items], (-1, 3)).astype(np.float64),
        tuple(_weights(document, item) for item in items),
    )


def _weights(document: Document, node: Item) -> Array:
    """How much of each morph target of its mesh a node has at rest."""
    index = document.link(node, "mesh", "mesh")
    if index is None:
        return np.zeros(0)
    mesh = document.all("mesh")[index]
    primitives = mesh.items("primitives", "primitive")
    count = len(primitives[0].array("targets")) if primitives else 0
    for item in (node, mesh):
        if item.array("weights"):
            return np.array(Item(item.values, node.where).numbers("weights", count, ()))
    return np.zeros(count)
