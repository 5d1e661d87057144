"""The faces of OBJ files: the vertex, texture coordinate and normal of each corner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.text import Text, printable

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Faces:
    """F faces with C corners in total, face after face."""

    counts: Array
    """int64 (F,): the number of corners of each face"""
    vertex: Array
    """int64 (C,): the index of the vertex of each corner"""
    uv: Array
    """int64 (C,): the index of the texture coordinate, or -1 if the corner has none"""
    normal: Array
    """int64 (C,): the index of the normal, or -1 if the corner has none"""


def read_faces(text: Text, rows: Array, vertices: Array, uvs: Array, normals: Array) -> Faces:
    """Read the faces in some rows, given the rows of all vertices, texture coordinates and normals.

    A corner is "v", "v/vt", "v//vn" or "v/vt/vn". A negative number counts back from the last vertex, texture
    coordinate or normal before the face. Raises InputError, naming the line, if a corner has another form, or if a
    number is 0 or out of range.
    """
    counts = text.widths[rows] - 1
    first = text.first[rows] + 1 - (np.cumsum(counts) - counts)
    words = np.repeat(first, counts) + np.arange(counts.sum())
    has_uv, has_normal = _fields(text, words)
    fields = 1 + has_uv + has_normal
    numbers = text.converted(text.words(words, b"/"), int, np.repeat(words, fields))
    at = np.cumsum(fields) - fields
    row = np.repeat(rows, counts)

    def index(has: Array, offset: Array, targets: Array, noun: str) -> Array:
        """Return indices (C,) into the rows `targets`, -1 for corners without. `has` (C,) says which have one."""
        number = numbers[offset[has]]
        indices = np.where(number > 0, number - 1, np.searchsorted(targets, row[has]) + number)
        bad = np.flatnonzero((number == 0) | (indices < 0) | (indices >= len(targets)))
        if len(bad):
            word = words[has][bad[0]]
            raise text.error(word, f"{noun} {number[bad[0]]} does not exist (the file has {len(targets)})")
        result = np.full(len(words), -1)
        result[has] = indices
        return result

    return Faces(
        counts,
        index(np.ones(len(words), bool), at, vertices, "vertex"),
        index(has_uv, at + 1, uvs, "texture coordinate"),
        index(has_normal, at + 1 + has_uv, normals, "normal"),
    )


def _fields(text: Text, words: Array) -> tuple[Array, Array]:
    """Return whether each corner has a texture coordinate, and whether it has a normal, both bool (C,)."""
    starts, ends = text.starts[words], text.ends[words]
    slashes = np.flatnonzero(text.codes == ord("/"))
    before = np.searchsorted(slashes, starts)
    count = np.searchsorted(slashes, ends) - before
    bad = np.flatnonzero((count > 2) | (text.codes[starts] == ord("/")))
    if len(bad):
        word = words[bad[0]]
        raise text.error(word, f"'{printable(text.word(word))}' is not a corner of a face")
    has_uv, has_normal = count > 0, count == 2
    # Some programs leave the last fields empty: "1/" and "1//".
    after_slash = slashes[before[has_uv]] + 1
    has_uv[has_uv] = (after_slash < ends[has_uv]) & (
        text.codes[np.minimum(after_slash, len(text.codes) - 1)] != ord("/")
    )
    has_normal &= text.codes[ends - 1] != ord("/")
    return has_uv, has_normal
