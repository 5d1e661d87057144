"""The JSON of a glTF file, and its numbers in buffers, buffer views and accessors (glTF 2.0, section 3.6)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf import compression
from wgsss.scene.files.gltf.container import data_of, file_of, read_container
from wgsss.scene.files.gltf.fields import Item, as_whole, json_text, printable

Array = npt.NDArray[Any]

DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SHAPES = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
"""columns and rows of each type of an accessor"""
MAX_ZEROS = 1 << 22
"""limit of the rows of an accessor without buffer view, since no data limit them"""

_NAMES = {
    "accessor": "accessors",
    "animation": "animations",
    "buffer": "buffers",
    "buffer view": "bufferViews",
    "camera": "cameras",
    "image": "images",
    "material": "materials",
    "mesh": "meshes",
    "node": "nodes",
    "sampler": "samplers",
    "scene": "scenes",
    "skin": "skins",
    "texture": "textures",
}


class Document:
    """The JSON of a file, and its data, which are read on demand.

    Methods raise InputError without the name of the file. The argument `label` of a method names the owner of the data
    in errors.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self.root, self._binary = read_container(path)
        self._lists: dict[str, list[Item]] = {}
        self._buffers: dict[int, memoryview] = {}
        self._views: dict[int, tuple[memoryview, int | None]] = {}

    def all(self, kind: str) -> list[Item]:
        """Return all objects of a kind, such as "node" or "buffer view"."""
        if kind not in self._lists:
            self._lists[kind] = self.root.items(_NAMES[kind], kind)
        return self._lists[kind]

    def at(self, kind: str, index: Any, label: str) -> Item:
        """Return the object of a kind at an index. Raises InputError if there is none."""
        number, items = as_whole(index), self.all(kind)
        if number is None or not 0 <= number < len(items):
            raise InputError(f"{label}: there is no {kind} {json_text(index)}")
        return items[number]

    def link(self, item: Item, key: str, kind: str) -> int | None:
        """Read and check the index of an object of a kind in a field. Return None if the field is missing."""
        if not item.has(key):
            return None
        self.at(kind, item.get(key), item.location or key)
        return as_whole(item.get(key))

    def buffer(self, index: Any, label: str) -> memoryview:
        """Return the bytes of a buffer."""
        item = self.at("buffer", index, label)
        number = int(index)
        if number not in self._buffers:
            self._buffers[number] = memoryview(self._load(item, number))
        return self._buffers[number]

    def view(self, index: Any, label: str) -> tuple[memoryview, int | None]:
        """Return the bytes of a buffer view, decompressed if necessary, and its stride or None."""
        item = self.at("buffer view", index, label)
        number = int(index)
        if number not in self._views:
            stride = item.whole("byteStride") if item.has("byteStride") else None
            self._views[number] = (self._view_bytes(item), stride)
        return self._views[number]

    def _view_bytes(self, view: Item) -> memoryview:
        """Return the bytes of a buffer view, decoded if meshopt compresses them and is installed."""
        for name in compression.MESHOPT:
            packed = view.extension(name)
            if packed is None:
                continue
            error = compression.missing(name)
            if not error:
                return compression.decode_view(view, packed, self.span(packed))
            if not self._has_uncompressed(view):
                raise view.error(error)
            break
        return self.span(view)

    def _has_uncompressed(self, view: Item) -> bool:
        """Return whether the buffer of a compressed view also holds the uncompressed data."""
        buffer = self.at("buffer", view.get("buffer"), view.location)
        marks = (buffer.extension(name) for name in compression.MESHOPT)
        if any(mark is not None and mark.flag("fallback", False) for mark in marks):
            return False
        return buffer.has("uri") or view.get("buffer") == 0

    def span(self, item: Item) -> memoryview:
        """Return the bytes that an object refers to by the fields buffer, byteOffset and byteLength."""
        data = self.buffer(item.get("buffer"), item.location)
        start, length = item.whole("byteOffset", 0), item.whole("byteLength")
        if start + length > len(data):
            raise item.error(f"it reaches beyond the end of buffer {item.get('buffer')}, which has {len(data)} bytes")
        return data[start : start + length]

    def numbers(
        self, index: Any, kind: str | tuple[str, ...], label: str, count: int | None = None, finite: bool = True
    ) -> Array:
        """Read the N rows of an accessor whose type is `kind`, or one of several (keys of SHAPES).

        Returns (N, columns x rows): int64 for integers that are not normalised, else float64; normalised integers are
        converted to -1 to 1. Raises InputError if the accessor does not exist, has another type, does not have `count`
        rows, reaches beyond its buffer, or holds a number that is not finite although `finite` is set.
        """
        accessor = self.at("accessor", index, label)
        label = f"{label}: {accessor.location}"
        kinds = (kind,) if isinstance(kind, str) else kind
        if (type_ := accessor.get("type")) not in kinds:
            raise InputError(f"{label} must be {' or '.join(kinds)}, not {json_text(type_)}")
        code = accessor.whole("componentType")
        if code not in DTYPES:
            raise accessor.error(f"there is no componentType {code}")
        rows = accessor.whole("count")
        if count is not None and rows != count:
            raise InputError(f"{label} has {rows} rows instead of {count}")
        values = self._rows(accessor, np.dtype(DTYPES[code]), rows, SHAPES[type_], label)
        return as_floats(values, accessor.flag("normalized", False), label, finite)

    def _rows(self, accessor: Item, dtype: Any, rows: int, shape: tuple[int, int], label: str) -> Array:
        """Read the rows of an accessor, dense or sparse, as stored: (N, columns x rows)."""
        sparse = accessor.item("sparse")
        if accessor.has("bufferView"):
            values = self._stored(accessor, dtype, rows, shape, label)
        elif rows > MAX_ZEROS:
            raise InputError(f"{label} has {rows} rows and no buffer view; at most {MAX_ZEROS} can be read")
        else:
            values = np.zeros((rows, shape[0] * shape[1]), dtype)
        if sparse is None:
            return values
        count = sparse.whole("count")
        places, updates = (sparse.item(key) or Item({}, f"{sparse.location}: {key}") for key in ("indices", "values"))
        code = places.whole("componentType")
        if code not in (5121, 5123, 5125):
            raise places.error(f"there is no componentType {code} for indices")
        indices = self._stored(places, np.dtype(DTYPES[code]), count, (1, 1), label)[:, 0]
        if count and indices.max() >= rows:
            raise InputError(f"{label} sets row {indices.max()}, but has {rows} rows")
        values = values.copy()
        values[indices] = self._stored(updates, dtype, count, shape, label)
        return values

    def _stored(self, item: Item, dtype: Any, rows: int, shape: tuple[int, int], label: str) -> Array:
        """Read rows from a buffer view. The columns of a matrix start at multiples of four bytes."""
        columns, width = shape
        size = dtype.itemsize
        column = width * size if columns == 1 else -(-width * size // 4) * 4
        data, stride = self.view(item.get("bufferView"), item.location)
        stride, start = stride or columns * column, item.whole("byteOffset", 0)
        if stride < columns * column:
            raise InputError(f"{label}: byteStride of buffer view {item.get('bufferView')} is less than a row")
        if rows and start + (rows - 1) * stride + columns * column > len(data):
            view = item.get("bufferView")
            raise InputError(f"{label} reaches beyond the end of buffer view {view}: its {rows} rows do not fit")
        if not rows:
            return np.zeros((0, columns * width), dtype)
        matrices = np.ndarray((rows, columns, width), dtype, data, start, (stride, column, size))
        return matrices.reshape(rows, columns * width)

    def _load(self, item: Item, number: int) -> bytes:
        if not item.has("uri"):
            if number or self._binary is None:
                raise item.error("it has no data")
            return self._binary
        uri = item.text("uri")
        try:
            data = data_of(uri)
            return file_of(self.folder, uri).read_bytes() if data is None else data
        except InputError as error:
            raise item.error(str(error)) from None
        except OSError as error:
            raise item.error(f"it cannot be read ({printable(error.strerror or str(error))})") from None


def as_floats(values: Array, normalized: bool, label: str, finite: bool = True) -> Array:
    """Convert stored numbers: floats and normalised integers (-1 to 1) to float64, other integers to int64.

    Raises InputError, beginning with `label`, if a number is not finite although `finite` is set.
    """
    if values.dtype.kind == "f":
        if finite and not np.isfinite(values).all():
            raise InputError(f"{label} holds a number that is not finite")
        with np.errstate(invalid="ignore"):  # signalling NaNs
            return values.astype(np.float64)
    if normalized:
        return np.maximum(values / np.iinfo(values.dtype).max, -1.0)
    return values.astype(np.int64)
