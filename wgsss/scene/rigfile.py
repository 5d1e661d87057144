"""Reading the rig of a glTF file, its parts in the order in which the mesh reader has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.gltf import Document
from wgsss.scene.rig import Nodes, Part, Pose, Rig, Skin

Array = npt.NDArray[Any]

TRIANGLES = (4, 5)  # modes of primitives: triangles and strips of them; the mesh reader skips all others


def read_rig(document: Document, placed: Sequence[tuple[Array, Array]]) -> tuple[Rig, int]:
    """The rig of a document, and how many vertices of its skins have no weights. They go with their first joint.

    `placed` are the parts that the mesh reader found: positions (V, 3) as in the file, and the (4, 4) of their node.
    Raises InputError for whatever does not fit, without the file's name.
    """
    tree = document.tree
    nodes = _nodes(tree)
    world = nodes.world(nodes.rest)
    if not np.isfinite(world).all():
        raise InputError("its nodes are beyond all bounds")
    waiting = []
    for node, data in enumerate(tree.nodes):
        primitives = [] if data.mesh is None else tree.meshes[data.mesh].primitives
        for number, primitive in enumerate(primitives):
            if primitive.mode in TRIANGLES:
                what = f"mesh {data.mesh}, primitive {number}"
                at = document.numbers(primitive.attributes.POSITION, "VEC3", f"the positions of {what}")
                waiting.append((node, primitive, at.astype(np.float64), what))
    parts, bare = [], 0
    for vertices, matrix in placed:
        same = [i for i, (_, _, positions, _) in enumerate(waiting) if np.array_equal(positions, vertices)]
        near = 1e-6 * max(np.abs(matrix).max(), 1e-30)
        same = [i for i in same if np.allclose(world[waiting[i][0]], matrix, rtol=1e-6, atol=near)]
        if not same:
            raise InputError("skins and animations of a mesh that an extension compresses or places cannot be read")
        node, primitive, positions, what = waiting.pop(same[0])
        targets, expected = _targets(document, primitive, len(positions), what), len(nodes.rest.weights[node])
        if len(targets) != expected:
            raise InputError(f"{what}: it has {len(targets)} morph targets where its mesh has {expected}")
        skin, alone = _skin(document, tree.nodes[node].skin, primitive, len(positions), what)
        parts.append(Part(node, positions, targets, skin))
        bare += alone
    return Rig(nodes, tuple(parts)), bare


def _nodes(tree: Any) -> Nodes:
    parents = np.full(len(tree.nodes), -1)
    for parent, node in enumerate(tree.nodes):
        for child in node.children or ():
            if not 0 <= child < len(parents):
                raise InputError(f"node {parent}: there is no node {child} to be its child")
            if parents[child] >= 0:
                raise InputError(f"node {child} is a child of two nodes")
            parents[child] = parent
    fixed = {i: _row(n.matrix, 16, f"node {i}: matrix").reshape(4, 4).T for i, n in enumerate(tree.nodes) if n.matrix}
    translation, rotation, scale, weights = [], [], [], []
    for number, node in enumerate(tree.nodes):
        translation.append(_row(node.translation or (0, 0, 0), 3, f"node {number}: translation"))
        rotation.append(_row(node.rotation or (0, 0, 0, 1), 4, f"node {number}: rotation"))
        scale.append(_row(node.scale or (1, 1, 1), 3, f"node {number}: scale"))
        if not rotation[-1].any():
            raise InputError(f"node {number}: rotation is zero")
        mesh = None if node.mesh is None else tree.meshes[node.mesh]
        count = len(mesh.primitives[0].targets or ()) if mesh else 0
        given = node.weights or (mesh and mesh.weights) or [0.0] * count
        weights.append(_row(given, count, f"node {number}: weights of its morph targets"))
    rest = Pose(
        np.reshape(translation, (-1, 3)), np.reshape(rotation, (-1, 4)), np.reshape(scale, (-1, 3)), tuple(weights)
    )
    return Nodes(parents, fixed, rest)


def _row(values: Any, count: int, what: str) -> Array:
    row = np.array(values, np.float64)
    if row.shape != (count,) or not np.isfinite(row).all():
        raise InputError(f"{what} must be {count} finite numbers")
    return row


def _targets(document: Document, primitive: Any, vertices: int, what: str) -> Array:
    """float32 (T, V, 3). Only positions: normals are made from the posed surface, as for every motion."""
    found = np.zeros((len(primitive.targets or ()), vertices, 3), np.float32)
    for number, target in enumerate(primitive.targets or ()):
        if "POSITION" in target:
            where = f"{what}, morph target {number}"
            found[number] = document.numbers(target["POSITION"], "VEC3", where, vertices)
    return found


def _skin(document: Document, index: int | None, primitive: Any, vertices: int, what: str) -> tuple[Skin | None, int]:
    if index is None:
        return None, 0
    tree, where = document.tree, f"skin {index}"
    if not 0 <= index < len(tree.skins):
        raise InputError(f"{what}: there is no {where}")
    skin = tree.skins[index]
    nodes = np.array(skin.joints or (), np.int64)
    if not len(nodes) or nodes.min() < 0 or nodes.max() >= len(tree.nodes):
        raise InputError(f"{where}: its joints must be one or more of the {len(tree.nodes)} nodes")
    if skin.inverseBindMatrices is None:
        inverse = np.broadcast_to(np.eye(4), (len(nodes), 4, 4))
    else:
        matrices = document.numbers(skin.inverseBindMatrices, "MAT4", f"{where}: inverse bind matrices")
        if len(matrices) < len(nodes):
            raise InputError(f"{where}: {len(matrices)} inverse bind matrices for {len(nodes)} joints")
        inverse = matrices[: len(nodes)].reshape(-1, 4, 4).transpose(0, 2, 1)

    joints, weights, number = [], [], 0
    while getattr(primitive.attributes, f"JOINTS_{number}", None) is not None:
        weight = getattr(primitive.attributes, f"WEIGHTS_{number}", None)
        if weight is None:
            raise InputError(f"{what}: JOINTS_{number} without WEIGHTS_{number}")
        joint = getattr(primitive.attributes, f"JOINTS_{number}")
        joints.append(document.numbers(joint, "VEC4", f"{what}: JOINTS_{number}", vertices).astype(np.int64))
        weights.append(document.numbers(weight, "VEC4", f"{what}: WEIGHTS_{number}", vertices).astype(np.float64))
        number += 1
    if not joints:
        raise InputError(f"{what}: it has {where}, but no JOINTS_0 and WEIGHTS_0")
    joint, weight = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
    if weight.min() < 0:
        raise InputError(f"{what}: a joint's weight is below 0")
    bare = weight.sum(axis=1) == 0
    weight[bare, 0] = 1
    out = (weight > 0) & ((joint < 0) | (joint >= len(nodes)))
    if out.any():
        raise InputError(f"{what}: a vertex is carried by joint {joint[out][0]}, but {where} has {len(nodes)}")
    joint = np.where(weight > 0, joint, 0)
    return Skin(nodes, inverse, joint, weight / weight.sum(axis=1, keepdims=True)), int(bare.sum())
