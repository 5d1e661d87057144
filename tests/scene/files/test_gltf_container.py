"""The two forms of glTF files, and the data and files that their URIs name."""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path

import numpy as np
import pytest
from gltfs import TETRAHEDRON, File, png

from wgsss.errors import InputError
from wgsss.scene.files.gltf import read_gltf


def refused(path: Path) -> str:
    """Return the error of a file, which must be one line, without the path."""
    with pytest.raises(InputError) as raised:
        read_gltf(path)
    message = str(raised.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    return message.removeprefix(f"{path}: ")


def test_both_forms_have_the_same_contents(tmp_path: Path) -> None:
    for name in ("box.glb", "box.gltf"):
        contents = read_gltf(File().with_tetrahedron().save(tmp_path / name))
        assert contents.parts[0].positions.tolist() == TETRAHEDRON.tolist()
        assert contents.mm_per_unit == 1000 and contents.states_unit and contents.notes == ()


def test_the_form_is_recognised_by_content_not_by_extension(tmp_path: Path) -> None:
    (tmp_path / "box.gltf").write_bytes(File().with_tetrahedron().glb())
    assert len(read_gltf(tmp_path / "box.gltf").parts) == 1


def test_unknown_chunks_are_skipped_and_padding_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "box.glb"
    path.write_bytes(File().with_tetrahedron().glb((b"ABCD", b"12345"), (b"JSON", b"{}")) + b"trailing")
    assert len(read_gltf(path).parts) == 1


def test_a_byte_order_mark_and_bytes_that_are_not_utf8(tmp_path: Path) -> None:
    path = File().with_tetrahedron(name="skin").save(tmp_path / "box.gltf")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"skin", b"sk\xefn"))
    assert read_gltf(path).parts[0].look.name == "sk\ufffdn"


@pytest.mark.parametrize(
    ("asset", "message"),
    [
        ({"version": "1.0"}, "its asset.version is 1.0: only glTF 2.0 can be read"),
        ({"version": "2.0", "minVersion": "2.1"}, "its asset.minVersion is 2.1: only glTF 2.0 can be read"),
        ({"version": [2]}, "its asset.version is [2]: only glTF 2.0 can be read"),
        ({}, "damaged, or not a glTF 2 file (asset.version is missing)"),
        (None, "damaged, or not a glTF 2 file (asset.version is missing)"),
        ("2.0", "asset must be an object, not '2.0'"),
    ],
)
def test_other_versions_are_refused(tmp_path: Path, asset: object, message: str) -> None:
    file = File().with_tetrahedron()
    file.tree["asset"] = asset
    assert refused(file.save(tmp_path / "box.gltf")) == message


def test_a_later_minor_version_is_read(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.tree["asset"] = {"version": "2.1"}
    assert len(read_gltf(file.save(tmp_path / "box.glb")).parts) == 1


def test_damaged_containers_are_refused(tmp_path: Path) -> None:
    whole, path = File().with_tetrahedron().glb(), tmp_path / "box.glb"
    for content, message in (
        (whole[:100], f"damaged: it has 100 bytes, but its header says {len(whole)}"),
        (whole[:4], "its version is 0"),
        (whole.replace(b"JSON", b"JUNK", 1), "damaged: it has no JSON chunk"),
        (whole[:4] + b"\1\0\0\0" + whole[8:], "its version is 1"),
        (whole[:12] + b"\xff\xff\xff\x7f" + whole[16:], "the chunk at byte 12 reaches beyond the end of the file"),
        (whole.replace(b'{"asset"', b'{"asset ', 1), "damaged, or not a .glb file (no valid JSON at line 1, column"),
        (b"[" * 100_000, "damaged: its JSON is nested too deep"),
        (b'{"asset": ' + b'{"a":' * 100_000, "damaged: its JSON is nested too deep"),
        (b"[1]", "damaged, or not a .glb file (its JSON is not an object)"),
        (b'{"a": ' + b"1" * 10_000 + b"}", "damaged: a number in its JSON has too many digits"),
        (b"this is not a mesh", "damaged, or not a .glb file (no valid JSON at line 1, column 1)"),
        (b"", "the file is empty"),
    ):
        path.write_bytes(content)
        assert message in refused(path)


def test_folders_and_pipes_are_refused(tmp_path: Path) -> None:
    assert refused(tmp_path / "none.glb") == "no such file"
    os.mkfifo(tmp_path / "pipe.glb")
    (tmp_path / "folder.glb").mkdir()
    for name in ("pipe.glb", "folder.glb"):
        assert refused(tmp_path / name) == "not a regular file"


@pytest.mark.parametrize(
    ("uri", "name"),
    [
        ("my%20data.bin", "my data.bin"),
        ("my data.bin", "my data.bin"),
        ("my%20data.bin", "my%20data.bin"),
        ("sub/data.bin", "sub/data.bin"),
        ("sub\\data.bin", "sub/data.bin"),
        ("../%C3%A9.bin", "../é.bin"),
    ],
)
def test_names_of_files_percent_encoded_or_not(tmp_path: Path, uri: str, name: str) -> None:
    (tmp_path / "here" / "sub").mkdir(parents=True)
    file = File().with_tetrahedron()
    file.tree["buffers"] = [{"byteLength": len(file.data), "uri": uri}]
    path = file.save(tmp_path / "here" / "box.gltf")
    path.with_suffix(".bin").rename(path.parent / name)
    assert read_gltf(path).parts[0].positions.tolist() == TETRAHEDRON.tolist()


@pytest.mark.parametrize("head", ["data:application/octet-stream;base64,", "data:;base64,", "data:any/thing;base64,"])
def test_data_uris_are_decoded(tmp_path: Path, head: str) -> None:
    file = File().with_tetrahedron()
    text = base64.b64encode(bytes(file.data)).decode().rstrip("=").replace("+", "%2B")
    file.tree["buffers"] = [{"byteLength": len(file.data), "uri": head + text[:40] + "\n" + text[40:]}]
    assert read_gltf(file.save(tmp_path / "box.gltf")).parts[0].positions.tolist() == TETRAHEDRON.tolist()


def test_missing_data_are_an_error_that_names_the_buffer(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    path = file.save(tmp_path / "box.gltf")
    os.mkfifo(tmp_path / "pipe")
    for uri, message in (
        ("none.bin", "buffer 0: there is no file 'none.bin' beside it"),
        ("a" * 5000, "buffer 0: there is no file '" + "a" * 57 + "...' beside it"),
        ("zero%00.bin", "buffer 0: there is no file 'zero .bin' beside it"),
        ("pipe", "buffer 0: 'pipe' is not a regular file"),
        (".", "buffer 0: '.' is not a regular file"),
        ("data:;base64,????", "buffer 0: its data URI is not valid base64"),
        ("data:none", "buffer 0: its data URI has no comma"),
        ("http://example.org/box.bin", "buffer 0: there is no file 'http://example.org/box.bin' beside it"),
        (5, "buffer 0: uri must be text, not 5"),
        (None, "buffer 0: it has no data"),
    ):
        file.tree["buffers"] = [{"byteLength": len(file.data), "uri": uri}]
        path.write_text(json.dumps(file.tree))
        assert refused(path) == message


def test_a_missing_image_is_left_out_with_a_note(tmp_path: Path) -> None:
    file = File()
    (tmp_path / "my map.png").write_bytes(png())
    for uri in ("my%20map.png", "gone%20.png", "data:image/png;base64,??", "data:image/png;base64,"):
        number = file.add("textures", source=file.add("images", uri=uri))
        file.with_tetrahedron(pbrMetallicRoughness={"baseColorTexture": {"index": number}})
    contents = read_gltf(file.save(tmp_path / "box.glb"))
    sources = [part.look.base_color_map and part.look.base_color_map.source for part in contents.parts]
    assert sources == [tmp_path / "my map.png", None, None, b""]
    assert contents.notes == (
        "image 1 (gone%20.png) left out: there is no file 'gone .png' beside it",
        "image 2 left out: its data URI is not valid base64",
    )


def test_unused_buffers_may_be_missing(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.tree["buffers"] = [{"byteLength": len(file.data)}, {"byteLength": 9, "uri": "none.bin"}]
    assert len(read_gltf(file.save(tmp_path / "box.glb")).parts) == 1


def test_arrays_have_standard_types(tmp_path: Path) -> None:
    part = read_gltf(File().with_tetrahedron().save(tmp_path / "box.glb")).parts[0]
    assert (part.positions.dtype, part.faces.dtype, part.uvs[0].dtype) == (np.float64, np.int64, np.float64)
