"""The two forms of a glTF file, .gltf (JSON) and .glb (chunks), and the data and files that its URIs name."""

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
from wgsss.scene.files.gltf.fields import Item, plain
from wgsss.userfiles import require_file

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"


@contextmanager
def damaged(path: Path) -> Iterator[None]:
    """Errors about a file name it; an exception that nobody foresaw says that the file is damaged."""
    try:
        yield
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({plain(error.strerror or str(error))})") from None
    except MemoryError:
        raise InputError(f"{path}: it takes more memory than there is") from None
    except Exception as error:
        raise InputError(f"{path}: damaged: it cannot be read ({type(error).__name__}: {plain(str(error))})") from None


def read_container(path: Path) -> tuple[Item, bytes | None]:
    """The root of a file's JSON, and the binary chunk of a .glb file.

    Raises InputError for a file that is not there or empty, and for one that is neither form of glTF 2.
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
    """The first JSON and the first binary chunk; others are skipped, as the specification has it."""
    version, length = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
    if version != 2:
        raise InputError(f"it is of version {version}: of .glb files, only version 2 can be read")
    if not 20 <= length <= len(data):
        raise InputError(f"damaged: it has {len(data)} bytes, where its header says {length}")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > length:
            raise InputError(f"damaged: the chunk at byte {at} reaches beyond the end of the file")
        if kind in (_JSON, _BINARY):
            found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON not in found:
        raise InputError("damaged: it has no JSON chunk")
    return found[_JSON].rstrip(b"\0"), found.get(_BINARY)


def _root(text: bytes, kind: str) -> Item:
    try:
        tree = json.loads(text.decode("utf-8-sig", errors="replace"))
    except RecursionError:
        raise InputError("damaged: its JSON is nested too deep") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"damaged, or not a {kind} file (no valid JSON at {place})") from None
    except ValueError:  # a number of thousands of digits
        raise InputError("damaged: a number in its JSON has too many digits") from None
    if not isinstance(tree, dict):
        raise InputError(f"damaged, or not a {kind} file (its JSON is no object)")
    return Item(tree)


def _check_version(root: Item) -> None:
    asset = root.item("asset") or Item({}, "asset")
    if asset.get("version") is None:
        raise InputError("damaged, or not a glTF 2 file (asset.version is missing)")
    for key, known in (("version", r"2(\.\d+)?"), ("minVersion", r"2(\.0)?")):
        version = str(asset.get(key) or "2.0")
        if not re.fullmatch(known, version):
            raise InputError(f"its asset.{key} is {plain(version)}: only glTF 2.0 can be read")


def data_of(uri: str) -> bytes | None:
    """The data within a data URI, None for any other. Raises InputError for one that is damaged."""
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
    """The file that a relative URI names, percent-encoded or not. Raises InputError where there is no such file."""
    for name in dict.fromkeys((unquote(uri), uri, unquote(uri).replace("\\", "/"))):
        found = folder / name
        try:
            there, regular = found.exists(), found.is_file()
        except (OSError, ValueError):  # a name too long, or with a zero byte
            continue
        if regular:
            return found
        if there:
            raise InputError(f"'{plain(name)}' is not a regular file")
    raise InputError(f"there is no file '{plain(unquote(uri))}' beside it")
