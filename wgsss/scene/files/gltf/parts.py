"""Reader of the parts of a glTF scene: one for each primitive of the mesh of each node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.contents import Part
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.looks import Looks
from wgsss.scene.files.gltf.nodes import SceneNodes
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.files.gltf.primitive import Primitive, read_primitive
from wgsss.scene.rig import turns

Array = npt.NDArray[Any]

INSTANCES = "EXT_mesh_gpu_instancing"
MAX_PARTS, MAX_FACES = 100_000, 100_000_000
"""limits for the scene of a file: a few bytes of JSON can ask for more parts than fit into memory"""


@dataclass(frozen=True, eq=False)
class PlacedPrimitive:
    """A primitive at a node of the scene."""

    node: int
    mesh: int
    primitive: Primitive
    instance: Array | None
    """float64 (4, 4): transform of an instance in the space of the node; None without instances"""
    part: Part


def read_parts(document: Document, scene: SceneNodes, notes: Notes) -> list[PlacedPrimitive]:
    """Read the parts that the scene shows, in the order of its nodes.

    The matrix of a skinned part is the identity, because only the joints of its skin place it. Raises InputError for
    invalid meshes and materials, and if the scene has no triangles.
    """
    looks, meshes = Looks(document, notes), {}
    placed: list[PlacedPrimitive] = []
    faces = 0
    for node in scene.shown:
        item = scene.items[node]
        mesh = document.link(item, "mesh", "mesh")
        if mesh is None:
            continue
        if mesh not in meshes:
            meshes[mesh] = _primitives(document, document.all("mesh")[mesh], notes)
        skinned = item.has("skin")
        for instance in [None] if skinned else _instances(document, item):
            faces += sum(len(primitive.faces) for primitive in meshes[mesh])
            if len(placed) + len(meshes[mesh]) > MAX_PARTS or faces > MAX_FACES:
                raise InputError(f"its scene has more than {MAX_PARTS} parts or {MAX_FACES} triangles")
            matrix = np.eye(4) if skinned else scene.place(node)
            matrix = matrix if instance is None else matrix @ instance
            for primitive in meshes[mesh]:
                look = looks.of(primitive.item, primitive.uvs)
                placed.append(PlacedPrimitive(node, mesh, primitive, instance, _part(primitive, look, matrix)))
    _note_unshown(document, scene, notes)
    if not placed:
        raise InputError("the mesh is empty: it has no faces" + "".join(f"; {line}" for line in notes.lines()))
    return placed


def _note_unshown(document: Document, scene: SceneNodes, notes: Notes) -> None:
    """Add notes that count the nodes with meshes that the scene does not show, and the meshes that no node uses."""
    meshes = {node: item.get("mesh") for node, item in enumerate(scene.items) if item.has("mesh")}
    hidden = [node for node in scene.hidden if node in meshes]
    if hidden:
        notes.add("left out because KHR_node_visibility hides them:", "node", len(hidden))
    outside = meshes.keys() - {*scene.shown, *scene.hidden}
    if outside:
        notes.add("left out because the scene does not contain them:", "node", len(outside))
    unused = len(document.all("mesh")) - len(set(meshes.values()))
    if unused > 0:
        notes.add("left out because no node uses them:", "mesh", unused)


def _part(primitive: Primitive, look: Any, matrix: Array) -> Part:
    return Part(
        primitive.item.location,
        primitive.positions,
        primitive.faces,
        look,
        matrix,
        primitive.normals,
        primitive.uvs,
        primitive.colors,
    )


def _primitives(document: Document, mesh: Item, notes: Notes) -> list[Primitive]:
    items = mesh.items("primitives", "primitive")
    return [p for p in (read_primitive(document, item, notes) for item in items) if p is not None]


def _instances(document: Document, node: Item) -> list[Array | None]:
    """Read the transforms (4, 4) of the instances of a node, in its space. Return [None] if it has no instances."""
    extension = node.extension(INSTANCES)
    if extension is None:
        return [None]
    attributes = extension.item("attributes") or Item({})
    kinds = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
    rows, count = {}, None
    for name, kind in kinds.items():
        if attributes.has(name):
            rows[name] = document.numbers(attributes.get(name), kind, f"{extension.location}: {name}", count)
            count = len(rows[name])
    if count is None:
        return [None]
    if count > MAX_PARTS:
        raise extension.error(f"it has {count} instances; at most {MAX_PARTS} can be read")
    matrices = np.tile(np.eye(4), (count, 1, 1))
    rotation = rows.get("ROTATION", np.tile((0.0, 0.0, 0.0, 1.0), (count, 1)))
    if not (np.abs(rotation) > 1e-100).any(axis=1).all():
        raise extension.error("a rotation is zero")
    matrices[:, :3, :3] = turns(rotation) * rows.get("SCALE", np.ones((count, 3)))[:, None, :]
    matrices[:, :3, 3] = rows.get("TRANSLATION", 0)
    return list(matrices)
