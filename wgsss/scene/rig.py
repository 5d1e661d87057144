"""The rig of a glTF file: the nodes, skins and morph targets that move its vertices.

It follows the glTF 2.0 specification, sections 3.5 (nodes) and 3.7 (skins, morph targets).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Pose:
    """The transforms of N nodes relative to their parents, and the weights of their morph targets."""

    translation: Array
    """float64 (N, 3), in the unit of the file"""
    rotation: Array
    """float64 (N, 4): quaternions x, y, z, w of any nonzero length"""
    scale: Array
    """float64 (N, 3)"""
    weights: tuple[Array, ...]
    """float64 (T,) for each node: the weights of the T morph targets of its mesh"""

    def copy(self) -> Pose:
        """Copy the pose, so that its arrays can be changed."""
        return Pose(self.translation.copy(), self.rotation.copy(), self.scale.copy(), tuple(map(np.copy, self.weights)))


@dataclass(frozen=True, eq=False)
class Nodes:
    """The hierarchy of N nodes. Raises InputError if a node is its own ancestor."""

    parents: Array
    """int (N,); -1 for roots"""
    fixed: dict[int, Array]
    """float64 (4, 4) for nodes that are defined by a matrix, which replaces their transform in any pose"""
    rest: Pose

    @cached_property
    def levels(self) -> list[Array]:
        """The indices int (n,) of the nodes at each depth, starting with the roots."""
        order = np.argsort(self.parents, kind="stable")
        first = np.searchsorted(self.parents[order], np.arange(len(self.parents) + 1))
        by_depth, level, left = [], np.flatnonzero(self.parents < 0), len(self.parents)
        while len(level):
            by_depth.append(level)
            left -= len(level)
            level = np.concatenate([order[first[node] : first[node + 1]] for node in level])
        if left:
            ring = self._ring(np.setdiff1d(np.arange(len(self.parents)), np.concatenate([*by_depth, level]))[0])
            raise InputError(f"node {ring} is its own ancestor")
        return by_depth

    def __post_init__(self) -> None:
        _ = self.levels

    def _ring(self, node: int) -> int:
        """Return the smallest index in the cycle of ancestors above a node."""
        for _ in range(len(self.parents)):
            node = int(self.parents[node])
        ring = {node}
        while (node := int(self.parents[node])) not in ring:
            ring.add(node)
        return min(ring)

    def world(self, pose: Pose) -> Array:
        """Compute the matrices from the space of each node to that of the scene: float64 (N, 4, 4)."""
        local = np.zeros((len(self.parents), 4, 4))
        with np.errstate(all="ignore"):  # what is not finite is the caller's to find
            local[:, :3, :3] = turns(pose.rotation) * pose.scale[:, None, :]
            local[:, :3, 3], local[:, 3, 3] = pose.translation, 1
            for node, matrix in self.fixed.items():
                local[node] = matrix
            world = local.copy()
            for level in self.levels[1:]:
                world[level] = world[self.parents[level]] @ local[level]
        return world


def turns(quaternions: Array) -> Array:
    """Convert quaternions (N, 4) to rotation matrices (N, 3, 3)."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


@dataclass(frozen=True, eq=False)
class Skin:
    """The joints that move V vertices, and their weights."""

    nodes: Array
    """int (J,): the node of each joint"""
    inverse_bind: Array
    """float64 (J, 4, 4): from the space of the mesh to that of the joint, in the bind pose"""
    joints: Array
    """int (V, K), indices into nodes"""
    weights: Array
    """float64 (V, K), rows summing to 1"""

    def carry(self, positions: Array, world: Array) -> Array:
        """Skin positions (V, 3) of the mesh into scene space, with the world matrices (N, 4, 4) of all nodes."""
        matrices = (world[self.nodes] @ self.inverse_bind)[:, :3].reshape(-1, 12)
        blended = np.zeros((len(positions), 12))
        for joint, weight in zip(self.joints.T, self.weights.T, strict=True):
            blended += weight[:, None] * matrices[joint]
        turn, shift = np.split(blended.reshape(-1, 3, 4), [3], axis=2)
        carried: Array = np.einsum("vij,vj->vi", turn, positions) + shift[:, :, 0]
        return carried


@dataclass(frozen=True, eq=False)
class Part:
    """The V vertices of a primitive at a node."""

    node: int
    positions: Array
    """float64 (V, 3), in the space of the mesh"""
    targets: Array
    """float32 (T, V, 3): the offsets of each morph target"""
    skin: Skin | None
    instance: Array | None = None
    """float64 (4, 4): transform of an instance in the space of the node, or None"""

    def is_shaped(self, pose: Pose) -> bool:
        """Whether a pose deforms the part, by a skin or by morph targets."""
        return self.skin is not None or bool(pose.weights[self.node].any())

    def posed(self, pose: Pose, world: Array) -> Array:
        """Compute the positions in scene space: float64 (V, 3)."""
        morphed = self.positions
        for weight, target in zip(pose.weights[self.node], self.targets, strict=True):
            if weight:
                morphed = morphed + weight * target
        if self.skin is not None:
            return self.skin.carry(morphed, world)  # where the node itself stands does not matter then
        matrix = world[self.node] if self.instance is None else world[self.node] @ self.instance
        return np.einsum("ij,vj->vi", matrix[:3, :3], morphed) + matrix[:3, 3]


@dataclass(frozen=True, eq=False)
class Rig:
    """The nodes of a file and the parts that they move."""

    nodes: Nodes
    parts: tuple[Part, ...]

    def of(self, numbers: Sequence[int]) -> Rig:
        """Return the rig of some of the parts, by number."""
        return Rig(self.nodes, tuple(self.parts[number] for number in numbers))

    def positions(self, pose: Pose) -> Array:
        """Compute the positions of the vertices of all parts in a row: float64 (V, 3), in the unit of the file."""
        world = self.nodes.world(pose)
        return np.concatenate([part.posed(pose, world) for part in self.parts])

    def movers(self) -> set[int]:
        """Return the nodes whose transform affects any vertex."""
        nodes: set[int] = set()
        for part in self.parts:
            for node in [part.node] if part.skin is None else part.skin.nodes.tolist():
                while node >= 0 and node not in nodes:
                    nodes.add(node)
                    node = int(self.nodes.parents[node])
        return nodes
