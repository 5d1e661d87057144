"""Putting a .glb file together: its JSON, and the numbers and images in its one buffer."""

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
    """A glTF file that grows. What is added gives back the number by which the file refers to it."""

    def __init__(self, generator: str) -> None:
        self._tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": generator}}
        self._data = bytearray()
        self._extensions: dict[str, Any] = {}

    def add(self, collection: str, thing: dict[str, Any]) -> int:
        """Add to a list of the file, such as "nodes"."""
        things = self._tree.setdefault(collection, [])
        things.append(thing)
        return len(things) - 1

    def extended(self, name: str, values: dict[str, Any]) -> dict[str, Any]:
        """An extension's values by its name, which the file then says it uses."""
        self._extensions.setdefault(name, None)
        return {name: values}

    def put(self, name: str, values: dict[str, Any]) -> None:
        """Give the file itself an extension."""
        self._extensions[name] = values

    def rows(self, values: Array, *, bounds: bool = False) -> int:
        """An accessor of float32 or uint32 (N, C), with the least and the greatest of each column on request."""
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
        """A texture of uint8 (H, W, 3 or 4), as a material refers to it."""
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(pixels)).save(file, format="png")
        image = self.add("images", {"bufferView": self._view(file.getvalue()), "mimeType": "image/png"})
        return {"index": self.add("textures", {"source": image, "sampler": sampler})}

    def glb(self, nodes: list[int]) -> bytes:
        """The file, its scene being these nodes."""
        tree = self._tree | {"scene": 0, "scenes": [{"nodes": nodes}]}
        if self._data:
            tree["buffers"] = [{"byteLength": len(self._data)}]
        if self._extensions:
            tree["extensionsUsed"] = sorted(self._extensions)
        own = {name: values for name, values in self._extensions.items() if values is not None}
        if own:
            tree["extensions"] = own
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
