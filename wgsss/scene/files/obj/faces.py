"""The faces of OBJ files: which vertex, texture coordinate and normal each corner has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.text import Text, shown

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Faces:
    """Faces whose corners (C,) follow one another; what a corner has is an index from 0, or -1 where it has none."""

    counts: Array
    """int64 (F,): the corners of each face"""
    vertex: Array
    uv: Array
    normal: Array


def read_faces(text: Text, rows: Array, vertices: Array, uvs: Array, normals: Array) -> Faces:
    """The faces that stand in some rows, given the rows of all vertices, texture coordinates and normals.

    A corner is "v", "v/vt", "v//vn" or "v/vt/vn". Raises InputError, naming the line, where it is none of these, or a
    number is 0 or beyond what there is. A negative number counts back from the last that stands before the face.
    """
    counts = text.widths[rows] - 1
    first = text.first[rows] + 1 - (np.cumsum(counts) - counts)
    words = np.repeat(first, counts) + np.arange(counts.sum())
    has_uv, has_normal = _fields(text, words)
    fields = 1 + has_uv + has_normal
    numbers = text.converted(text.words(words, b"/"), int, np.repeat(words, fields))
    at = np.cumsum(fields) - fields
    row = np.repeat(rows, counts)

    def index(has: Array, place: Array, named: Array, what: str) -> Array:
        """The indices of corners that have one, given the rows of what they name."""
        number = numbers[place[has]]
        found = np.where(number > 0, number - 1, np.searchsorted(named, row[has]) + number)
        bad = np.flatnonzero((number == 0) | (found < 0) | (found >= len(named)))
        if len(bad):
            word = words[has][bad[0]]
            raise text.error(word, f"{what} {number[bad[0]]} does not exist (the file has {len(named)})")
        result = np.full(len(words), -1)
        result[has] = found
        return result

    return Faces(
        counts,
        index(np.ones(len(words), bool), at, vertices, "vertex"),
        index(has_uv, at + 1, uvs, "texture coordinate"),
        index(has_normal, at + 1 + has_uv, normals, "normal"),
    )


def _fields(text: Text, words: Array) -> tuple[Array, Array]:
    """Which of the corners name a texture coordinate and which a normal, bool (C,)."""
    starts, ends = text.starts[words], text.ends[words]
    slashes = np.flatnonzero(text.codes == ord("/"))
    before = np.searchsorted(slashes, starts)
    count = np.searchsorted(slashes, ends) - before
    bad = np.flatnonzero((count > 2) | (text.codes[starts] == ord("/")))
    if len(bad):
        word = words[bad[0]]
        raise text.error(word, f"'{shown(text.word(word))}' is not a corner of a face")
    has_uv, has_normal = count > 0, count == 2
    # Some programs leave the last fields empty: "1/" and "1//".
    after_slash = slashes[before[has_uv]] + 1
    has_uv[has_uv] = (after_slash < ends[has_uv]) & (
        text.codes[np.minimum(after_slash, len(text.codes) - 1)] != ord("/")
    )
    has_normal &= text.codes[ends - 1] != ord("/")
    return has_uv, has_normal
