"""Reading PLY files: polygons and strips of triangles with texture coordinates, normals and vertex colours.

The format leaves the names of elements and properties to programs. Those known here are what MeshLab, Blender, VTK,
Stanford's tools and others write. Integer colours are taken to be sRGB, and floating-point ones to be linear.
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
from wgsss.scene.files.corners import finite_normals, finite_uvs, upside_down, vertices_of
from wgsss.scene.files.locate import locate
from wgsss.scene.files.ply.data import Table, read_tables
from wgsss.scene.files.ply.faces import Faces, read_faces
from wgsss.scene.files.ply.header import Element, Header, read_header
from wgsss.scene.files.text import file_bytes, shown
from wgsss.scene.files.triangulate import triangulate

Array = npt.NDArray[Any]

_UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("s0", "t0"), ("u0", "v0"))
_COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_FULL = {"u1": 255.0, "i1": 127.0, "u2": 65535.0, "i2": 32767.0}  # of the types of colours; other integers go to 255


def read_ply(path: Path) -> Contents:
    """All polygons and strips of a file, one part for each texture.

    Raises InputError, naming the line or the element, where the file is missing, damaged, or has no faces.
    """
    data = file_bytes(path)
    header = read_header(path, data)
    notes: list[str] = []
    tables = read_tables(path, data, header, notes)
    element = next((e for e in header.elements if e.name in ("vertex", "vertices")), Element("vertex", 0))
    vertices = tables.get(element.name, {})
    # What is used is taken out of the tables, so that what is there in the end was left out.
    positions = _taken(vertices, ("x", "y", "z"))
    if positions is None:
        raise InputError(f"{path}: damaged: there is no element vertex with the properties x, y and z")
    faces = read_faces(path, tables, len(positions), notes)
    if not len(faces.counts):
        raise InputError(f"{path}: the mesh is empty: it has no faces, {len(positions)} points")
    normals, colors = _taken(vertices, ("nx", "ny", "nz")), _colors(element, vertices, notes)
    uvs = next((uv for names in _UVS if (uv := _taken(vertices, names)) is not None), None)
    triangles, face = triangulate(path, positions, faces.vertex, faces.counts, notes)
    whole = Part(
        "the mesh",
        positions,
        faces.vertex[triangles],
        normals=None if normals is None else finite_normals(normals, notes),
        uvs={} if uvs is None else {0: upside_down(finite_uvs(uvs, notes))},
        colors=colors,
    )
    corner_uvs = None if faces.uvs is None else upside_down(finite_uvs(faces.uvs, notes))[triangles]
    texture = _texture_numbers(vertices, faces, triangles, face)
    parts = _parts(whole, corner_uvs, texture, _looks(path, header, notes))
    notes += _left_out(header, tables)
    splits = len(parts) > 1 or any(part.uvs or part.normals is not None for part in parts)
    return Contents(tuple(parts), splits=splits, notes=tuple(notes))


def _taken(table: Table, names: tuple[str, ...]) -> Array | None:
    """Columns of numbers of a table as float64 (N, k), taken out of it; None where it lacks one."""
    columns = [table.get(name) for name in names]
    if not all(isinstance(column, np.ndarray) for column in columns):
        return None
    for name in names:
        del table[name]
    with np.errstate(invalid="ignore"):  # numbers that are not finite are the caller's to find
        return np.stack(columns, axis=1).astype(np.float64)  # type: ignore[arg-type]


def _colors(element: Element, vertices: Table, notes: list[str]) -> Array | None:
    """Linear colours (V, 3) of vertices, or None."""
    types = {p.name: p.type for p in element.properties}
    for names in _COLORS:
        colors = _taken(vertices, names)
        if colors is None:
            continue
        alpha = names[0].replace("red", "alpha") if names[0] != "r" else "a"
        full = _FULL.get(types[names[0]], 255.0)
        whole = types[names[0]][0] != "f"
        if np.all(vertices.get(alpha) == (full if whole else 1.0)):
            del vertices[alpha]  # opaque: nothing is lost
        return linear_colors(colors / full if whole else colors, whole, notes)
    return None


def _texture_numbers(vertices: Table, faces: Faces, triangles: Array, face: Array) -> Array | None:
    """The number of the texture of each triangle, int64 (T,), which its face has, or its first vertex."""
    if faces.texture is not None:
        numbers: Array = faces.texture[face]
        return numbers
    of_vertex = vertices.pop("texnumber", None)
    return of_vertex[faces.vertex[triangles[:, 0]]].astype(np.int64) if isinstance(of_vertex, np.ndarray) else None


def _looks(path: Path, header: Header, notes: list[str]) -> list[Look]:
    """What the textures are that the comments name."""
    looks = []
    for comment in header.comments:
        found = re.match(r"texturefile\s+(.+)", comment, re.IGNORECASE)
        if found:
            name = found[1].strip('"')
            file = locate(name, path.parent)
            if file is None:
                notes.append(f"the texture '{shown(name)}' is not there, and left out")
            looks.append(Look(base_color_map=Texture(file, file.name) if file else None))
    return looks


def _parts(whole: Part, corner_uvs: Array | None, texture: Array | None, looks: list[Look]) -> list[Part]:
    """The whole as a part for each texture, its vertices split where `corner_uvs` (T, 3, 2) differ."""
    if texture is None or not looks:
        texture = np.zeros(len(whole.faces), np.int64)
    if corner_uvs is None and not texture.any():
        return [replace(whole, look=looks[0] if looks else Look())]
    columns = [whole.faces]
    if corner_uvs is not None:
        points = np.ascontiguousarray(corner_uvs).view(complex)[..., 0]  # so that a row is one number
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
    """Notes on the elements and properties of which nothing was used."""
    notes = []
    for element in header.elements:
        left = list(tables.pop(element.name, {}))
        if not left or not element.count:
            continue
        if len(left) == len(element.properties):
            notes.append(f"{element.count} rows of element {shown(element.name)} are left out")
        else:
            names = ", ".join(map(shown, left[:6])) + ", …" * (len(left) > 6)
            notes.append(f"properties of element {shown(element.name)} are left out: {names}")
    return notes
