"""glTF files put together for tests: a tree of plain JSON, and the numbers that its accessors name."""

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
    """A glTF file being put together. Methods give back the number by which the file refers to what was added."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.data = bytearray()

    def add(self, collection: str, **fields: Any) -> int:
        things = self.tree.setdefault(collection, [])
        things.append(fields)
        return len(things) - 1

    def view(self, values: Any, dtype: str = "u1", **fields: Any) -> int:
        """A buffer view of numbers, or of bytes."""
        data = values if isinstance(values, bytes) else np.ascontiguousarray(values, "<" + dtype).tobytes()
        self.data += bytes(-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.data += data
        return self.add("bufferViews", **{**place, **fields})

    def rows(self, values: Any, kind: str, dtype: str = "f4", **fields: Any) -> int:
        """An accessor with a buffer view of its own."""
        own = {
            "bufferView": self.view(values, dtype),
            "componentType": CODES[dtype],
            "type": kind,
            "count": len(values),
        }
        return self.add("accessors", **{**own, **fields})

    def primitive(self, positions: Any = TETRAHEDRON, faces: Any = FACES, **fields: Any) -> dict[str, Any]:
        """A primitive; without indices where `faces` is None."""
        found: dict[str, Any] = {"attributes": {"POSITION": self.rows(positions, "VEC3")}}
        if faces is not None:
            found["indices"] = self.rows(np.ravel(faces), "SCALAR", "u2")
        found["attributes"].update(fields.pop("attributes", {}))
        return {**found, **fields}

    def mesh(self, *primitives: dict[str, Any], **fields: Any) -> int:
        """A mesh, of a tetrahedron where nothing is given."""
        return self.add("meshes", primitives=list(primitives or [self.primitive()]), **fields)

    def node(self, *, root: bool = True, **fields: Any) -> int:
        number = self.add("nodes", **fields)
        if root:
            self.tree["scenes"][0]["nodes"].append(number)
        return number

    def shown(self, **material: Any) -> File:
        """Itself, with a node that shows a tetrahedron, with texture coordinates and a material."""
        uvs = self.rows(TETRAHEDRON[:, :2], "VEC2")
        number = self.add("materials", **material)
        self.node(mesh=self.mesh(self.primitive(attributes={"TEXCOORD_0": uvs}, material=number)))
        return self

    def glb(self, *more: tuple[bytes, bytes]) -> bytes:
        """The file as chunks, some more of them (type and data) between its JSON and its data."""
        tree = dict(self.tree)
        if self.data:
            tree.setdefault("buffers", [{"byteLength": len(self.data)}])
        chunks = b""
        for kind, data in ((b"JSON", json.dumps(tree).encode()), *more, (b"BIN\0", bytes(self.data))):
            data += (b" " if kind == b"JSON" else b"\0") * (-len(data) % 4)
            chunks += len(data).to_bytes(4, "little") + kind + data
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks

    def save(self, path: Path) -> Path:
        """As a .glb file, or as a .gltf file whose data lie in a file of the same name."""
        if path.suffix == ".glb":
            path.write_bytes(self.glb())
            return path
        data = path.with_suffix(".bin")
        data.write_bytes(bytes(self.data))
        self.tree.setdefault("buffers", [{"byteLength": len(self.data), "uri": data.name}])
        path.write_text(json.dumps(self.tree))
        return path


def png(pixels: Any = ((255, 0, 0),)) -> bytes:
    """An image of one row."""
    import io

    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.array([pixels], np.uint8)).save(file, format="png")
    return file.getvalue()
