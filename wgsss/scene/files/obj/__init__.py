"""Reader of Wavefront OBJ files: polygons with texture coordinates, normals, vertex colours and materials.

Source: "Object Files (.obj)", appendix B1 of the manual of Wavefront's Advanced Visualizer 4.0. Colours after a vertex
("v x y z r g b") and ZBrush's comments "#MRGB" are common extensions. Both are read as sRGB, as Blender, MeshLab and
ZBrush write them.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError
from wgsss.scene.files.colors import linear, linear_colors
from wgsss.scene.files.contents import Contents, Look, Part
from wgsss.scene.files.corners import finite_normals, finite_uvs, flip_v, take_rows, vertices_of
from wgsss.scene.files.obj.faces import Faces, read_faces
from wgsss.scene.files.obj.looks import read_looks
from wgsss.scene.files.text import Text, file_bytes, printable, without_comment
from wgsss.scene.files.triangulate import triangulate

Array = npt.NDArray[Any]

_READ = (b"v", b"vt", b"vn", b"f", b"fo", b"usemtl", b"mtllib", b"s")
# Statements that do not change how polygons are drawn, and those that complete a free-form curve or surface. The
# statement that begins a curve or surface is one of _LEFT_OUT.
_IGNORED = set(
    b"g o mg vp bevel c_interp d_interp lod shadow_obj trace_obj "
    b"cstype deg bmat step parm trim hole scrv sp end con ctech stech".split()
)
_LEFT_OUT = {
    b"p": "points",
    b"l": "lines",
    **dict.fromkeys(b"curv curv2 surf bsp bzp cdc cdp res".split(), "free-form curves or surfaces"),
    b"call": "calls of other files",
    b"csh": "calls of other programs",
    **dict.fromkeys(b"maplib usemap".split(), "texture statements of old OBJ files"),
}


def read_obj(path: Path) -> Contents:
    """Read all polygons of a file, one part for each material.

    Raises InputError, naming the line, if the file is missing or damaged, or has no faces.
    """
    text = Text(path, file_bytes(path), continued=True)
    rows = {word: np.flatnonzero(text.row_starts_with(word)) for word in _READ}
    notes = _left_out(text, rows)
    face_rows = np.sort(np.concatenate([rows[b"f"], rows[b"fo"]]))
    vertices, widths = text.table(rows[b"v"], 3, 7)
    if not len(face_rows):
        raise InputError(
            f"{path}: the mesh is empty: it has no faces, {'; '.join([f'{len(vertices)} vertices', *notes])}"
        )
    faces = read_faces(text, face_rows, rows[b"v"], rows[b"vt"], rows[b"vn"])
    values = _Values(
        vertices[:, :3],
        flip_v(finite_uvs(text.table(rows[b"vt"], 1, 2)[0], notes)),
        finite_normals(text.table(rows[b"vn"], 3, 3)[0], notes),
        _colors(text, vertices, widths, notes),
    )

    triangles, face = triangulate(path, values.positions, faces.vertex, faces.counts, notes)
    unused = len(vertices) - np.count_nonzero(np.bincount(faces.vertex, minlength=len(vertices)))
    if unused:
        notes.append(f"{unused} unused vertices are left out")
    _note_smoothing(text, rows[b"s"], face_rows, faces, notes)
    looks, look_of_face = read_looks(text, rows[b"mtllib"], rows[b"usemtl"], face_rows, notes)
    faces = _whole_uvs(faces, look_of_face, notes)
    parts = []
    for i in np.flatnonzero(np.bincount(look_of_face[face])):
        corners = triangles[look_of_face[face] == i].ravel()
        parts.append(_part(looks[i], faces, corners, values))
    splits = len(parts) > 1 or any(part.uvs or part.normals is not None for part in parts)
    return Contents(tuple(parts), splits=splits, notes=tuple(notes))


@dataclass(frozen=True)
class _Values:
    """The values that the corners of faces refer to."""

    positions: Array
    """float64 (V, 3)"""
    uvs: Array
    """float64 (T, 2), v down"""
    normals: Array
    """float64 (N, 3)"""
    colors: Array | None
    """float64 (V, 3), linear"""


def _part(look: Look, faces: Faces, corners: Array, values: _Values) -> Part:
    """Make a part of T triangles, given their corners (3 T,), with one vertex for each distinct v, vt and vn."""
    vertex, uv, normal = (column[corners] for column in (faces.vertex, faces.uv, faces.normal))
    has_uvs, has_normals = bool((uv >= 0).any()), bool((normal >= 0).any())
    first, corner = vertices_of([vertex, *[uv] * has_uvs, *[normal] * has_normals])
    vertex, uv, normal = vertex[first], uv[first], normal[first]
    return Part(
        f"material {printable(look.name)}" if look.name else "the mesh",
        values.positions[vertex],
        corner.reshape(-1, 3),
        look,
        normals=take_rows(values.normals, normal) if has_normals else None,
        uvs={0: take_rows(values.uvs, uv)} if has_uvs else {},
        colors=None if values.colors is None else values.colors[vertex],
    )


def _whole_uvs(faces: Faces, look_of_face: Array, notes: list[str]) -> Faces:
    """Remove the texture coordinates of faces that have them at some corners only.

    A note counts the faces without texture coordinates, of those materials that have faces with texture coordinates.
    """
    of_face = np.repeat(np.arange(len(faces.counts)), faces.counts)
    without = np.bincount(of_face[faces.uv < 0], minlength=len(faces.counts)) > 0
    textured = np.bincount(look_of_face, ~without)[look_of_face] > 0
    partly = int((without & textured).sum())
    if partly:
        notes.append(f"{partly} of {int(textured.sum())} faces have no texture coordinates and get 0 0")
    return replace(faces, uv=np.where(without[of_face], -1, faces.uv))


def _colors(text: Text, vertices: Array, widths: Array, notes: list[str]) -> Array | None:
    """Read linear colours (V, 3) of the vertices. Return None if they have none."""
    if (widths == 4).any() and (vertices[widths == 4, 3] != 1).any():
        notes.append("weights of vertices (v x y z w) are ignored")
    colored = widths >= 6
    if colored.any():
        colors = np.where(colored[:, None], vertices[:, 3:6], 1.0)
        if not colored.all():
            notes.append(f"{int((~colored).sum())} of {len(vertices)} vertices have no colour and become white")
        return linear_colors(colors, True, notes)
    if b"#MRGB" not in text.raw:
        return None
    painted = b"".join(re.findall(rb"^#MRGB ([0-9a-fA-F]+)", text.raw, re.MULTILINE))  # mask, red, green, blue
    if len(painted) != 8 * len(vertices):
        notes.append(f"vertex colours (#MRGB) are left out: there are {len(painted) // 8} for {len(vertices)} vertices")
        return None
    return linear(np.frombuffer(bytes.fromhex(painted.decode()), np.uint8).reshape(-1, 4)[:, 1:] / 255.0)


def _note_smoothing(text: Text, statements: Array, rows: Array, faces: Faces, notes: list[str]) -> None:
    """Add a note that smoothing groups are not used, if they define hard edges and faces have no normals."""
    if not len(statements) or (faces.normal >= 0).all():
        return
    names = [without_comment(text.rest(row)) for row in statements]
    groups = np.array(["", *["off" if name == "0" else name for name in names]])[np.searchsorted(statements, rows)]
    if len(set(groups)) > 1 or groups[0] == "off":
        notes.append("smoothing groups (s) are left out: edges are smooth where the file has no normals")


def _left_out(text: Text, read: dict[bytes, Array]) -> list[str]:
    """Return notes that count the statements that are not read."""
    other = np.ones(len(text.widths), bool)
    for rows in read.values():
        other[rows] = False
    counts = Counter(text.word(text.first[row]) for row in np.flatnonzero(other))
    notes = []
    for kind in dict.fromkeys(_LEFT_OUT.values()):
        count = sum(counts[keyword] for keyword in counts if _LEFT_OUT.get(keyword) == kind)
        if count:
            notes.append(f"{count} {kind} are left out")
    unknown = [keyword for keyword in counts if keyword not in _IGNORED and keyword not in _LEFT_OUT]
    if unknown:
        named = ", ".join(f"'{printable(keyword)}'" for keyword in unknown[:3]) + ", …" * (len(unknown) > 3)
        notes.append(
            f"{sum(counts[keyword] for keyword in unknown)} lines are not understood and are left out ({named})"
        )
    return notes
