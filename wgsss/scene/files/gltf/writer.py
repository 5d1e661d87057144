"""Writer of .glb files: the JSON, and one buffer with numbers and images."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

_CODES = {"float32": 5126, "uint32": 5125}
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}


class Writer:
    """A glTF file under construction. Methods that add an object return its index in the file."""

    def __init__(self, generator: str) -> None:
        self._tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": generator}}
        self._data = bytearray()
        self._extensions: dict[str, Any] = {}

    def add(self, collection: str, item: dict[str, Any]) -> int:
        """Add an object to a collection of the file, such as "nodes"."""
        items = self._tree.setdefault(collection, [])
        items.append(item)
        return len(items) - 1

    def extended(self, name: str, values: dict[str, Any]) -> dict[str, Any]:
        """Return the field of an extension for an object, and add the extension to those that the file uses."""
        self._extensions.setdefault(name, None)
        return {name: values}

    def put(self, name: str, values: dict[str, Any]) -> None:
        """Set an extension of the root object of the file."""
        self._extensions[name] = values

    def rows(self, values: Array, *, bounds: bool = False) -> int:
        """Add an accessor of float32 or uint32 values (N, C), with `bounds` also the bounds of each column."""
        array = np.ascontiguousarray(values)
        accessor = {
            "bufferView": self._view(array.astype(array.dtype.newbyteorder("<")).tobytes()),
            "componentType": _CODES[array.dtype.name],
            "count": len(array),
            "type": _KINDS[array.shape[1]],
        }
        if bounds:
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def texture(self, pixels: Array, sampler: int) -> dict[str, Any]:
        """Add a texture of pixels uint8 (H, W, 3 or 4). Return the object by which a material refers to it."""
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(pixels)).save(file, format="png")
        image = self.add("images", {"bufferView": self._view(file.getvalue()), "mimeType": "image/png"})
        return {"index": self.add("textures", {"source": image, "sampler": sampler})}

    def glb(self, nodes: list[int]) -> bytes:
        """Return the bytes of the file, with a scene of these root nodes."""
        tree = self._tree | {"scene": 0, "scenes": [{"nodes": nodes}]}
        if self._data:
            tree["buffers"] = [{"byteLength": len(self._data)}]
        if self._extensions:
            tree["extensionsUsed"] = sorted(self._extensions)
        root_extensions = {name: values for name, values in self._extensions.items() if values is not None}
        if root_extensions:
            tree["extensions"] = root_extensions
        text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
        chunks = _chunk(b"JSON", text, b" ") + (_chunk(b"BIN\0", bytes(self._data), b"\0") if self._data else b"")
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks

    def _view(self, data: bytes) -> int:
        self._data += bytes(-len(self._data) % 4)
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        self._data += data
        return self.add("bufferViews", view)


def _chunk(kind: bytes, data: bytes, padding: bytes) -> bytes:
    data += padding * (-len(data) % 4)
    return len(data).to_bytes(4, "little") + kind + data
