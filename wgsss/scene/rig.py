"""What moves the vertices of a glTF file: its nodes, the skins that hang on them, and its morph targets.

Equations and rules are those of the glTF 2.0 specification, sections 3.5 (nodes) and 3.7 (skins, morph targets).
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
    """How N nodes stand to their parents, and how far their meshes are morphed."""

    translation: Array
    """float64 (N, 3), the file's units"""
    rotation: Array
    """float64 (N, 4): quaternions x, y, z, w of any length above 0"""
    scale: Array
    """float64 (N, 3)"""
    weights: tuple[Array, ...]
    """float64 (T,) of each node: how much of each of the T morph targets of its mesh is added"""

    def copy(self) -> Pose:
        """One whose arrays may be written to."""
        return Pose(self.translation.copy(), self.rotation.copy(), self.scale.copy(), tuple(map(np.copy, self.weights)))


@dataclass(frozen=True, eq=False)
class Nodes:
    """The hierarchy of N nodes. Raises InputError where nodes are their own ancestors."""

    parents: Array
    """int (N,); -1 for roots"""
    fixed: dict[int, Array]
    """float64 (4, 4) of those nodes that are given by a matrix, which takes the place of what a pose says of them"""
    rest: Pose

    @cached_property
    def levels(self) -> list[Array]:
        """The nodes in order of their depth: int (n,) of those of each depth, beginning with the roots."""
        order = np.argsort(self.parents, kind="stable")
        first = np.searchsorted(self.parents[order], np.arange(len(self.parents) + 1))
        found, level, left = [], np.flatnonzero(self.parents < 0), len(self.parents)
        while len(level):
            found.append(level)
            left -= len(level)
            level = np.concatenate([order[first[node] : first[node + 1]] for node in level])
        if left:
            ring = self._ring(np.setdiff1d(np.arange(len(self.parents)), np.concatenate([*found, level]))[0])
            raise InputError(f"node {ring} is its own ancestor")
        return found

    def __post_init__(self) -> None:
        _ = self.levels

    def _ring(self, node: int) -> int:
        """The first node of the ring above a node."""
        for _ in range(len(self.parents)):
            node = int(self.parents[node])
        ring = {node}
        while (node := int(self.parents[node])) not in ring:
            ring.add(node)
        return min(ring)

    def world(self, pose: Pose) -> Array:
        """float64 (N, 4, 4): from each node's space to that of the scene."""
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
    """Rotation matrices (N, 3, 3) of quaternions (N, 4)."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


@dataclass(frozen=True, eq=False)
class Skin:
    """Which joints carry V vertices, and how much of each."""

    nodes: Array
    """int (J,): the node that each joint is"""
    inverse_bind: Array
    """float64 (J, 4, 4): from the mesh's space to that of the joint, where the mesh was bound"""
    joints: Array
    """int (V, K), indices into nodes"""
    weights: Array
    """float64 (V, K), rows summing to 1"""

    def carry(self, positions: Array, world: Array) -> Array:
        """Positions (V, 3) of the mesh in the scene's space, the world matrices of all nodes being (N, 4, 4)."""
        matrices = (world[self.nodes] @ self.inverse_bind)[:, :3].reshape(-1, 12)
        blended = np.zeros((len(positions), 12))
        for joint, weight in zip(self.joints.T, self.weights.T, strict=True):
            blended += weight[:, None] * matrices[joint]
        turn, shift = np.split(blended.reshape(-1, 3, 4), [3], axis=2)
        carried: Array = np.einsum("vij,vj->vi", turn, positions) + shift[:, :, 0]
        return carried


@dataclass(frozen=True, eq=False)
class Part:
    """V vertices of one primitive as a node places it."""

    node: int
    positions: Array
    """float64 (V, 3), the mesh's own space"""
    targets: Array
    """float32 (T, V, 3): what each morph target adds to the positions"""
    skin: Skin | None
    instance: Array | None = None
    """float64 (4, 4): where in the node's space it stands; None where it stands as the node does"""

    def is_shaped(self, pose: Pose) -> bool:
        """Whether a pose does more than to place it with its node."""
        return self.skin is not None or bool(pose.weights[self.node].any())

    def posed(self, pose: Pose, world: Array) -> Array:
        """float64 (V, 3), in the scene's space."""
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
    """All that moves in a file."""

    nodes: Nodes
    parts: tuple[Part, ...]

    def of(self, numbers: Sequence[int]) -> Rig:
        """The rig of some of the parts, by number."""
        return Rig(self.nodes, tuple(self.parts[number] for number in numbers))

    def positions(self, pose: Pose) -> Array:
        """float64 (V, 3): the vertices of all parts, one after the other, in the file's units."""
        world = self.nodes.world(pose)
        return np.concatenate([part.posed(pose, world) for part in self.parts])

    def movers(self) -> set[int]:
        """The nodes on whose place any vertex depends."""
        found: set[int] = set()
        for part in self.parts:
            for node in [part.node] if part.skin is None else part.skin.nodes.tolist():
                while node >= 0 and node not in found:
                    found.add(node)
                    node = int(self.nodes.parents[node])
        return found
