"""Reader of the two forms of glTF files, .gltf (JSON) and .glb (chunks), and of the data and files that URIs name."""

from __future__ import annotations

import base64
import binascii
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

from wgsss.errors import InputError
from wgsss.scene.files.gltf.fields import Item, printable
from wgsss.userfiles import require_file

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"


@contextmanager
def damaged(path: Path) -> Iterator[None]:
    """Add the path to errors, and convert unforeseen exceptions to an error that says that the file is damaged."""
    try:
        yield
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({printable(error.strerror or str(error))})") from None
    except MemoryError:
        raise InputError(f"{path}: there is not enough memory to read it") from None
    except Exception as error:
        raise InputError(
            f"{path}: damaged: it cannot be read ({type(error).__name__}: {printable(str(error))})"
        ) from None


def read_container(path: Path) -> tuple[Item, bytes | None]:
    """Read the root of the JSON of a file, and the binary chunk of a .glb file (None for .gltf).

    Raises InputError if the file is missing, empty, or neither form of glTF 2.
    """
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: not a regular file")
    require_file(path)
    data = path.read_bytes()
    text, binary = _chunks(data) if data[:4] == _MAGIC else (data, None)
    root = _root(text, path.suffix.lower())
    _check_version(root)
    return root, binary


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the first JSON chunk and the first binary chunk. Others are skipped, as the specification requires."""
    version, length = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
    if version != 2:
        raise InputError(f"its version is {version}: only version 2 of .glb files can be read")
    if not 20 <= length <= len(data):
        raise InputError(f"damaged: it has {len(data)} bytes, but its header says {length}")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > length:
            raise InputError(f"damaged: the chunk at byte {at} reaches beyond the end of the file")
        if kind in (_JSON, _BINARY):
            chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON not in chunks:
        raise InputError("damaged: it has no JSON chunk")
    return chunks[_JSON].rstrip(b"\0"), chunks.get(_BINARY)


def _root(text: bytes, kind: str) -> Item:
    """Parse the JSON of a file. `kind` is the file extension, for messages."""
    try:
        tree = json.loads(text.decode("utf-8-sig", errors="replace"))
    except RecursionError:
        raise InputError("damaged: its JSON is nested too deep") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"damaged, or not a {kind} file (no valid JSON at {place})") from None
    except ValueError:  # a number with thousands of digits
        raise InputError("damaged: a number in its JSON has too many digits") from None
    if not isinstance(tree, dict):
        raise InputError(f"damaged, or not a {kind} file (its JSON is not an object)")
    return Item(tree)


def _check_version(root: Item) -> None:
    asset = root.item("asset") or Item({}, "asset")
    if asset.get("version") is None:
        raise InputError("damaged, or not a glTF 2 file (asset.version is missing)")
    for key, known in (("version", r"2(\.\d+)?"), ("minVersion", r"2(\.0)?")):
        version = str(asset.get(key) or "2.0")
        if not re.fullmatch(known, version):
            raise InputError(f"its asset.{key} is {printable(version)}: only glTF 2.0 can be read")


def data_of(uri: str) -> bytes | None:
    """Decode a data URI. Return None for any other URI. Raises InputError if it is damaged."""
    if not uri.startswith("data:"):
        return None
    head, comma, body = uri.partition(",")
    if not comma:
        raise InputError("its data URI has no comma")
    if not head.endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        text = re.sub(r"\s", "", unquote(body) if "%" in body else body)
        return base64.b64decode(text + "=" * (-len(text) % 4), validate=True)
    except (binascii.Error, ValueError):
        raise InputError("its data URI is not valid base64") from None


def file_of(folder: Path, uri: str) -> Path:
    """Find the file that a relative URI names, percent-encoded or not. Raises InputError if there is no such file."""
    for name in dict.fromkeys((unquote(uri), uri, unquote(uri).replace("\\", "/"))):
        file = folder / name
        try:
            exists, regular = file.exists(), file.is_file()
        except (OSError, ValueError):  # the name is too long or contains a NUL
            continue
        if regular:
            return file
        if exists:
            raise InputError(f"'{printable(name)}' is not a regular file")
    raise InputError(f"there is no file '{printable(unquote(uri))}' beside it")
