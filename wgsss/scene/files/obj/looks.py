"""The materials of OBJ files: the .mtl files that a file names, and the material of each face."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.contents import Look
from wgsss.scene.files.locate import locate
from wgsss.scene.files.obj.mtl import read_materials
from wgsss.scene.files.text import Text, printable, without_comment

Array = npt.NDArray[Any]


def read_looks(text: Text, libraries: Array, uses: Array, faces: Array, notes: list[str]) -> tuple[list[Look], Array]:
    """Read the looks of a file, and the index of the look of each face (F,), given the rows of mtllib, usemtl and f.

    A material that no .mtl file describes gets a default look. A note names each .mtl file that does not exist; if all
    exist, a note names the materials that are not described.
    """
    looks: dict[str, Look] = {}
    missing: list[str] = []
    for row in libraries:
        for file in _files(text.rest(row), text.path.parent, missing):
            try:
                more_looks, more_notes = read_materials(file)
            except InputError as error:
                notes.append(f"materials left out: {error}")
                continue
            looks = {**more_looks, **looks}  # of two with the same name, the first is used
            notes += more_notes
    by_short_name = {without_comment(name): look for name, look in looks.items()}

    names = [text.rest(row) for row in uses]
    of_name: dict[str, Look] = {}
    unknown = []
    for name in dict.fromkeys(names):
        look = looks.get(name) or by_short_name.get(without_comment(name))
        if look is None:
            unknown.append(printable(name))
        of_name[name] = look or Look(without_comment(name))
    notes += [f"the material file '{printable(name)}' does not exist" for name in missing]
    if unknown and not missing:
        listed = ", ".join(unknown[:3]) + (f" and {len(unknown) - 3} more" if len(unknown) > 3 else "")
        notes.append(f"no .mtl file describes material{'s' * (len(unknown) > 1)} {listed}")
    number: dict[Look, int] = {}
    of_use = np.array([number.setdefault(look, len(number)) for look in (Look(), *map(of_name.__getitem__, names))])
    return list(number), of_use[np.searchsorted(uses, faces)]


def _files(names: str, folder: Path, missing: list[str]) -> list[Path]:
    """Return the files that a mtllib statement names: one file whose name may contain blanks, or several files."""
    for name in (names, without_comment(names)):
        file = locate(name.strip('"'), folder)
        if file:
            return [file]
    names = without_comment(names)
    several = re.split(r"(?<=\.mtl)\s+", names, flags=re.IGNORECASE) if ".mtl" in names.lower() else names.split()
    files = []
    for name in several:
        file = locate(name.strip('"'), folder)
        if file:
            files.append(file)
        else:
            missing.append(name)
    return files
