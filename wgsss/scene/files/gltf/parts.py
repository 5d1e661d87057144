"""The parts that the scene of a glTF file shows: each primitive of each mesh, wherever a node places it."""

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
from wgsss.scene.files.gltf.nodes import Stage
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.files.gltf.primitive import Primitive, read_primitive
from wgsss.scene.rig import turns

Array = npt.NDArray[Any]

INSTANCES = "EXT_mesh_gpu_instancing"
MAX_PARTS, MAX_FACES = 100_000, 100_000_000
"""placed by the scene of a file: a few bytes of JSON can ask for more than any memory holds"""


@dataclass(frozen=True, eq=False)
class Placed:
    """A primitive where a node places it."""

    node: int
    mesh: int
    primitive: Primitive
    instance: Array | None
    """float64 (4, 4) in the node's space, of one of its instances; None where there are none"""
    part: Part


def read_parts(document: Document, stage: Stage, notes: Notes) -> list[Placed]:
    """What the scene shows, in the order of its nodes.

    The matrix of a skinned part is the identity: the joints of its skin alone say where it is.
    Raises InputError for bad meshes and materials, and where there is no triangle at all.
    """
    looks, meshes = Looks(document, notes), {}
    found: list[Placed] = []
    faces = 0
    for node in stage.shown:
        item = stage.items[node]
        mesh = document.link(item, "mesh", "mesh")
        if mesh is None:
            continue
        if mesh not in meshes:
            meshes[mesh] = _primitives(document, document.all("mesh")[mesh], notes)
        skinned = item.has("skin")
        for instance in [None] if skinned else _instances(document, item):
            faces += sum(len(primitive.faces) for primitive in meshes[mesh])
            if len(found) + len(meshes[mesh]) > MAX_PARTS or faces > MAX_FACES:
                raise InputError(f"its scene places more than {MAX_PARTS} parts or {MAX_FACES} triangles")
            matrix = np.eye(4) if skinned else stage.place(node)
            matrix = matrix if instance is None else matrix @ instance
            for primitive in meshes[mesh]:
                look = looks.of(primitive.item, primitive.uvs)
                found.append(Placed(node, mesh, primitive, instance, _part(primitive, look, matrix)))
    _note_unshown(document, stage, notes)
    if not found:
        raise InputError("the mesh is empty: it has no faces" + "".join(f"; {line}" for line in notes.lines()))
    return found


def _note_unshown(document: Document, stage: Stage, notes: Notes) -> None:
    """Count the nodes with meshes that the scene does not show, and the meshes that no node places."""
    meshes = {node: item.get("mesh") for node, item in enumerate(stage.items) if item.has("mesh")}
    hidden = [node for node in stage.hidden if node in meshes]
    if hidden:
        notes.add("left out, for KHR_node_visibility hides them:", "node", len(hidden))
    outside = meshes.keys() - {*stage.shown, *stage.hidden}
    if outside:
        notes.add("left out, for the scene that is shown does not hold them:", "node", len(outside))
    unplaced = len(document.all("mesh")) - len(set(meshes.values()))
    if unplaced > 0:
        notes.add("left out, for no node places them:", "mesh", unplaced)


def _part(primitive: Primitive, look: Any, matrix: Array) -> Part:
    return Part(
        primitive.item.where,
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
    """The places (4, 4) in its space of the instances of a node; None alone where it has none."""
    extension = node.extension(INSTANCES)
    if extension is None:
        return [None]
    attributes = extension.item("attributes") or Item({})
    kinds = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
    rows, count = {}, None
    for name, kind in kinds.items():
        if attributes.has(name):
            rows[name] = document.numbers(attributes.get(name), kind, f"{extension.where}: {name}", count)
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
