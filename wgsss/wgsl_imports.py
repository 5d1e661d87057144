"""Resolve the imports of WGSL files.

Imports follow a small subset of WESL: `import package::fresnel::{schlick};` includes the whole file
`wgsl/fresnel.wgsl` once, before the text of the importing module, and checks that the file declares these names.
"""

from __future__ import annotations

import re
from pathlib import Path

_IMPORT = re.compile(r"^\s*import\s+package((?:::\w+)+?)(?:::\{([^}]*)\}|::(\w+));[^\S\n]*$", re.M)
_DECLARATION = re.compile(r"\b(?:fn|struct|alias|const|override|var)\s*(?:<[^>]*>)?\s*(\w+)")


class WgslError(Exception):
    """An error in a module or in the values for its bindings; the message names the file and, where known, the line."""


def strip_comments(text: str) -> str:
    """Return the text without comments, but with all newlines, so that line numbers stay the same."""
    text = re.sub(r"/\*.*?\*/", lambda m: re.sub(r"[^\n]", " ", m.group()), text, flags=re.S)
    return re.sub(r"//[^\n]*", "", text)


def resolve(
    name: str, root: Path, done: dict[str, str], chain: tuple[str, ...], asked_by: str
) -> list[tuple[str, str, int]]:
    """Return the lines of a module after those of the files that it imports: text, file and line number of each.

    Args:
        done: the texts of the files that are included already, by name; this adds to it.
        chain: names of the modules whose imports led here.
        asked_by: the file and line of the import, for errors.
    """
    if name in chain:
        raise WgslError(f"{asked_by}: circular import {' -> '.join((*chain, name))}")
    if name in done:
        return []
    path = root / f"{name}.wgsl"
    if not path.is_file():
        raise WgslError(f"{asked_by}: no module '{name}' ({name}.wgsl not found)")
    text = path.read_text()
    clean = strip_comments(text)
    out: list[tuple[str, str, int]] = []
    for match in _IMPORT.finditer(clean):
        parts = match.group(1).strip(":").split("::")
        line = clean.count("\n", 0, match.end()) + 1
        where = f"{name}.wgsl:{line}"
        names = match.group(2) if match.group(2) is not None else match.group(3)
        imported = [n.strip() for n in names.split(",") if n.strip()]
        target = "/".join(parts)
        out += resolve(target, root, done, (*chain, name), where)
        missing = [n for n in imported if n not in _DECLARATION.findall(done[target])]
        if missing:
            raise WgslError(f"{where}: {target}.wgsl does not declare {', '.join(missing)}")
    done[name] = clean
    lines = text.split("\n")
    for match in _IMPORT.finditer(clean):
        for i in range(clean.count("\n", 0, match.start()), clean.count("\n", 0, match.end()) + 1):
            lines[i] = "" if "import" in lines[i] or not lines[i].strip() else lines[i]
    return out + [(line, f"{name}.wgsl", i + 1) for i, line in enumerate(lines)]
