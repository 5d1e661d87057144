"""The code keeps the floors that ARCHITECTURE.md describes, and its glossary names what the code has."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from conftest import ROOT

TEXT = (ROOT / "ARCHITECTURE.md").read_text()
PACKAGE = ROOT / "wgsss"


@cache
def floors() -> dict[str, int]:
    """Return the floor of each module or package directly in wgsss, from the table in ARCHITECTURE.md."""
    rows = re.findall(r"^\| (\d+) \| ((?:`\w+` ?)+)\|", TEXT, re.M)
    return {name: int(floor) for floor, names in rows for name in re.findall(r"`(\w+)`", names)}


@cache
def modules() -> dict[str, Path]:
    """Return the file of each module of the package by its dotted name; a package is its __init__ module."""
    found = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = file.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def imports(module: str) -> frozenset[str]:
    """Return the modules of the package that a module imports, anywhere in its text."""
    return frozenset(_imports(module)) - {module}


def _imports(module: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(modules()[module].read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules())
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: imports are absolute"
            names = {f"{node.module}.{alias.name}" for alias in node.names} - {"wgsss.__version__"}
            yield from names & set(modules())
            if node.module in modules() and names - set(modules()):
                yield node.module


def place_of(module: str) -> str:
    """Return the name by which the table of floors lists a module."""
    return module.split(".")[1] if "." in module else "__init__"


def circles() -> list[list[str]]:
    """Return the sets of modules that import each other, directly or by way of others (Tarjan's algorithm)."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(module: str) -> None:
        order[module] = lowest[module] = len(order)
        stack.append(module)
        for other in imports(module):
            if other not in order:
                visit(other)
                lowest[module] = min(lowest[module], lowest[other])
            elif other in stack:
                lowest[module] = min(lowest[module], order[other])
        if lowest[module] == order[module]:
            first = stack.index(module)
            members = stack[first:]
            del stack[first:]
            if len(members) > 1:
                found.append(sorted(members))

    for module in modules():
        if module not in order:
            visit(module)
    return found


def test_the_table_lists_every_module_and_package_once() -> None:
    names = re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| \d+ \| ((?:`\w+` ?)+)\|", TEXT, re.M)))
    assert len(names) == len(set(names))
    assert set(names) == {place_of(module) for module in modules()}


def test_no_module_imports_one_of_a_higher_floor() -> None:
    upward = [
        f"{module} (floor {floors()[place_of(module)]}) imports {other} (floor {floors()[place_of(other)]})"
        for module in modules()
        for other in imports(module)
        if floors()[place_of(other)] > floors()[place_of(module)]
    ]
    assert not upward, "\n".join(sorted(upward))


def test_no_imports_form_a_circle() -> None:
    assert not circles()


def test_the_code_has_every_name_of_the_glossary() -> None:
    glossary = TEXT.split("\n## Glossary\n")[1]
    names = re.findall(r"\| `(\w+)` \|$", glossary, re.M)
    assert len(names) > 30
    text = "\n".join(file.read_text() for folder in ("wgsss", "wgsl") for file in (ROOT / folder).rglob("*.*[yl]"))
    missing = [name for name in names if not re.search(rf"\b{name}\b", text)]
    assert not missing


def test_each_term_of_the_glossary_has_one_row() -> None:
    terms = re.findall(r"^\| ([^|]+) \|", TEXT.split("\n## Glossary\n")[1], re.M)
    terms = [term for term in terms if term not in ("term", "---")]
    assert len(terms) == len(set(terms)) > 30
