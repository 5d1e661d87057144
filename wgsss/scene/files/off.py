"""Reader of OFF files (Geomview's object file format), with normals, colours and texture coordinates of vertices.

Source: Geomview's manual, "OFF Files". Colours are read as sRGB, as MeshLab writes them.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.colors import linear_colors
from wgsss.scene.files.contents import Contents, Part
from wgsss.scene.files.corners import finite_normals, finite_uvs, flip_v
from wgsss.scene.files.text import Text, file_bytes
from wgsss.scene.files.triangulate import triangulate

Array = npt.NDArray[Any]

_KEYWORD = re.compile(rb"(?P<uvs>ST)?(?P<colors>C)?(?P<normals>N)?(?P<dimensions>4?n?)(?:OFF|off)")


def read_off(path: Path) -> Contents:
    """Read all faces of a file as one part.

    Raises InputError, naming the line, if the file is missing, damaged or binary, has other than three dimensions, or
    has no faces.
    """
    data = re.sub(rb"^(\S*OFF)(?=\d)", rb"\1 ", file_bytes(path))  # some files have no blank after the keyword
    if re.match(rb"\S*OFF\s+BINARY", data):
        raise InputError(f"{path}: binary OFF files are not supported")
    text = Text(path, data)
    if not len(text.starts):
        raise InputError(f"{path}: the file is empty")
    keyword = _KEYWORD.fullmatch(text.word(0))  # None if the file leaves it out
    if keyword is None and not text.word(0).isdigit():
        raise InputError(f"{path}: damaged, or not an .off file: its first word is neither 'OFF' nor a number")
    if keyword and keyword["dimensions"]:
        raise InputError(f"{path}: OFF files of more than three dimensions are not supported")
    row = int(keyword is not None and text.widths[0] == 1)
    if row == len(text.widths):
        raise InputError(f"{path}: damaged: the numbers of vertices and faces are missing")
    counts = text.table(np.array([row]), 2, 2, skip=int(keyword is not None and row == 0))[0][0]
    if not ((counts >= 0) & (counts == np.floor(counts)) & (counts < 2**40)).all():
        raise text.error(text.first[row], "the numbers of vertices and faces are not whole numbers")
    vertex_count, face_count = map(int, counts)
    lines = len(text.widths) - row - 1
    if lines < vertex_count + face_count:
        raise InputError(
            f"{path}: truncated: it has {lines} of {vertex_count + face_count} lines of vertices and faces"
        )
    vertex_rows = row + 1 + np.arange(vertex_count)
    face_rows = row + 1 + vertex_count + np.arange(face_count)

    notes: list[str] = []
    part = _vertices(text, vertex_rows, keyword, notes)
    if lines > vertex_count + face_count:
        notes.append(f"{lines - vertex_count - face_count} lines after the last face are left out")
    corners, sizes = _corners(text, face_rows, vertex_count, notes)
    triangles = triangulate(path, part.positions, corners, sizes, notes)[0]
    splits = bool(part.uvs) or part.normals is not None
    return Contents((replace(part, faces=corners[triangles]),), splits=splits, notes=tuple(notes))


def _vertices(text: Text, rows: Array, keyword: re.Match[bytes] | None, notes: list[str]) -> Part:
    """Read the vertices as a part without faces.

    A row is x y z, then a normal, a colour of three or four numbers, and s t, each only if the keyword announces it.
    """
    kinds = keyword.groupdict() if keyword else {}
    has_normals, has_colors, has_uvs = (bool(kinds.get(kind)) for kind in ("normals", "colors", "uvs"))
    at = 3 + 3 * has_normals
    least = at + 3 * has_colors + 2 * has_uvs
    values, widths = text.table(rows, least, least + has_colors, skip=0)
    longer = np.count_nonzero(widths > least + has_colors)
    if longer:
        notes.append(f"{longer} vertices have more than {least} numbers: the rest is left out")
    colors = uvs = None
    if has_colors:
        colors = values[:, at : at + 3]
        byte_values = (colors == np.floor(colors)).all() and (colors > 1).any()  # from 0 to 255
        colors = linear_colors(colors / 255.0 if byte_values else colors, True, notes)
    if has_uvs:
        with_alpha = has_colors & (widths >= least + 1)
        place = (at + 3 * has_colors + with_alpha)[:, None] + np.arange(2)
        uvs = flip_v(finite_uvs(np.take_along_axis(values, place, axis=1), notes))
    return Part(
        "the mesh",
        values[:, :3],
        np.empty((0, 3), np.int64),
        normals=finite_normals(values[:, 3:6], notes) if has_normals else None,
        uvs={} if uvs is None else {0: uvs},
        colors=colors,
    )


def _corners(text: Text, rows: Array, vertices: int, notes: list[str]) -> tuple[Array, Array]:
    """Read the vertex of each corner of all faces (C,), and the number of corners of each face (F,)."""
    first = text.first[rows]
    sizes = text.converted(text.words(first), int, first)
    bad = np.flatnonzero((sizes < 0) | (sizes > text.widths[rows] - 1))
    if len(bad):
        numbers = text.widths[rows][bad[0]] - 1
        raise text.error(first[bad[0]], f"a face of {sizes[bad[0]]} corners, but {numbers} numbers follow")
    words = np.repeat(first + 1 - (np.cumsum(sizes) - sizes), sizes) + np.arange(sizes.sum())
    corners = text.converted(text.words(words), int, words)
    bad = np.flatnonzero((corners < 0) | (corners >= vertices))
    if len(bad):
        raise text.error(words[bad[0]], f"vertex {corners[bad[0]]} does not exist (there are {vertices})")
    colored = np.count_nonzero(text.widths[rows] > sizes + 1)
    if colored:
        notes.append(f"colours of {colored} faces are left out")
    return corners, sizes
