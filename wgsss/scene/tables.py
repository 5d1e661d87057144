"""From TOML tables to calls of dataclasses and functions, whose signatures say which keys there are."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from wgsss.errors import InputError, unknown
from wgsss.userfiles import require_file

Table = dict[str, Any]
Parameters = Mapping[str, inspect.Parameter]


_KINDS: dict[str, tuple[Any, str]] = {  # what TOML may give for a parameter, by its annotation
    "str": (str, "text"),
    "str | None": (str | None, "text"),
    "float": (float | int, "a number"),
    "Triple": (list | tuple, "three numbers"),
}


def read_toml(path: Path) -> Table:
    """The top-level table of a file. Raises InputError, naming the file, where it is missing or not TOML."""
    require_file(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a TOML file: it is not UTF-8 text") from None
    except (ValueError, RecursionError) as error:  # of its grammar, too long a number, too deep a nesting
        raise InputError(f"{path}: not a TOML file: {error}") from None


def call(function: Callable[..., Any], table: Table, where: str, parameters: Parameters | None = None) -> Any:
    """Call a function or class with a table's keys as its arguments, every error naming the table."""
    parameters = parameters or inspect.signature(function).parameters
    check_keys(table, parameters, where)
    for key, parameter in parameters.items():
        if key not in table and parameter.default is inspect.Parameter.empty:
            raise InputError(f"{where}: key '{key}' is missing")
        if parameter.annotation in ("str", "str | None"):
            _check_kind(parameter, table, where)
    try:
        return function(**table)
    except InputError as error:
        raise at(where, error) from None
    except (TypeError, ValueError) as error:
        for parameter in parameters.values():
            _check_kind(parameter, table, where)
        raise InputError(f"{where}: a value of the wrong type: {error}") from None


def _check_kind(parameter: inspect.Parameter, table: Table, where: str) -> None:
    kinds, what = _KINDS.get(str(parameter.annotation), (object, ""))
    if parameter.name in table and not isinstance(table[parameter.name], kinds):
        raise InputError(f"{where}: {parameter.name} must be {what}, not {table[parameter.name]!r}")


def call_kind(table: Any, kinds: Mapping[str, Any], where: str) -> Any:
    """Call what a table's `kind` names with its other keys."""
    check_keys(table, None, where)
    if "kind" not in table:
        raise InputError(f"{where}: key 'kind' is missing (one of {', '.join(kinds)})")
    return call(choose(kinds, table["kind"], "kind", where), {k: v for k, v in table.items() if k != "kind"}, where)


def choose(choices: Mapping[str, Any], name: Any, what: str, where: str) -> Any:
    """One of the choices by its name."""
    if not isinstance(name, str) or name not in choices:
        raise at(where, unknown(what, str(name), choices))
    return choices[name]


def check_keys(table: Any, known: Iterable[str] | None, where: str) -> None:
    """Raise InputError unless this is a table without any key but those known; None stands for any."""
    if not isinstance(table, dict):
        raise InputError(f"{where}: must be a table, not {table!r}")
    for key in table:
        if known is not None and key not in known:
            raise at(where, unknown("key", key, known))


def file_in(table: Table, key: str, where: str, folder: Path) -> Path:
    """The file that a key names, relative to a folder. Raises InputError unless it is there."""
    if not isinstance(table[key], str):
        raise InputError(f"{where}: {key} must be the path of a file, not {table[key]!r}")
    path = folder / Path(table[key]).expanduser()
    try:
        require_file(path)
    except InputError as error:
        raise at(f"{where}: {key}", error) from None
    return path


def each(table: Table, key: str, where: str) -> list[tuple[Table, str]]:
    """The tables of an array of tables, and where each one is."""
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(t, dict) for t in value):
        raise InputError(f"{where}: {key} must be a list of tables: [[{key}]]")
    return [(t, f"{where}: [[{key}]] {number}") for number, t in enumerate(value, start=1)]


def at(where: str, error: InputError) -> InputError:
    """The error with the place it belongs to, if it does not name it yet."""
    return error if str(error).startswith(where) else InputError(f"{where}: {error}")
