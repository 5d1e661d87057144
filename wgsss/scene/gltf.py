"""What a glTF file holds beside its triangles: the numbers behind its accessors, read through pygltflib."""

from __future__ import annotations

import base64
import json
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError

Array = npt.NDArray[Any]

DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def may_move(path: Path) -> bool:
    """Whether a mesh file may hold a skin, morph targets or an animation: whether its bytes name one."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        return False
    data = path.read_bytes()
    return any(key in data for key in (b'"skins"', b'"targets"', b'"animations"'))


@contextmanager
def damaged(path: Path) -> Iterator[None]:
    """Makes an InputError that names the file of what a reader trips over."""
    try:
        yield
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None
    except Exception as error:  # what is missing, out of range or of a wrong type in a file raises all kinds
        reason = " ".join(str(error).split())[:100]
        raise InputError(f"{path}: damaged: its skins or animations cannot be read ({reason})") from None


@dataclass(frozen=True, eq=False)
class Document:
    """A file's JSON as pygltflib's dataclasses, and its buffers."""

    tree: Any
    buffers: tuple[bytes, ...]

    def numbers(self, index: int, kind: str, what: str, count: int | None = None) -> Array:
        """The rows of an accessor of a kind (a key of WIDTHS), (N, WIDTHS[kind]), normalised ones as -1 to 1: float64,
        or int64 where they are whole numbers. `what` it is goes into errors.

        Raises InputError where it is not there, is of another kind, has not `count` rows, reaches beyond its buffer or
        holds a number that is not finite.
        """
        if not isinstance(index, int) or not 0 <= index < len(self.tree.accessors):
            raise InputError(f"{what}: there is no accessor {index}")
        accessor = self.tree.accessors[index]
        if accessor.type != kind or accessor.componentType not in DTYPES:
            raise InputError(f"{what}: accessor {index} must be {kind}, not {accessor.type}")
        if count is not None and accessor.count != count:
            raise InputError(f"{what}: accessor {index} has {accessor.count} rows where {count} belong")
        dtype: Any
        dtype, width = DTYPES[accessor.componentType], WIDTHS[kind]
        if accessor.bufferView is None:
            found = np.zeros((accessor.count, width), dtype)
        else:
            found = self._rows(accessor.bufferView, accessor.byteOffset, dtype, accessor.count, width, what)
        if accessor.sparse is not None:
            found, sparse = found.copy(), accessor.sparse
            at = DTYPES[sparse.indices.componentType]
            where = self._rows(sparse.indices.bufferView, sparse.indices.byteOffset, at, sparse.count, 1, what)
            if where.size and where.max() >= len(found):
                raise InputError(f"{what}: accessor {index} sets row {where.max()} of {len(found)}")
            values = self._rows(sparse.values.bufferView, sparse.values.byteOffset, dtype, sparse.count, width, what)
            found[where[:, 0]] = values
        if dtype is np.float32:
            if not np.isfinite(found).all():
                raise InputError(f"{what}: accessor {index} holds a number that is not finite")
            return found.astype(np.float64)
        if accessor.normalized:
            return np.maximum(found / np.iinfo(dtype).max, -1.0)
        return found.astype(np.int64)

    def _rows(self, view: int, offset: int | None, dtype: Any, count: int, width: int, what: str) -> Array:
        part = self.tree.bufferViews[view]
        size = np.dtype(dtype).itemsize
        row = width * size
        stride, start = part.byteStride or row, offset or 0
        data = memoryview(self.buffers[part.buffer])[part.byteOffset or 0 :][: part.byteLength]
        if count < 0 or start + (count - 1) * stride + row > len(data):
            raise InputError(f"{what}: its numbers reach beyond the end of buffer view {view}")
        return np.ndarray((count, width), dtype, data, start, (stride, size))


def read_document(path: Path) -> Document:
    """The document of a .glb or .gltf file. Reading raises whatever it trips over: see `damaged`."""
    from pygltflib import GLTF2

    data = path.read_bytes()
    binary = data[:4] == b"glTF"
    text = data[20 : 20 + int.from_bytes(data[12:16], "little")] if binary else data
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tree = GLTF2.load_from_bytes(data) if binary else GLTF2.gltf_from_json(text.decode())
    for node, given in zip(tree.nodes, json.loads(text).get("nodes", ()), strict=True):
        node.weights = given.get("weights")  # of morph targets, which pygltflib leaves out
    buffers = []
    for buffer in tree.buffers:
        if buffer.uri is None:
            buffers.append(tree.binary_blob() or b"")
        elif buffer.uri.startswith("data:"):  # of any media type, while pygltflib knows but one
            buffers.append(base64.b64decode(buffer.uri.partition(",")[2]))
        else:
            buffers.append((path.parent / buffer.uri).read_bytes())
    return Document(tree, tuple(buffers))
