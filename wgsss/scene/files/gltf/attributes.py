"""Reader of the vertex attributes and triangles of a glTF primitive, stored uncompressed or compressed."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf.compression import DRACO, decode_primitive, missing
from wgsss.scene.files.gltf.document import SHAPES, Document, as_floats
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.notes import Notes

Array = npt.NDArray[Any]

TRIANGLES, STRIP, FAN = 4, 5, 6


class Attributes:
    """The vertex attributes and indices of a primitive. Methods raise InputError, naming the primitive."""

    def __init__(self, document: Document, primitive: Item) -> None:
        self._document, self.location = document, primitive.location
        self._primitive = primitive
        self._accessors = Item((primitive.item("attributes") or Item({})).values, primitive.location)
        self._decoded: dict[str, Array] = {}
        self._faces: Array | None = None
        packed = primitive.extension(DRACO)
        if packed is not None:
            self._decode(packed)

    def _decode(self, packed: Item) -> None:
        """Decode what Draco compresses. Without the decoder, leave it to the accessors if these have data, too."""
        if error := missing(DRACO):
            position = self._document.at("accessor", self._accessors.get("POSITION"), self.location)
            if not position.has("bufferView"):
                raise self._primitive.error(error)
            return
        data, _ = self._document.view(packed.get("bufferView"), packed.location)
        self._decoded, self._faces = decode_primitive(packed, data)

    @property
    def names(self) -> list[str]:
        """The names of the attributes, such as POSITION."""
        return [name for name in self._accessors.values if self._accessors.has(name)]

    def numbered(self, name: str) -> list[int]:
        """Return the numbers of the sets of an attribute in order: 0 and 1 for TEXCOORD_0 and TEXCOORD_1."""
        matches = [re.fullmatch(rf"{name}_(\d{{1,9}})", attribute) for attribute in self.names]
        return sorted(int(match[1]) for match in matches if match)

    def read(self, name: str, kind: str | tuple[str, ...], count: int | None = None, finite: bool = True) -> Array:
        """Read an attribute (V, C). Arguments and result are those of `Document.numbers`."""
        index, label = self._accessors.get(name), f"{self.location}: {name}"
        if name not in self._decoded:
            return self._document.numbers(index, kind, label, count, finite)
        values, accessor = self._decoded[name], self._document.at("accessor", index, label)
        kinds = (kind,) if isinstance(kind, str) else kind
        widths = [SHAPES[k][1] for k in kinds]
        if values.shape[1] not in widths or (count is not None and len(values) != count):
            raise InputError(f"{label}: its compressed numbers have the wrong shape {values.shape}")
        return as_floats(values, accessor.flag("normalized", False), label, finite)

    def faces(self, vertices: int, notes: Notes) -> Array:
        """Read the triangles of the primitive: int64 (F, 3).

        `vertices` is the number of its vertices. Triangles of strips and fans with two equal corners are left out.
        """
        if self._faces is not None:
            return self._checked(self._faces, vertices)
        mode = self._primitive.whole("mode", TRIANGLES)
        if self._primitive.has("indices"):
            label = f"{self.location}: indices"
            indices = self._document.numbers(self._primitive.get("indices"), "SCALAR", label)[:, 0]
            if indices.dtype != np.int64:
                raise InputError(f"{label} must be whole numbers")
        else:
            indices = np.arange(vertices)
        if mode == TRIANGLES:
            if len(indices) % 3:
                notes.add("indices that make no triangle left out:", "index", len(indices) % 3)
            return self._checked(indices[: len(indices) // 3 * 3].reshape(-1, 3), vertices)
        turn = np.arange(max(len(indices) - 2, 0))
        if mode == STRIP:  # every second triangle has the opposite winding
            faces = np.stack([indices[turn], indices[turn + 1 + turn % 2], indices[turn + 2 - turn % 2]], axis=1)
        else:
            faces = np.stack([indices[turn + 1], indices[turn + 2], np.full(len(turn), indices[:1].sum())], axis=1)
        a, b, c = faces.T
        return self._checked(faces[(a != b) & (b != c) & (c != a)], vertices)

    def _checked(self, faces: Array, vertices: int) -> Array:
        if faces.size and not 0 <= faces.min() <= faces.max() < vertices:
            bad = faces.max() if faces.max() >= vertices else faces.min()
            raise InputError(f"{self.location}: a face has vertex {bad}, which does not exist (there are {vertices})")
        return faces
