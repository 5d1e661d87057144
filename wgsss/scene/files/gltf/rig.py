"""Reader of the rig of a glTF file: nodes, skins and morph targets (glTF 2.0, section 3.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import as_whole, printable
from wgsss.scene.files.gltf.nodes import SceneNodes
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.files.gltf.parts import PlacedPrimitive
from wgsss.scene.files.gltf.primitive import Primitive
from wgsss.scene.rig import Part, Rig, Skin

Array = npt.NDArray[Any]

_MORPHED = {"POSITION", "NORMAL", "TANGENT"}  # normals and tangents are computed from positions


def read_rig(document: Document, scene: SceneNodes, placed: Sequence[PlacedPrimitive], notes: Notes) -> Rig | None:
    """Read the rig of the placed primitives, in their order.

    Returns None if no primitive has a skin or morph targets and the file has no animation. Vertices of a skin without
    weights follow its first joint, which a note counts. Raises InputError, without the name of the file, for data that
    are invalid or do not fit together.
    """
    moving = document.all("animation") or any(
        scene.items[placement.node].has("skin") or placement.primitive.item.array("targets") for placement in placed
    )
    if not moving:
        return None
    skins = _Skins(document, scene)
    targets: dict[tuple[int, int], Array] = {}
    parts, bare = [], 0
    for placement in placed:
        primitive = placement.primitive
        key = (placement.mesh, id(primitive))
        if key not in targets:
            targets[key] = _targets(document, primitive, notes)
        expected = len(scene.nodes.rest.weights[placement.node])
        if len(targets[key]) != expected:
            raise primitive.item.error(f"it has {len(targets[key])} morph targets, but its mesh has {expected}")
        skin, without_weights = skins.of(placement)
        parts.append(Part(placement.node, primitive.positions, targets[key], skin, placement.instance))
        bare += without_weights
    if bare:
        notes.add("without joint weights, moved by the first joint of the skin:", "vertex", bare)
    return Rig(scene.nodes, tuple(parts))


def _targets(document: Document, primitive: Primitive, notes: Notes) -> Array:
    """Read the position offsets of T morph targets: float32 (T, V, 3). Normals follow from posed positions."""
    items = primitive.item.items("targets", "morph target")
    for name in sorted({name for target in items for name in target.values} - _MORPHED):
        notes.add(f"{printable(name)} of morph targets left out:", "primitive")
    offsets: Array = np.zeros((len(items), len(primitive.positions), 3), np.float32)
    for number, target in enumerate(items):
        if target.has("POSITION"):
            rows = document.numbers(target.get("POSITION"), "VEC3", target.location, primitive.vertices)
            with np.errstate(over="ignore"):  # the mesh rejects positions that are not finite
                offsets[number] = primitive.select(rows)
    return offsets


class _Skins:
    """The skins of a document, each read once."""

    def __init__(self, document: Document, scene: SceneNodes) -> None:
        self._document, self._scene = document, scene
        self._binds: dict[int, tuple[Array, Array]] = {}
        self._weights: dict[int, tuple[Array, Array]] = {}

    def of(self, placed: PlacedPrimitive) -> tuple[Skin | None, int]:
        """Return the skin of a primitive, or None, and the number of its vertices without weights."""
        number = self._skin_of(placed)
        if number is None:
            return None, 0
        location, skin = placed.primitive.item.location, f"skin {number}"
        nodes, inverse = self._bind(number)
        joint, weight = self._joint_weights(
            placed.primitive, f"{location}: it has {skin}, but no JOINTS_0 and WEIGHTS_0"
        )
        bare = weight.sum(axis=1) == 0
        weight = weight.copy()
        weight[bare, 0] = 1
        bad = (weight > 0) & ((joint < 0) | (joint >= len(nodes)))
        if bad.any():
            raise InputError(f"{location}: a vertex uses joint {joint[bad][0]}, but {skin} has {len(nodes)}")
        joint = np.where(weight > 0, joint, 0)
        return Skin(nodes, inverse, joint, weight / weight.sum(axis=1, keepdims=True)), int(bare.sum())

    def _skin_of(self, placed: PlacedPrimitive) -> int | None:
        node = self._scene.items[placed.node]
        if not node.has("skin"):
            return None
        self._document.at("skin", node.get("skin"), placed.primitive.item.location)
        return int(node.get("skin"))

    def _bind(self, number: int) -> tuple[Array, Array]:
        """Return the nodes (J,) of the joints of a skin, and the inverse bind matrices (J, 4, 4)."""
        if number in self._binds:
            return self._binds[number]
        skin, count = self._document.all("skin")[number], len(self._scene.items)
        joints = [as_whole(value) for value in skin.array("joints")]
        if not joints or not all(joint is not None and 0 <= joint < count for joint in joints):
            raise skin.error(f"its joints must be one or more of the {count} nodes")
        nodes = np.array(joints, np.int64)
        for node in nodes:
            self._scene.place(node)
        inverse = np.broadcast_to(np.eye(4), (len(nodes), 4, 4))
        if skin.has("inverseBindMatrices"):
            label = f"{skin.location}: inverse bind matrices"
            matrices = self._document.numbers(skin.get("inverseBindMatrices"), "MAT4", label)
            if len(matrices) < len(nodes):
                raise skin.error(f"{len(matrices)} inverse bind matrices for {len(nodes)} joints")
            inverse = matrices[: len(nodes)].reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
        self._binds[number] = nodes, inverse
        return nodes, inverse

    def _joint_weights(self, primitive: Primitive, missing: str) -> tuple[Array, Array]:
        """Read the joints int (V, K) of the vertices of a primitive, and their weights (V, K).

        Raises InputError with the message `missing` if the primitive has no joints.
        """
        attributes = primitive.attributes
        sets = attributes.numbered("JOINTS")
        if 0 not in sets:
            raise InputError(missing)
        joints, weights = [], []
        for number in sets:
            if f"WEIGHTS_{number}" not in attributes.names:
                raise primitive.item.error(f"JOINTS_{number} without WEIGHTS_{number}")
            joints.append(primitive.read(f"JOINTS_{number}", "VEC4").astype(np.int64))
            weights.append(primitive.read(f"WEIGHTS_{number}", "VEC4").astype(np.float64))
        joint, weight = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
        if weight.min() < 0:
            raise primitive.item.error("the weight of a joint is below 0")
        return joint, weight
