"""Reader of PLY files: polygons and triangle strips with texture coordinates, normals and vertex colours.

The format does not define the names of elements and properties. This reader knows the names that MeshLab, Blender, VTK,
Stanford's tools and others write. Integer colours are read as sRGB, and floating-point colours as linear.
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
from wgsss.scene.files.contents import Contents, Look, Part, Texture
from wgsss.scene.files.corners import finite_normals, finite_uvs, flip_v, vertices_of
from wgsss.scene.files.locate import locate
from wgsss.scene.files.ply.data import Table, read_tables
from wgsss.scene.files.ply.faces import Faces, read_faces
from wgsss.scene.files.ply.header import Element, Header, read_header
from wgsss.scene.files.text import file_bytes, printable
from wgsss.scene.files.triangulate import triangulate

Array = npt.NDArray[Any]

_UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("s0", "t0"), ("u0", "v0"))
_COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_FULL = {"u1": 255.0, "i1": 127.0, "u2": 65535.0, "i2": 32767.0}  # full intensity by type; for other integers it is 255


def read_ply(path: Path) -> Contents:
    """Read all polygons and strips of a file, one part for each texture.

    Raises InputError, naming the line or the element, if the file is missing or damaged, or has no faces.
    """
    data = file_bytes(path)
    header = read_header(path, data)
    notes: list[str] = []
    tables = read_tables(path, data, header, notes)
    element = next((e for e in header.elements if e.name in ("vertex", "vertices")), Element("vertex", 0))
    vertices = tables.get(element.name, {})
    # Columns that are used are removed from the tables. Those that remain in the end are reported as left out.
    positions = _pop_columns(vertices, ("x", "y", "z"))
    if positions is None:
        raise InputError(f"{path}: damaged: there is no element vertex with the properties x, y and z")
    faces = read_faces(path, tables, len(positions), notes)
    if not len(faces.counts):
        raise InputError(f"{path}: the mesh is empty: it has no faces, {len(positions)} points")
    normals, colors = _pop_columns(vertices, ("nx", "ny", "nz")), _colors(element, vertices, notes)
    uvs = next((uv for names in _UVS if (uv := _pop_columns(vertices, names)) is not None), None)
    triangles, face = triangulate(path, positions, faces.vertex, faces.counts, notes)
    whole = Part(
        "the mesh",
        positions,
        faces.vertex[triangles],
        normals=None if normals is None else finite_normals(normals, notes),
        uvs={} if uvs is None else {0: flip_v(finite_uvs(uvs, notes))},
        colors=colors,
    )
    corner_uvs = None if faces.uvs is None else flip_v(finite_uvs(faces.uvs, notes))[triangles]
    texture = _texture_numbers(vertices, faces, triangles, face)
    parts = _parts(whole, corner_uvs, texture, _looks(path, header, notes))
    notes += _left_out(header, tables)
    splits = len(parts) > 1 or any(part.uvs or part.normals is not None for part in parts)
    return Contents(tuple(parts), splits=splits, notes=tuple(notes))


def _pop_columns(table: Table, names: tuple[str, ...]) -> Array | None:
    """Remove columns of numbers from a table, and return them as float64 (N, k). Return None if one is missing."""
    columns = [table.get(name) for name in names]
    if not all(isinstance(column, np.ndarray) for column in columns):
        return None
    for name in names:
        del table[name]
    with np.errstate(invalid="ignore"):  # the caller checks that numbers are finite
        return np.stack(columns, axis=1).astype(np.float64)  # type: ignore[arg-type]


def _colors(element: Element, vertices: Table, notes: list[str]) -> Array | None:
    """Read linear colours (V, 3) of the vertices. Return None if they have none."""
    types = {p.name: p.type for p in element.properties}
    for names in _COLORS:
        colors = _pop_columns(vertices, names)
        if colors is None:
            continue
        alpha = names[0].replace("red", "alpha") if names[0] != "r" else "a"
        full = _FULL.get(types[names[0]], 255.0)
        whole = types[names[0]][0] != "f"
        if np.all(vertices.get(alpha) == (full if whole else 1.0)):
            del vertices[alpha]  # all opaque: nothing to report
        return linear_colors(colors / full if whole else colors, whole, notes)
    return None


def _texture_numbers(vertices: Table, faces: Faces, triangles: Array, face: Array) -> Array | None:
    """Return the texture number of each triangle, int64 (T,): that of its face, or else that of its first vertex."""
    if faces.texture is not None:
        numbers: Array = faces.texture[face]
        return numbers
    of_vertex = vertices.pop("texnumber", None)
    return of_vertex[faces.vertex[triangles[:, 0]]].astype(np.int64) if isinstance(of_vertex, np.ndarray) else None


def _looks(path: Path, header: Header, notes: list[str]) -> list[Look]:
    """Return a look for each texture that a comment names."""
    looks = []
    for comment in header.comments:
        match = re.match(r"texturefile\s+(.+)", comment, re.IGNORECASE)
        if match:
            name = match[1].strip('"')
            file = locate(name, path.parent)
            if file is None:
                notes.append(f"the texture '{printable(name)}' does not exist and is left out")
            looks.append(Look(base_color_map=Texture(file, file.name) if file else None))
    return looks


def _parts(whole: Part, corner_uvs: Array | None, texture: Array | None, looks: list[Look]) -> list[Part]:
    """Split a mesh into one part for each texture, and its vertices where `corner_uvs` (T, 3, 2) differ."""
    if texture is None or not looks:
        texture = np.zeros(len(whole.faces), np.int64)
    if corner_uvs is None and not texture.any():
        return [replace(whole, look=looks[0] if looks else Look())]
    columns = [whole.faces]
    if corner_uvs is not None:
        points = np.ascontiguousarray(corner_uvs).view(complex)[..., 0]  # one complex number for each u v
        columns.append(np.unique(points, return_inverse=True)[1].reshape(whole.faces.shape))
    parts = []
    for number in np.unique(texture):
        mine = texture == number
        first, corner = vertices_of([column[mine].ravel() for column in columns])
        vertex = whole.faces[mine].ravel()[first]
        uvs = {i: values[vertex] for i, values in whole.uvs.items()}
        if corner_uvs is not None:
            uvs[0] = corner_uvs[mine].reshape(-1, 2)[first]
        parts.append(
            Part(
                f"texture {number}",
                whole.positions[vertex],
                corner.reshape(-1, 3),
                looks[number] if 0 <= number < len(looks) else Look(),
                normals=None if whole.normals is None else whole.normals[vertex],
                uvs=uvs,
                colors=None if whole.colors is None else whole.colors[vertex],
            )
        )
    return parts


def _left_out(header: Header, tables: dict[str, Table]) -> list[str]:
    """Return notes on the elements and properties that were not used."""
    notes = []
    for element in header.elements:
        left = list(tables.pop(element.name, {}))
        if not left or not element.count:
            continue
        if len(left) == len(element.properties):
            notes.append(f"{element.count} rows of element {printable(element.name)} are left out")
        else:
            names = ", ".join(map(printable, left[:6])) + ", …" * (len(left) > 6)
            notes.append(f"properties of element {printable(element.name)} are left out: {names}")
    return notes
