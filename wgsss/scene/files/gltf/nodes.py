"""Reader of the nodes of a glTF file: their hierarchy at rest, and the nodes that the scene shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item, as_whole, json_text
from wgsss.scene.rig import Nodes, Pose

Array = npt.NDArray[Any]

_UNIT = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class SceneNodes:
    """The N nodes of a file, and the indices of those that its scene shows."""

    items: list[Item]
    nodes: Nodes
    world: Array
    """float64 (N, 4, 4): transforms from the nodes to the space of the file, at rest; `place` checks them"""
    shown: tuple[int, ...]
    """the visible nodes of the scene, from its roots down"""
    hidden: tuple[int, ...]
    """the nodes of the scene that KHR_node_visibility hides"""

    def place(self, node: int) -> Array:
        """Return the transform (4, 4) from a node to the space of the file. Raises InputError if it is not finite."""
        if not np.isfinite(self.world[node]).all():
            raise self.items[node].error("its transform is not finite")
        return self.world[node]


def read_nodes(document: Document) -> SceneNodes:
    """Read the nodes of a document.

    Raises InputError for invalid transforms, and for nodes that have two parents or are their own ancestors.
    """
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
    return SceneNodes(items, nodes, nodes.world(nodes.rest), shown, hidden)


def _children(document: Document, node: Item) -> list[int]:
    children = []
    for value in node.array("children"):
        child = as_whole(value)
        if child is None or not 0 <= child < len(document.all("node")):
            raise node.error(f"its child, node {json_text(value)}, does not exist")
        children.append(child)
    return children


def _roots(document: Document, parents: Array) -> list[int]:
    """Return the roots of the default scene, or else of the first. Without scenes, return all nodes without parents."""
    scenes = document.all("scene")
    chosen = document.link(document.root, "scene", "scene")
    if not scenes:
        return np.flatnonzero(parents < 0).tolist()
    scene = scenes[chosen or 0]
    roots = []
    for value in scene.array("nodes"):
        document.at("node", value, scene.location)
        roots.append(int(value))
    return roots


def _walk(items: list[Item], children: list[list[int]], roots: list[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Walk the nodes from the roots down, each once. Return the visible nodes and the hidden ones."""
    shown: list[int] = []
    hidden: list[int] = []
    visited: set[int] = set()
    waiting = [(root, True) for root in reversed(roots)]
    while waiting:
        node, visible = waiting.pop()
        if node in visited:
            continue
        visited.add(node)
        visibility = items[node].extension("KHR_node_visibility")
        visible = visible and (visibility is None or visibility.flag("visible", True))
        (shown if visible else hidden).append(node)
        waiting += [(child, visible) for child in reversed(children[node])]
    return tuple(shown), tuple(hidden)


def _fixed(items: list[Item]) -> dict[int, Array]:
    matrices = {}
    for number, item in enumerate(items):
        if item.has("matrix"):
            matrix = np.reshape(item.numbers("matrix", 16, _UNIT), (4, 4)).T
            matrix[3] = 0, 0, 0, 1
            matrices[number] = matrix
    return matrices


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
    """Read the weights at rest of the morph targets of the mesh of a node."""
    index = document.link(node, "mesh", "mesh")
    if index is None:
        return np.zeros(0)
    mesh = document.all("mesh")[index]
    primitives = mesh.items("primitives", "primitive")
    count = len(primitives[0].array("targets")) if primitives else 0
    for item in (node, mesh):
        if item.array("weights"):
            return np.array(Item(item.values, node.location).numbers("weights", count, ()))
    return np.zeros(count)
