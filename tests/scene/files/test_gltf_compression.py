"""Compressed glTF files are decoded if the packages are installed; otherwise uncompressed data are read, if any."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import FACES, TETRAHEDRON, File

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents
from wgsss.scene.files.gltf import read_gltf

DRACO, MESHOPT = "KHR_draco_mesh_compression", ("EXT_meshopt_compression", "KHR_meshopt_compression")


def draco(data: bytes, required: bool, fallback: bool) -> File:
    """Make a file with a tetrahedron compressed by Draco; with `fallback`, also uncompressed in accessors."""
    file = File()
    primitive = file.primitive()
    for accessor in file.tree["accessors"]:
        if not fallback:
            del accessor["bufferView"]
    compressed = {"bufferView": file.view(data), "attributes": {"POSITION": 0}}
    file.node(mesh=file.mesh({**primitive, "extensions": {DRACO: compressed}}))
    if required:
        file.tree["extensionsRequired"] = [DRACO]
    return file


def meshopt(encoded: bytes, name: str, fallback: bool, **fields: Any) -> File:
    """Make a file with a tetrahedron whose positions meshopt compresses; with `fallback`, also uncompressed."""
    file = File()
    compressed = file.view(encoded)
    packed = {**file.tree["bufferViews"][compressed], "byteStride": 12, "count": 4, "mode": "ATTRIBUTES", **fields}
    positions = file.rows(TETRAHEDRON, "VEC3")
    view = file.tree["bufferViews"][file.tree["accessors"][positions]["bufferView"]]
    view["extensions"] = {name: packed}
    file.node(mesh=file.mesh(file.primitive(attributes={"POSITION": positions})))
    file.tree["buffers"] = [{"byteLength": len(file.data)}]
    if not fallback:
        view |= {"buffer": 1, "byteOffset": 0}
        file.tree["buffers"].append({"byteLength": 48, "extensions": {name: {"fallback": True}}})
    return file


def read(file: File, path: Path) -> Contents:
    return read_gltf(file.save(path / "box.glb"))


def refused(file: File, path: Path) -> str:
    with pytest.raises(InputError) as raised:
        read(file, path)
    return str(raised.value).removeprefix(f"{path / 'box.glb'}: ")


@pytest.fixture
def without_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pretend that no package is installed."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)


@pytest.mark.usefixtures("without_packages")
def test_uncompressed_data_are_read_without_the_packages(tmp_path: Path) -> None:
    files = [draco(b"?", False, True), *(meshopt(b"?", name, True) for name in MESHOPT)]
    for file in files:
        contents = read(file, tmp_path)
        assert contents.parts[0].positions.tolist() == TETRAHEDRON.tolist()


@pytest.mark.usefixtures("without_packages")
def test_the_error_names_the_missing_package_if_there_are_no_uncompressed_data(tmp_path: Path) -> None:
    advice = "to read {}, the package {} is needed (pip install {})"
    message = advice.format(DRACO, "DracoPy", "DracoPy")
    assert refused(draco(b"?", True, True), tmp_path) == message
    assert refused(draco(b"?", False, False), tmp_path) == f"mesh 0, primitive 0: {message}"
    for name in MESHOPT:
        message = advice.format(name, "meshopt", "meshopt")
        assert refused(meshopt(b"?", name, False), tmp_path) == f"buffer view 1: {message}"


def test_draco_is_decoded(tmp_path: Path) -> None:
    package = pytest.importorskip("DracoPy")
    data = package.encode(TETRAHEDRON.astype(np.float32), faces=FACES, quantization_bits=16)
    part = read(draco(data, True, False), tmp_path).parts[0]
    triangles = sorted(np.round(part.positions[part.faces], 3).reshape(4, 9).tolist())
    corners = part.positions[part.faces]
    volume = np.linalg.det(corners).sum() / 6
    assert len(triangles) == 4 and volume == pytest.approx(1 / 6, rel=1e-3)
    for damage in (data[: len(data) // 2], b"?", b""):
        expected = "mesh 0, primitive 0: KHR_draco_mesh_compression: damaged: buffer view 2 cannot be decoded"
        assert refused(draco(damage, True, False), tmp_path) == expected


@pytest.mark.parametrize("name", MESHOPT)
def test_meshopt_is_decoded(tmp_path: Path, name: str) -> None:
    package = pytest.importorskip("meshopt")
    data = package.encode_gltf_buffer(TETRAHEDRON.astype(np.float32), "ATTRIBUTES")
    assert read(meshopt(data, name, False), tmp_path).parts[0].positions.tolist() == TETRAHEDRON.tolist()
    for damage, fields, message in (
        (data[:-5], {}, "damaged: it cannot be decoded"),
        (data, {"filter": "OCTAHEDRAL"}, "damaged: it cannot be decoded"),
        (data, {"mode": "POINTS"}, "mode must be one of ATTRIBUTES, TRIANGLES, INDICES, not POINTS"),
        (data, {"count": 5}, "its 5 rows of 12 bytes do not make the 48 bytes of buffer view 1"),
    ):
        assert refused(meshopt(damage, name, False, **fields), tmp_path) == f"buffer view 1: {name}: {message}"


def test_too_many_rows_for_the_bytes_are_refused_before_decoding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: True)
    file = meshopt(b"abc", MESHOPT[0], False, count=10**8)
    file.tree["bufferViews"][1]["byteLength"] = 12 * 10**8
    expected = "buffer view 1: EXT_meshopt_compression: 3 bytes cannot hold its 100000000 rows"
    assert refused(file, tmp_path) == expected
