"""A glTF file as its JSON and the numbers behind it: buffers, buffer views and accessors (glTF 2.0, section 3.6)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.gltf import compression
from wgsss.scene.files.gltf.container import data_of, file_of, read_container
from wgsss.scene.files.gltf.fields import Item, as_whole, plain, shown

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
"""columns and rows"""
MAX_ZEROS = 1 << 22
"""rows of an accessor without a buffer view, which no data bounds"""

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
    """A file's JSON and its data, which are read when asked for. Methods raise InputError without the file's name."""

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self.root, self._binary = read_container(path)
        self._lists: dict[str, list[Item]] = {}
        self._buffers: dict[int, memoryview] = {}
        self._views: dict[int, tuple[memoryview, int | None]] = {}

    def all(self, kind: str) -> list[Item]:
        """All that the file has of a kind: "node", "buffer view" and so on."""
        if kind not in self._lists:
            self._lists[kind] = self.root.items(_NAMES[kind], kind)
        return self._lists[kind]

    def at(self, kind: str, index: Any, what: str) -> Item:
        """The one of a number. `what` refers to it goes into errors."""
        number, found = as_whole(index), self.all(kind)
        if number is None or not 0 <= number < len(found):
            raise InputError(f"{what}: there is no {kind} {shown(index)}")
        return found[number]

    def link(self, item: Item, key: str, kind: str) -> int | None:
        """The number that an object gives of something of a kind; None where it gives none."""
        if not item.has(key):
            return None
        self.at(kind, item.get(key), item.where or key)
        return as_whole(item.get(key))

    def buffer(self, index: Any, what: str) -> memoryview:
        """The bytes of a buffer."""
        item = self.at("buffer", index, what)
        number = int(index)
        if number not in self._buffers:
            self._buffers[number] = memoryview(self._load(item, number))
        return self._buffers[number]

    def view(self, index: Any, what: str) -> tuple[memoryview, int | None]:
        """The bytes of a buffer view, and its stride where it has one. What an extension compresses is decoded."""
        item = self.at("buffer view", index, what)
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
        buffer = self.at("buffer", view.get("buffer"), view.where)
        marks = (buffer.extension(name) for name in compression.MESHOPT)
        if any(mark is not None and mark.flag("fallback", False) for mark in marks):
            return False
        return buffer.has("uri") or view.get("buffer") == 0

    def span(self, item: Item) -> memoryview:
        """The bytes of a buffer that an object names by buffer, byteOffset and byteLength."""
        data = self.buffer(item.get("buffer"), item.where)
        start, length = item.whole("byteOffset", 0), item.whole("byteLength")
        if start + length > len(data):
            raise item.error(f"it reaches beyond the end of buffer {item.get('buffer')}, which has {len(data)} bytes")
        return data[start : start + length]

    def numbers(
        self, index: Any, kind: str | tuple[str, ...], what: str, count: int | None = None, finite: bool = True
    ) -> Array:
        """The rows of an accessor of a kind (a key of SHAPES), (N, columns x rows), normalised ones as -1 to 1:
        float64, or int64 where they are whole numbers. `what` it is goes into errors.

        Raises InputError where it is not there, is of another kind, has not `count` rows, reaches beyond its buffer or
        holds a number that is not `finite`.
        """
        accessor = self.at("accessor", index, what)
        what = f"{what}: {accessor.where}"
        kinds = (kind,) if isinstance(kind, str) else kind
        if (found := accessor.get("type")) not in kinds:
            raise InputError(f"{what} must be {' or '.join(kinds)}, not {shown(found)}")
        code = accessor.whole("componentType")
        if code not in DTYPES:
            raise accessor.error(f"there is no componentType {code}")
        rows = accessor.whole("count")
        if count is not None and rows != count:
            raise InputError(f"{what} has {rows} rows where {count} belong")
        values = self._rows(accessor, np.dtype(DTYPES[code]), rows, SHAPES[found], what)
        return as_floats(values, accessor.flag("normalized", False), what, finite)

    def _rows(self, accessor: Item, dtype: Any, rows: int, shape: tuple[int, int], what: str) -> Array:
        """Its rows (N, columns x rows) as they are stored."""
        sparse = accessor.item("sparse")
        if accessor.has("bufferView"):
            found = self._stored(accessor, dtype, rows, shape, what)
        elif rows > MAX_ZEROS:
            raise InputError(f"{what} has {rows} rows and no buffer view; at most {MAX_ZEROS} can be read")
        else:
            found = np.zeros((rows, shape[0] * shape[1]), dtype)
        if sparse is None:
            return found
        some = sparse.whole("count")
        indices, values = (sparse.item(key) or Item({}, f"{sparse.where}: {key}") for key in ("indices", "values"))
        code = indices.whole("componentType")
        if code not in (5121, 5123, 5125):
            raise indices.error(f"there is no componentType {code} of indices")
        where = self._stored(indices, np.dtype(DTYPES[code]), some, (1, 1), what)[:, 0]
        if some and where.max() >= rows:
            raise InputError(f"{what} sets row {where.max()} of {rows}")
        found = found.copy()
        found[where] = self._stored(values, dtype, some, shape, what)
        return found

    def _stored(self, item: Item, dtype: Any, rows: int, shape: tuple[int, int], what: str) -> Array:
        """Rows of a buffer view; the columns of a matrix begin at multiples of four bytes."""
        columns, width = shape
        size = dtype.itemsize
        column = width * size if columns == 1 else -(-width * size // 4) * 4
        data, stride = self.view(item.get("bufferView"), item.where)
        stride, start = stride or columns * column, item.whole("byteOffset", 0)
        if stride < columns * column:
            raise InputError(f"{what}: byteStride of buffer view {item.get('bufferView')} is less than a row")
        if rows and start + (rows - 1) * stride + columns * column > len(data):
            view = item.get("bufferView")
            raise InputError(f"{what} reaches beyond the end of buffer view {view}: its {rows} rows do not fit")
        if not rows:
            return np.zeros((0, columns * width), dtype)
        found = np.ndarray((rows, columns, width), dtype, data, start, (stride, column, size))
        return found.reshape(rows, columns * width)

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
            raise item.error(f"it cannot be read ({plain(error.strerror or str(error))})") from None


def as_floats(values: Array, normalized: bool, what: str, finite: bool = True) -> Array:
    """Stored numbers as float64, normalised whole ones as -1 to 1; as int64 where they are whole and not normalised."""
    if values.dtype.kind == "f":
        if finite and not np.isfinite(values).all():
            raise InputError(f"{what} holds a number that is not finite")
        with np.errstate(invalid="ignore"):  # of a signalling NaN
            return values.astype(np.float64)
    if normalized:
        return np.maximum(values / np.iinfo(values.dtype).max, -1.0)
    return values.astype(np.int64)
