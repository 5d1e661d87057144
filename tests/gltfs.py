"""Construction of glTF files for tests: a tree of JSON, and the data of its accessors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

CODES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TETRAHEDRON = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


class File:
    """A glTF file under construction. Methods that add an object return its index."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.data = bytearray()

    def add(self, collection: str, **fields: Any) -> int:
        """Add an object to a collection such as "nodes"."""
        items = self.tree.setdefault(collection, [])
        items.append(fields)
        return len(items) - 1

    def view(self, values: Any, dtype: str = "u1", **fields: Any) -> int:
        """Add a buffer view of numbers or bytes."""
        data = values if isinstance(values, bytes) else np.ascontiguousarray(values, "<" + dtype).tobytes()
        self.data += bytes(-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.data += data
        return self.add("bufferViews", **{**place, **fields})

    def rows(self, values: Any, kind: str, dtype: str = "f4", **fields: Any) -> int:
        """Add an accessor with its own buffer view."""
        own = {
            "bufferView": self.view(values, dtype),
            "componentType": CODES[dtype],
            "type": kind,
            "count": len(values),
        }
        return self.add("accessors", **{**own, **fields})

    def primitive(self, positions: Any = TETRAHEDRON, faces: Any = FACES, **fields: Any) -> dict[str, Any]:
        """Make a primitive, without indices if `faces` is None."""
        primitive: dict[str, Any] = {"attributes": {"POSITION": self.rows(positions, "VEC3")}}
        if faces is not None:
            primitive["indices"] = self.rows(np.ravel(faces), "SCALAR", "u2")
        primitive["attributes"].update(fields.pop("attributes", {}))
        return {**primitive, **fields}

    def mesh(self, *primitives: dict[str, Any], **fields: Any) -> int:
        """Add a mesh, by default of a tetrahedron."""
        return self.add("meshes", primitives=list(primitives or [self.primitive()]), **fields)

    def node(self, *, root: bool = True, **fields: Any) -> int:
        """Add a node, by default to the roots of the scene."""
        number = self.add("nodes", **fields)
        if root:
            self.tree["scenes"][0]["nodes"].append(number)
        return number

    def with_tetrahedron(self, **material: Any) -> File:
        """Add a node with a tetrahedron that has texture coordinates and a material. Return the file."""
        uvs = self.rows(TETRAHEDRON[:, :2], "VEC2")
        number = self.add("materials", **material)
        self.node(mesh=self.mesh(self.primitive(attributes={"TEXCOORD_0": uvs}, material=number)))
        return self

    def glb(self, *more: tuple[bytes, bytes]) -> bytes:
        """Return the bytes of a .glb file, with further chunks (type and data) between JSON and data."""
        tree = dict(self.tree)
        if self.data:
            tree.setdefault("buffers", [{"byteLength": len(self.data)}])
        chunks = b""
        for kind, data in ((b"JSON", json.dumps(tree).encode()), *more, (b"BIN\0", bytes(self.data))):
            data += (b" " if kind == b"JSON" else b"\0") * (-len(data) % 4)
            chunks += len(data).to_bytes(4, "little") + kind + data
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks

    def save(self, path: Path) -> Path:
        """Save as .glb, or as .gltf with a .bin file of the same name."""
        if path.suffix == ".glb":
            path.write_bytes(self.glb())
            return path
        data = path.with_suffix(".bin")
        data.write_bytes(bytes(self.data))
        self.tree.setdefault("buffers", [{"byteLength": len(self.data), "uri": data.name}])
        path.write_text(json.dumps(self.tree))
        return path


def png(pixels: Any = ((255, 0, 0),)) -> bytes:
    """Encode an image of one row."""
    import io

    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.array([pixels], np.uint8)).save(file, format="png")
    return file.getvalue()
