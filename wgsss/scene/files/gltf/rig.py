"""What moves the parts of a glTF file: their nodes, skins and morph targets (glTF 2.0, section 3.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import as_whole, plain
from wgsss.scene.files.gltf.nodes import Stage
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.files.gltf.parts import Placed
from wgsss.scene.files.gltf.primitive import Primitive
from wgsss.scene.rig import Part, Rig, Skin

Array = npt.NDArray[Any]

_MORPHED = {"POSITION", "NORMAL", "TANGENT"}  # the last two follow from the first


def read_rig(document: Document, stage: Stage, placed: Sequence[Placed], notes: Notes) -> Rig | None:
    """The rig of the parts that a scene shows, in their order; None where none is skinned or morphed and the file has
    no animation.

    Vertices of a skin without weights go with its first joint, which is noted.
    Raises InputError for whatever does not fit, without the file's name.
    """
    moving = document.all("animation") or any(
        stage.items[one.node].has("skin") or one.primitive.item.array("targets") for one in placed
    )
    if not moving:
        return None
    skins = _Skins(document, stage)
    targets: dict[tuple[int, int], Array] = {}
    parts, bare = [], 0
    for one in placed:
        primitive, what = one.primitive, one.primitive.item.where
        key = (one.mesh, id(primitive))
        if key not in targets:
            targets[key] = _targets(document, primitive, notes)
        expected = len(stage.nodes.rest.weights[one.node])
        if len(targets[key]) != expected:
            raise InputError(f"{what}: it has {len(targets[key])} morph targets where its mesh has {expected}")
        skin, alone = skins.of(one)
        parts.append(Part(one.node, primitive.positions, targets[key], skin, one.instance))
        bare += alone
    if bare:
        notes.add("without joint weights, and carried by the skin's first joint:", "vertex", bare)
    return Rig(stage.nodes, tuple(parts))


def _targets(document: Document, primitive: Primitive, notes: Notes) -> Array:
    """float32 (T, V, 3). Only positions: normals are made from the posed surface, as for every motion."""
    items = primitive.item.items("targets", "morph target")
    for name in sorted({name for target in items for name in target.values} - _MORPHED):
        notes.add(f"{plain(name)} of morph targets left out:", "primitive")
    found: Array = np.zeros((len(items), len(primitive.positions), 3), np.float32)
    for number, target in enumerate(items):
        if target.has("POSITION"):
            rows = document.numbers(target.get("POSITION"), "VEC3", target.where, primitive.vertices)
            with np.errstate(over="ignore"):  # the mesh refuses what is not finite
                found[number] = primitive.pick(rows)
    return found


class _Skins:
    """The skins of a document, and which of their joints carry a primitive."""

    def __init__(self, document: Document, stage: Stage) -> None:
        self._document, self._stage = document, stage
        self._binds: dict[int, tuple[Array, Array]] = {}
        self._weights: dict[int, tuple[Array, Array]] = {}

    def of(self, one: Placed) -> tuple[Skin | None, int]:
        """The skin of a part, None where it has none, and how many of its vertices have no weights."""
        number = self._skin_of(one)
        if number is None:
            return None, 0
        what, skin = one.primitive.item.where, f"skin {number}"
        nodes, inverse = self._bind(number)
        joint, weight = self._shares(one.primitive, f"{what}: it has {skin}, but no JOINTS_0 and WEIGHTS_0")
        bare = weight.sum(axis=1) == 0
        weight = weight.copy()
        weight[bare, 0] = 1
        out = (weight > 0) & ((joint < 0) | (joint >= len(nodes)))
        if out.any():
            raise InputError(f"{what}: a vertex is carried by joint {joint[out][0]}, but {skin} has {len(nodes)}")
        joint = np.where(weight > 0, joint, 0)
        return Skin(nodes, inverse, joint, weight / weight.sum(axis=1, keepdims=True)), int(bare.sum())

    def _skin_of(self, one: Placed) -> int | None:
        node = self._stage.items[one.node]
        if not node.has("skin"):
            return None
        self._document.at("skin", node.get("skin"), one.primitive.item.where)
        return int(node.get("skin"))

    def _bind(self, number: int) -> tuple[Array, Array]:
        """The nodes (J,) that the joints of a skin are, and their inverse bind matrices (J, 4, 4)."""
        if number in self._binds:
            return self._binds[number]
        skin, count = self._document.all("skin")[number], len(self._stage.items)
        joints = [as_whole(value) for value in skin.array("joints")]
        if not joints or not all(joint is not None and 0 <= joint < count for joint in joints):
            raise skin.error(f"its joints must be one or more of the {count} nodes")
        nodes = np.array(joints, np.int64)
        for node in nodes:
            self._stage.place(node)
        inverse = np.broadcast_to(np.eye(4), (len(nodes), 4, 4))
        if skin.has("inverseBindMatrices"):
            what = f"{skin.where}: inverse bind matrices"
            matrices = self._document.numbers(skin.get("inverseBindMatrices"), "MAT4", what)
            if len(matrices) < len(nodes):
                raise skin.error(f"{len(matrices)} inverse bind matrices for {len(nodes)} joints")
            inverse = matrices[: len(nodes)].reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
        self._binds[number] = nodes, inverse
        return nodes, inverse

    def _shares(self, primitive: Primitive, otherwise: str) -> tuple[Array, Array]:
        """The joints int (V, K) of the vertices of a primitive, and how much each carries (V, K)."""
        what, attributes = primitive.item.where, primitive.attributes
        sets = attributes.numbered("JOINTS")
        if 0 not in sets:
            raise InputError(otherwise)
        joints, weights = [], []
        for number in sets:
            if f"WEIGHTS_{number}" not in attributes.names:
                raise InputError(f"{what}: JOINTS_{number} without WEIGHTS_{number}")
            joints.append(primitive.read(f"JOINTS_{number}", "VEC4").astype(np.int64))
            weights.append(primitive.read(f"WEIGHTS_{number}", "VEC4").astype(np.float64))
        joint, weight = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
        if weight.min() < 0:
            raise InputError(f"{what}: a joint's weight is below 0")
        return joint, weight
