"""Fingerprints of values and of the code behind them, by which the cache names its entries."""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wgsss import wgsl

_PACKAGE = Path(__file__).parent
_PLAIN = (type(None), bool, int, float, complex, str)


def fingerprint(value: object, *modules: str) -> str:
    """Return a digest that changes with `value` and with the code behind it.

    A dataclass counts with the code of the module that defines it and with all of its fields, except those whose
    metadata is `{"fingerprint": False}`. So do dataclasses inside of tuples, lists, mappings and other dataclasses.

    Args:
        value: None, a number, a string, bytes, an array, a dataclass, or a tuple, list or mapping of such values.
        modules: names of more modules whose code counts. `closure` says what belongs to the code of a module.

    Raises TypeError for values of other types, and for a dataclass whose module has no source file.
    """
    digest, code = hashlib.sha256(), set(modules)

    def parts() -> Iterator[bytes]:
        yield from _encoded(value, code)
        for name, source in sorted(closure(code).items()):
            yield from (name.encode(), source)

    for part in parts():  # each with its length, so that different sequences of parts are different bytes
        digest.update(b"%d:" % len(part))
        digest.update(part)
    return digest.hexdigest()


def _encoded(value: object, code: set[str]) -> Iterator[bytes]:
    """Yield the type and the content of a value, and add the modules that define its dataclasses to `code`."""
    kind = type(value)
    yield f"{kind.__module__}.{kind.__qualname__}".encode()
    if kind in _PLAIN:
        yield repr(value).encode()
    elif isinstance(value, bytes):
        yield value
    elif kind is np.ndarray or isinstance(value, np.generic):
        array = np.asarray(value)
        if array.dtype.hasobject:
            raise TypeError("an array of Python objects has no fingerprint")
        yield repr((np.lib.format.dtype_to_descr(array.dtype), array.shape)).encode()
        yield array.tobytes()
    elif is_dataclass(value) and not isinstance(value, type):
        code.add(kind.__module__)
        counted = [field.name for field in fields(value) if field.metadata.get("fingerprint", True)]
        yield repr(counted).encode()
        for name in counted:
            yield from _encoded(getattr(value, name), code)
    elif isinstance(value, tuple | list) and kind in (tuple, list):
        yield str(len(value)).encode()
        for item in value:
            yield from _encoded(item, code)
    elif isinstance(value, Mapping):
        items = {b"".join(_encoded(key, code)): item for key, item in value.items()}
        yield str(len(items)).encode()
        for key in sorted(items):
            yield key
            yield from _encoded(items[key], code)
    else:
        raise TypeError(f"a value of type {kind.__module__}.{kind.__qualname__} has no fingerprint")


def closure(modules: Iterable[str]) -> dict[str, bytes]:
    """Return the source of modules and of everything that they import from this package, by name.

    Imports inside of functions count. Where the `__init__.py` of a package only passes a name on, the import leads to
    the module that defines the name. A string that is the name of a WGSL module adds that module with its imports.
    Other packages do not count: where the version of one matters, the key must contain it.
    """
    reached, sources, shaders = [*modules], dict[str, bytes](), set[str]()
    while reached:
        module = reached.pop()
        if module not in sources:
            sources[module] = _package()[module] if module in _package() else _outside(module)
            imports, strings = _references(sources[module])
            reached += [_home(imported) for imported in imports if imported.module in _package()]
            shaders |= strings & _shaders()
    for module in [*sources]:  # the packages around a module run before it
        while module := module.rpartition(".")[0]:
            if module in _package():
                sources[module] = _package()[module]
    return sources | {f"wgsl/{name}.wgsl": wgsl.load(name, wgsl.ROOT).source.encode() for name in shaders}


class _Import(NamedTuple):
    """`from module import name as bound`, or `import module`, where the other two are empty."""

    module: str
    name: str = ""
    bound: str = ""


@cache
def _references(source: bytes) -> tuple[frozenset[_Import], frozenset[str]]:
    """Return what a module imports, and the strings that it contains."""
    imports, strings = set(), set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module:
            imports |= {_Import(node.module, alias.name, alias.asname or alias.name) for alias in node.names}
        elif isinstance(node, ast.Import):
            imports |= {_Import(alias.name) for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            strings.add(node.value)
    return frozenset(imports), frozenset(strings)


def _home(imported: _Import) -> str:
    """Return the module that defines what is imported from this package."""
    module, name, _ = imported
    if not name:
        return module
    if f"{module}.{name}" in _package():
        return f"{module}.{name}"
    for passed_on in _references(_package()[module])[0]:
        if passed_on.bound == name and passed_on.module in _package() and _has_modules(module):
            return _home(passed_on)
    return module


def _has_modules(module: str) -> bool:
    return any(other.startswith(f"{module}.") for other in _package())


@cache
def _package() -> dict[str, bytes]:
    """Return the modules of this package, read all at once: later edits do not run in this process."""
    paths = {path.relative_to(_PACKAGE.parent).with_suffix(""): path for path in _PACKAGE.rglob("*.py")}
    return {".".join(name.parts).removesuffix(".__init__"): path.read_bytes() for name, path in paths.items()}


@cache
def _shaders() -> frozenset[str]:
    """Return the names of all WGSL modules."""
    return frozenset(path.relative_to(wgsl.ROOT).with_suffix("").as_posix() for path in wgsl.ROOT.rglob("*.wgsl"))


def _outside(module: str) -> bytes:
    """Return the source of a module of another package."""
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None:
        raise TypeError(f"the module {module} has no source file, so nothing that depends on it can be cached")
    return Path(file).read_bytes()
