"""Accessors: every type of number in every storage, and errors for data that are missing."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import CODES, File

from wgsss.errors import InputError
from wgsss.scene.files.gltf.document import Document


def document(file: File, path: Path) -> Document:
    return Document(file.save(path / "numbers.glb"))


@pytest.mark.parametrize("dtype", CODES)
@pytest.mark.parametrize("normalized", [False, True])
def test_every_component_type_plain_and_normalised(tmp_path: Path, dtype: str, normalized: bool) -> None:
    file = File()
    low, high = (-7.5, 1e30) if dtype == "f4" else (np.iinfo(dtype).min, np.iinfo(dtype).max)
    index = file.rows([(low, high), (0, 1)], "VEC2", dtype, normalized=normalized)
    values = document(file, tmp_path).numbers(index, "VEC2", "it")
    if dtype == "f4":
        assert values == pytest.approx(np.array([(low, high), (0, 1)]))
    elif normalized:
        assert values == pytest.approx(np.array([(-1 if low else 0, 1), (0, 1 / high)]))
    else:
        assert values.dtype == np.int64 and values.tolist() == [[low, high], [0, 1]]


def test_rows_with_a_stride_and_an_offset(tmp_path: Path) -> None:
    file = File()
    view = file.view([(1, 2, -3, 99), (-128, 127, 0, 99)], "i1", byteStride=4)
    index = file.add("accessors", bufferView=view, byteOffset=1, count=2, componentType=CODES["i1"], type="VEC2")
    assert document(file, tmp_path).numbers(index, "VEC2", "it").tolist() == [[2, -3], [127, 0]]


@pytest.mark.parametrize(("kind", "dtype", "size"), [("MAT2", "u1", 2), ("MAT3", "u1", 3), ("MAT3", "u2", 3)])
def test_columns_of_matrices_begin_at_multiples_of_four_bytes(tmp_path: Path, kind: str, dtype: str, size: int) -> None:
    file = File()
    padded = np.zeros((2, size, size if size * np.dtype(dtype).itemsize % 4 == 0 else 4), dtype)
    padded[..., :size] = np.arange(2 * size * size).reshape(2, size, size)
    index = file.rows(padded, kind, dtype)
    assert document(file, tmp_path).numbers(index, kind, "it").ravel().tolist() == list(range(2 * size * size))


@pytest.mark.parametrize("base", [True, False])
@pytest.mark.parametrize("indices", ["u1", "u2", "u4"])
def test_sparse_rows_replace_others(tmp_path: Path, base: bool, indices: str) -> None:
    file = File()
    sparse = {
        "count": 2,
        "indices": {"bufferView": file.view([1, 3], indices), "componentType": CODES[indices]},
        "values": {"bufferView": file.view([(7, 8, 9), (4, 5, 6)], "f4")},
    }
    rows = np.arange(12).reshape(4, 3)
    index = file.rows(rows, "VEC3", sparse=sparse)
    if not base:
        del file.tree["accessors"][index]["bufferView"]
    expected = (rows if base else np.zeros((4, 3))).tolist()
    expected[1], expected[3] = [7, 8, 9], [4, 5, 6]
    assert document(file, tmp_path).numbers(index, "VEC3", "it").tolist() == expected


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "kind": ({"type": "VEC2"}, "it: accessor 0 must be VEC3, not 'VEC2'"),
    "no kind": ({"type": None}, "it: accessor 0 must be VEC3, not null"),
    "component": ({"componentType": 5124}, "accessor 0: there is no componentType 5124"),
    "component of text": (
        {"componentType": "f"},
        "accessor 0: componentType must be a whole number of at least 0, not 'f'",
    ),
    "count": ({"count": 5}, "it: accessor 0 reaches beyond the end of buffer view 0: its 5 rows do not fit"),
    "huge count": (
        {"count": 10**9},
        "it: accessor 0 reaches beyond the end of buffer view 0: its 1000000000 rows do not fit",
    ),
    "negative count": ({"count": -1}, "accessor 0: count must be a whole number of at least 0, not -1"),
    "endless count": (
        {"count": 10**400},
        "accessor 0: count must be a whole number of at least 0, not a number of very many digits",
    ),
    "flag for a count": ({"count": True}, "accessor 0: count must be a whole number of at least 0, not true"),
    "zeros": (
        {"bufferView": None, "count": 10**9},
        "it: accessor 0 has 1000000000 rows and no buffer view; at most 4194304 can be read",
    ),
    "offset": ({"byteOffset": 4}, "it: accessor 0 reaches beyond the end of buffer view 0: its 4 rows do not fit"),
    "negative offset": ({"byteOffset": -4}, "accessor 0: byteOffset must be a whole number of at least 0, not -4"),
    "view": ({"bufferView": 9}, "accessor 0: there is no buffer view 9"),
    "view of text": ({"bufferView": "a"}, "accessor 0: there is no buffer view 'a'"),
    "normalised": ({"normalized": 1}, "accessor 0: normalized must be true or false, not 1"),
    "sparse": ({"sparse": 5}, "accessor 0: sparse must be an object, not 5"),
    "empty sparse": ({"sparse": {}}, "accessor 0: sparse: count is missing"),
    "sparse count": ({"sparse": {"count": 1}}, "accessor 0: sparse: indices: componentType is missing"),
    "sparse row": (
        {
            "sparse": {
                "count": 1,
                "indices": {"bufferView": 1, "componentType": 5121},
                "values": {"bufferView": 0},
            }
        },
        "it: accessor 0 sets row 200, but has 4 rows",
    ),
    "sparse values": (
        {
            "sparse": {
                "count": 1,
                "indices": {"bufferView": 1, "byteOffset": 1, "componentType": 5121},
                "values": {"bufferView": 1},
            }
        },
        "it: accessor 0 reaches beyond the end of buffer view 1: its 1 rows do not fit",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_accessor_is_named(tmp_path: Path, name: str) -> None:
    change, message = BAD[name]
    file = File()
    file.rows(np.ones((4, 3)), "VEC3")
    file.view([200, 0], "u1")
    file.tree["accessors"][0].update(change)
    opened = document(file, tmp_path)
    tracemalloc.start()
    with pytest.raises(InputError) as raised:
        opened.numbers(0, "VEC3", "it")
    assert tracemalloc.get_traced_memory()[1] < 1e6, "no memory was allocated"
    tracemalloc.stop()
    assert str(raised.value) == message


BAD_VIEWS: dict[str, tuple[dict[str, Any], str]] = {
    "length": ({"byteLength": 100}, "buffer view 0: it reaches beyond the end of buffer 0, which has 48 bytes"),
    "no length": ({"byteLength": None}, "buffer view 0: byteLength is missing"),
    "offset": ({"byteOffset": 4}, "buffer view 0: it reaches beyond the end of buffer 0, which has 48 bytes"),
    "buffer": ({"buffer": 3}, "buffer view 0: there is no buffer 3"),
    "no buffer": ({"buffer": None}, "buffer view 0: there is no buffer null"),
    "stride": ({"byteStride": 8}, "it: accessor 0: byteStride of buffer view 0 is less than a row"),
    "large stride": (
        {"byteStride": 16},
        "it: accessor 0 reaches beyond the end of buffer view 0: its 4 rows do not fit",
    ),
    "stride of text": (
        {"byteStride": "8"},
        "buffer view 0: byteStride must be a whole number of at least 0, not '8'",
    ),
}


@pytest.mark.parametrize("name", BAD_VIEWS)
def test_a_bad_buffer_view_is_named(tmp_path: Path, name: str) -> None:
    change, message = BAD_VIEWS[name]
    file = File()
    file.rows(np.ones((4, 3)), "VEC3")
    file.tree["bufferViews"][0].update(change)
    with pytest.raises(InputError) as raised:
        document(file, tmp_path).numbers(0, "VEC3", "it")
    assert str(raised.value) == message


def test_kind_count_and_index_must_match(tmp_path: Path) -> None:
    file = File()
    file.rows([(1, 2, np.nan)], "VEC3")
    opened = document(file, tmp_path)
    for index, options, message in (
        (1, {}, "it: there is no accessor 1"),
        (-1, {}, "it: there is no accessor -1"),
        (None, {}, "it: there is no accessor null"),
        ("a\nb", {}, "it: there is no accessor 'a\\nb'"),
        ({}, {}, "it: there is no accessor an object"),
        (0, {"count": 7}, "it: accessor 0 has 1 rows instead of 7"),
        (0, {}, "it: accessor 0 holds a number that is not finite"),
    ):
        with pytest.raises(InputError) as raised:
            opened.numbers(index, "VEC3", "it", **options)
        assert str(raised.value) == message
    assert np.isnan(opened.numbers(0, "VEC3", "it", finite=False)).sum() == 1
