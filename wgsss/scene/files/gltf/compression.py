"""Decoders of compressed glTF data: KHR_draco_mesh_compression, EXT_meshopt_compression and KHR_meshopt_compression.

The packages DracoPy and meshopt decode them. Neither has to be installed: some files also hold the uncompressed data,
which are then read instead.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.gltf.fields import Item, printable

Array = npt.NDArray[Any]

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("KHR_meshopt_compression", "EXT_meshopt_compression")
PACKAGES = {DRACO: "DracoPy", **dict.fromkeys(MESHOPT, "meshopt")}
"""the package that decodes each extension"""

# A block of 256 rows takes at least a quarter of a byte for each byte of a row: valid data grow by no more than this.
_MESHOPT_GROWTH = 1024


def missing(extension: str) -> str:
    """Return an error text if the package that decodes an extension is not installed, else ""."""
    package = PACKAGES.get(extension)
    if package is None or importlib.util.find_spec(package) is not None:
        return ""
    return f"to read {extension}, the package {package} is needed (pip install {package})"


def _loaded(package: str, packed: Item) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise packed.error(f"the package {package} cannot be loaded ({printable(str(error))})") from None


def decode_view(view: Item, packed: Item, data: memoryview) -> memoryview:
    """Decode a buffer view from the `data` that its meshopt extension `packed` refers to.

    Raises InputError if the data are damaged, or are not as long as the view says.
    """
    mode = packed.text("mode", choices=("ATTRIBUTES", "TRIANGLES", "INDICES"))
    kind = packed.text("filter", "NONE", choices=("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"))
    count, stride, length = packed.whole("count"), packed.whole("byteStride", low=1), view.whole("byteLength")
    if count * stride != length:
        raise packed.error(f"its {count} rows of {stride} bytes do not make the {length} bytes of {view.location}")
    if length > _MESHOPT_GROWTH * (len(data) + 1):
        raise packed.error(f"{len(data)} bytes cannot hold its {count} rows")
    package = _loaded("meshopt", packed)
    try:
        rows: Array = package.decode_gltf_buffer(bytes(data), count, stride, mode, kind)
    except (ValueError, TypeError, RuntimeError):
        raise packed.error("damaged: it cannot be decoded") from None
    return memoryview(np.ascontiguousarray(rows).tobytes())


def decode_primitive(packed: Item, data: memoryview) -> tuple[dict[str, Array], Array]:
    """Decode a primitive from the `data` that its Draco extension `packed` refers to.

    Returns the attributes by name, (V, C) as stored, and the faces, int64 (F, 3). Raises InputError if the data are
    damaged, or if an attribute is not in them.
    """
    names = packed.item("attributes") or Item({}, packed.location)
    package = _loaded("DracoPy", packed)
    try:
        mesh = package.decode(bytes(data))
        stored = {attribute["unique_id"]: np.asarray(attribute["data"]) for attribute in mesh.attributes}
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    except Exception:  # exceptions of DracoPy, and an AttributeError for a point cloud
        raise packed.error(f"damaged: buffer view {packed.get('bufferView')} cannot be decoded") from None
    decoded = {}
    for name in names.values:
        number = names.whole(name)
        if number not in stored:
            raise packed.error(f"{name}: there is no attribute {number} in the compressed data")
        decoded[name] = stored[number].reshape(len(stored[number]), -1)
    if len({len(values) for values in decoded.values()}) > 1:
        raise packed.error("its attributes have different lengths")
    return decoded, faces
