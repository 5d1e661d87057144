"""Calls dataclasses and functions with the values of TOML tables. Their signatures define the allowed keys."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from wgsss.errors import InputError, unknown
from wgsss.text import shown
from wgsss.userfiles import path_from, read_text, require_file

Table = dict[str, Any]
Parameters = Mapping[str, inspect.Parameter]


_KINDS: dict[str, tuple[Any, str]] = {  # what TOML may give for a parameter, by its annotation
    "str": (str, "text"),
    "float": (float | int, "a number"),
    "int": (float | int, "a whole number"),
    "bool": (bool, "true or false"),
    "Triple": (list | tuple, "three numbers"),
}


def read_toml(path: Path) -> Table:
    """Read the top-level table of a file. Raises InputError, naming the file, if it is missing or not TOML."""
    text = read_text(path, "a TOML file")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:  # it names the line
        raise InputError(f"{path}: not a TOML file: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: not a TOML file: it is nested too deep") from None
    except ValueError:
        raise InputError(f"{path}: not a TOML file: it holds a number, date or time that cannot be") from None


def call(function: Callable[..., Any], table: Table, where: str, parameters: Parameters | None = None) -> Any:
    """Call a function or class with the keys of a table as its arguments. Every error names the table."""
    parameters = parameters or inspect.signature(function).parameters
    check_keys(table, parameters, where)
    for key, parameter in parameters.items():
        if key in table:
            _check_kind(parameter, table[key], where)
        elif parameter.default is inspect.Parameter.empty:
            raise InputError(f"{where}: key '{key}' is missing")
    try:
        return function(**table)
    except InputError as error:
        raise at(where, error) from None


def _check_kind(parameter: inspect.Parameter, value: Any, where: str) -> None:
    kind, _, other = str(parameter.annotation).partition(" | ")
    if kind not in _KINDS or other not in ("", "None"):
        return
    kinds, what = _KINDS[kind]
    if value is None and other:
        return
    if not isinstance(value, kinds) or (isinstance(value, bool) and kinds is not bool):
        raise InputError(f"{where}: {parameter.name} must be {what}, not {shown(value)}")


def call_kind(table: Any, kinds: Mapping[str, Any], where: str) -> Any:
    """Call the function or class that the `kind` of a table names with its other keys."""
    check_keys(table, None, where)
    if "kind" not in table:
        raise InputError(f"{where}: key 'kind' is missing (one of {', '.join(kinds)})")
    return call(choose(kinds, table["kind"], "kind", where), {k: v for k, v in table.items() if k != "kind"}, where)


def choose(choices: Mapping[str, Any], name: Any, what: str, where: str) -> Any:
    """Return one of the choices by its name."""
    if not isinstance(name, str):
        raise InputError(f"{where}: {what} must be text, not {shown(name)}")
    if name not in choices:
        raise at(where, unknown(what, name, choices))
    return choices[name]


def check_keys(table: Any, known: Iterable[str] | None, where: str) -> None:
    """Raise InputError unless the value is a table with known keys only. None allows any key."""
    if not isinstance(table, dict):
        raise InputError(f"{where} must be a table, not {shown(table)}")
    for key in table:
        if known is not None and key not in known:
            raise at(where, unknown("key", key, known))


def file_in(table: Table, key: str, where: str, folder: Path) -> Path:
    """Return the path of the file that a key names, relative to a folder. Raises InputError if it does not exist."""
    if not isinstance(table[key], str):
        raise InputError(f"{where}: {key} must be the path of a file, not {shown(table[key])}")
    try:
        path = path_from(table[key], folder)
        require_file(path)
    except InputError as error:
        raise at(f"{where}: {key}", error) from None
    return path


def each(table: Table, key: str, where: str) -> list[tuple[Table, str]]:
    """Return the tables of an array of tables, each with its place for errors."""
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(t, dict) for t in value):
        raise InputError(f"{where}: {key} must be a list of tables: [[{key}]]")
    return [(t, f"{where}: [[{key}]] {number}") for number, t in enumerate(value, start=1)]


def at(where: str, error: InputError) -> InputError:
    """Return the error with its place in front, unless it names the place already."""
    return error if str(error).startswith(where) else InputError(f"{where}: {error}")
