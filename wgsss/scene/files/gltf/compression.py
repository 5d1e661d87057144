"""Compressed meshes and buffer views: KHR_draco_mesh_compression, EXT_ and KHR_meshopt_compression.

They are decoded by DracoPy and meshopt, which need not be installed: without them the uncompressed data are read that
some files have beside the compressed ones.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.gltf.fields import Item, plain

if TYPE_CHECKING:
    from wgsss.scene.files.gltf.document import Document

Array = npt.NDArray[Any]

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("KHR_meshopt_compression", "EXT_meshopt_compression")
PACKAGES = {DRACO: "DracoPy", **dict.fromkeys(MESHOPT, "meshopt")}
"""what decodes an extension"""

# A block of 256 rows takes a fourth of a byte or more of each of their bytes, so no valid data grow by more than this.
_MESHOPT_GROWTH = 1024


def missing(extension: str) -> str:
    """What to say where the package is not installed that decodes an extension; "" where it is."""
    package = PACKAGES.get(extension)
    if package is None or importlib.util.find_spec(package) is not None:
        return ""
    return f"to read {extension}, the package {package} is needed (pip install {package})"


def _loaded(package: str, packed: Item) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise packed.error(f"the package {package} cannot be loaded ({plain(str(error))})") from None


def decoded_view(document: Document, view: Item) -> memoryview | None:
    """The bytes of a buffer view that meshopt compresses; None where its own are to be read."""
    for name in MESHOPT:
        packed = view.extension(name)
        if packed is None:
            continue
        if missing(name):
            if _has_data(document, view):
                return None
            raise view.error(missing(name))
        return _unpack(document, view, packed)
    return None


def _has_data(document: Document, view: Item) -> bool:
    """Whether the buffer of a view holds the view's uncompressed data, and does not merely stand for them."""
    buffer = document.at("buffer", view.get("buffer"), view.where)
    if any((mark := buffer.extension(name)) is not None and mark.flag("fallback", False) for name in MESHOPT):
        return False
    return buffer.has("uri") or view.get("buffer") == 0


def _unpack(document: Document, view: Item, packed: Item) -> memoryview:
    mode = packed.text("mode", choices=("ATTRIBUTES", "TRIANGLES", "INDICES"))
    kind = packed.text("filter", "NONE", choices=("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"))
    count, stride, length = packed.whole("count"), packed.whole("byteStride", low=1), view.whole("byteLength")
    data = document.span(packed)
    if count * stride != length:
        raise packed.error(f"its {count} rows of {stride} bytes are not the {length} bytes of {view.where}")
    if length > _MESHOPT_GROWTH * (len(data) + 1):
        raise packed.error(f"{len(data)} bytes cannot hold its {count} rows")
    package = _loaded("meshopt", packed)
    try:
        found: Array = package.decode_gltf_buffer(bytes(data), count, stride, mode, kind)
    except (ValueError, TypeError, RuntimeError):
        raise packed.error("damaged: it cannot be decoded") from None
    return memoryview(np.ascontiguousarray(found).tobytes())


def decoded_primitive(document: Document, primitive: Item) -> tuple[dict[str, Array], Array] | None:
    """The attributes (V, C) as stored, and faces (F, 3), of a primitive that Draco compresses; None where its
    accessors are to be read."""
    packed = primitive.extension(DRACO)
    if packed is None:
        return None
    if missing(DRACO):
        attributes = primitive.item("attributes") or Item({})
        position = document.at("accessor", attributes.get("POSITION"), primitive.where)
        if position.has("bufferView"):
            return None
        raise primitive.error(missing(DRACO))
    data, _ = document.view(packed.get("bufferView"), packed.where)
    names = packed.item("attributes") or Item({}, packed.where)
    package = _loaded("DracoPy", packed)
    try:
        mesh = package.decode(bytes(data))
        stored = {attribute["unique_id"]: np.asarray(attribute["data"]) for attribute in mesh.attributes}
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    except Exception:  # its own exceptions, and an AttributeError for a cloud of points
        raise packed.error(f"damaged: buffer view {packed.get('bufferView')} cannot be decoded") from None
    found = {}
    for name in names.values:
        number = names.whole(name)
        if number not in stored:
            raise packed.error(f"{name}: there is no attribute {number} in the compressed data")
        found[name] = stored[number].reshape(len(stored[number]), -1)
    if len({len(values) for values in found.values()}) > 1:
        raise packed.error("its attributes are not of the same length")
    return found, faces
