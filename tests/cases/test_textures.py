"""Textures of glTF files: their image files, texture coordinates, samplers and bit depths."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import (
    BLUE,
    RED,
    ball,
    ball_primitive,
    checker,
    checkered,
    colored,
    difference,
    encoded,
    loaded,
    picture,
    scene_and_notes,
    texture,
    transformed,
)
from gltfs import File

from wgsss import render
from wgsss.scene import Scene, load_scene
from wgsss.scene.images import MAX_SIDE

Array = np.ndarray[Any, Any]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Load a ball with a checker."""
    return loaded(checkered(), tmp_path_factory.mktemp("plain"))


# --- names of files --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("uri", "name"),
    [
        ("map.png", "map.png"),
        ("tex%20map.png", "tex map.png"),
        ("tex map.png", "tex map.png"),
        ("tex%20map.png", "tex%20map.png"),  # a program that does not encode URIs
        ("f%C3%BCr%20%E7%9A%AE.png", "für 皮.png"),
        ("für 皮.png", "für 皮.png"),
        ("a%23b%3Fc%2Bd.png", "a#b?c+d.png"),
        ("a#b?c+d.png", "a#b?c+d.png"),
        ("a+b.png", "a+b.png"),
        ("100%25.png", "100%.png"),
        ("100%.png", "100%.png"),
        ("./maps/../maps/a.png", "maps/a.png"),
        ("maps%2Fa.png", "maps/a.png"),
        ("maps\\a.png", "maps/a.png"),
    ],
)
def test_image_files_are_found_by_their_uris(tmp_path: Path, plain: Scene, uri: str, name: str) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / name).write_bytes(encoded(checker()))
    assert difference(loaded(checkered(uri), tmp_path / "ball.gltf"), plain) == 0


@pytest.mark.parametrize(("uri", "name"), [("bin%20file.bin", "bin file.bin"), ("b#%C3%A4.bin", "b#ä.bin")])
def test_buffer_files_are_found_by_their_uris(tmp_path: Path, plain: Scene, uri: str, name: str) -> None:
    file = checkered()
    file.tree["buffers"] = [{"byteLength": len(file.data), "uri": uri}]
    path = file.save(tmp_path / "ball.gltf")
    path.with_suffix(".bin").rename(tmp_path / name)
    assert difference(load_scene(path), plain) == 0


def test_a_missing_or_damaged_image_is_noted_once(tmp_path: Path) -> None:
    for image, words in ((b"no image", "damaged, or not an image"), ("gone.png", "'gone.png'")):
        file = File()
        material = colored(file, image)
        file.node(mesh=file.mesh(ball_primitive(file, material), ball_primitive(file, material, (0.2, 0, 0))))
        scene, lines = scene_and_notes(file, tmp_path / "ball.gltf")
        assert len(lines) == 1 and words in lines[0] and "image 0" in lines[0]
        assert scene.objects[0].material.maps.base_color is None


# --- coordinates -----------------------------------------------------------------------------------------------------


def test_a_texture_may_use_the_second_set_of_coordinates(tmp_path: Path, plain: Scene) -> None:
    file = File()
    attributes = {"TEXCOORD_0": file.rows(ball()[1] * 0, "VEC2"), "TEXCOORD_1": file.rows(ball()[1], "VEC2")}
    file.node(mesh=file.mesh(ball_primitive(file, colored(file, texCoord=1), attributes=attributes)))
    assert difference(loaded(file, tmp_path), plain) == 0


def test_a_transform_may_name_the_set_of_coordinates(tmp_path: Path, plain: Scene) -> None:
    file = File()
    attributes = {"TEXCOORD_0": file.rows(ball()[1] * 0, "VEC2"), "TEXCOORD_3": file.rows(ball()[1], "VEC2")}
    material = colored(file, texCoord=1, extensions={"KHR_texture_transform": {"texCoord": 3}})
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)))
    assert difference(loaded(file, tmp_path), plain) == 0


def test_a_second_texture_over_another_set_is_left_out_with_a_note(tmp_path: Path, plain: Scene) -> None:
    file = File()
    bumps = texture(file, encoded(np.full((4, 4, 3), (128, 128, 255), np.uint8)))
    material = file.add(
        "materials",
        pbrMetallicRoughness={"baseColorTexture": {"index": texture(file)}},
        normalTexture={"index": bumps, "texCoord": 1},
    )
    attributes = {"TEXCOORD_1": file.rows(ball()[1] * 2, "VEC2")}
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)))
    scene, lines = scene_and_notes(file, tmp_path)
    assert len([line for line in lines if "normal texture image 0 left out" in line]) == 1
    assert scene.objects[0].material.maps.normal is None
    assert difference(scene, plain) <= 1


@pytest.mark.parametrize(("spread", "left_out"), [(1, False), (2, True)])
def test_two_textures_with_different_samplers(tmp_path: Path, spread: float, left_out: bool) -> None:
    """If coordinates exceed the image, the second texture is left out with a note. Otherwise both are used."""
    file = File()
    file.add("samplers", wrapS=33071, wrapT=33071)
    bumps = texture(file, encoded(np.full((4, 4, 3), (128, 128, 255), np.uint8)))
    base = {"baseColorTexture": {"index": texture(file, sampler=0)}, "metallicFactor": 0}
    material = file.add("materials", pbrMetallicRoughness=base, normalTexture={"index": bumps})
    attributes = {"TEXCOORD_0": file.rows(ball()[1] * spread, "VEC2")}
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)))
    scene, lines = scene_and_notes(file, tmp_path)
    assert (scene.objects[0].material.maps.normal is None) == left_out
    assert lines == (["normal texture image 0 left out: it is wrapped differently from image 1"] if left_out else [])


def test_two_textures_over_one_set_are_both_used(tmp_path: Path) -> None:
    file = File()
    slant = np.full((2, 2, 3), (200, 128, 230), np.uint8)
    material = file.add(
        "materials",
        pbrMetallicRoughness={"baseColorTexture": {"index": texture(file), "texCoord": 1}},
        normalTexture={"index": texture(file, encoded(slant)), "texCoord": 1, "scale": 0.5},
    )
    attributes = {"TEXCOORD_1": file.rows(ball()[1], "VEC2")}
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)))
    maps = loaded(file, tmp_path).objects[0].material.maps
    assert maps.normal is not None and maps.normal[0, 0].tolist() == [200, 128, 230] and maps.normal_scale == 0.5
    assert maps.base_color is not None


@pytest.mark.parametrize("sampler", [{}, {"wrapS": 33648, "wrapT": 33648}, {"wrapS": 33071, "wrapT": 33648}])
@pytest.mark.parametrize(
    "transform",
    [
        {"offset": [0.1, 0.25]},
        {"scale": [3, 2]},
        {"rotation": 0.3},
        {"offset": [0.1, 0.0], "rotation": 0.3, "scale": [8, 8]},
        {"offset": [-2.5, 0.3], "rotation": -2.0, "scale": [-1, 0.5]},
    ],
)
def test_a_texture_transform_is_like_transformed_coordinates(
    tmp_path: Path, sampler: dict[str, int], transform: dict[str, Any]
) -> None:
    pictures = []
    for baked in (False, True):
        file, (_, uvs, _) = File(), ball()
        if sampler:
            file.add("samplers", **sampler)
        info = {} if baked else {"extensions": {"KHR_texture_transform": transform}}
        index = texture(file, **({"sampler": 0} if sampler else {}))
        base = {"baseColorTexture": {"index": index, **info}}
        attributes = {"TEXCOORD_0": file.rows(transformed(uvs, **transform) if baked else uvs, "VEC2")}
        material = file.add("materials", pbrMetallicRoughness=base)
        file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)))
        pictures.append(picture(loaded(file, tmp_path)))
    first, second = pictures
    assert np.mean(np.abs(first - second).max(axis=2) > 2) < 0.002
    assert len(np.unique(first[..., 0])) > 20


def test_a_texture_with_nearest_filter(tmp_path: Path) -> None:
    """A ball has four texels. With NEAREST, only two colours appear."""
    shown = []
    for sampler in ({"magFilter": 9728, "minFilter": 9728}, {"magFilter": 9729}):
        file = File()
        file.add("samplers", **sampler)
        base = {"baseColorTexture": {"index": texture(file, encoded(checker(2, 2)), sampler=0)}}
        material = file.add("materials", pbrMetallicRoughness=base)
        file.node(mesh=file.mesh(ball_primitive(file, material)))
        scene = loaded(file, tmp_path)
        assert scene.objects[0].material.maps.nearest == ("minFilter" in sampler)
        seen = picture(scene)
        seen = seen[seen[..., 3] > 0]
        ratio = seen[:, 0] / np.maximum(seen[:, 2], 1)
        shown.append(np.mean((ratio > 0.5) & (ratio < 2)))
    assert shown[0] < 0.1 < 0.2 < shown[1], "shares of pixels that are neither red nor blue"


# --- depths ----------------------------------------------------------------------------------------------------------

RAMP = np.broadcast_to(np.arange(256, dtype=np.uint8), (4, 256))


def ramp(depth: str) -> bytes:
    """Return a grey ramp from black to white over 256 texels."""
    from PIL import Image

    wide = RAMP.astype(np.uint16) * 257
    if depth == "grey 8":
        return encoded(RAMP)
    if depth == "grey 16":
        return encoded(wide)
    if depth == "palette":
        image = Image.fromarray(RAMP, "L").quantize(256)
        return saved(image, "png")
    if depth == "rgb 8":
        return encoded(np.repeat(RAMP[..., None], 3, axis=2))
    if depth == "grey alpha 8":
        return encoded(np.stack([RAMP, 255 - RAMP], axis=2))
    if depth in ("rgb 16", "rgba 16"):
        return png_16(np.repeat(wide[..., None], len(depth) - 3, axis=2))
    import tifffile

    file = io.BytesIO()
    linear = np.where(RAMP <= 10, RAMP / 255 / 12.92, ((RAMP / 255 + 0.055) / 1.055) ** 2.4)
    values = {"tiff 16": wide, "tiff float": linear.astype(np.float32), "tiff half": linear.astype(np.float16)}
    tifffile.imwrite(file, values[depth])
    return file.getvalue()


def saved(image: Any, kind: str) -> bytes:
    file = io.BytesIO()
    image.save(file, format=kind)
    return file.getvalue()


def png_16(pixels: Array) -> bytes:
    """Encode a PNG of 16 bits with three or four channels, which Pillow cannot write."""
    height, width, channels = pixels.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    head = struct.pack(">2I5B", width, height, 16, 2 if channels == 3 else 6, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    body = b"".join(struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + body


@pytest.fixture(scope="module")
def grey(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Load a ball with the ramp in 8 bits."""
    return loaded(checkered(ramp("grey 8")), tmp_path_factory.mktemp("grey"))


@pytest.mark.parametrize(
    "depth",
    [
        "rgb 8",
        "grey 16",
        "palette",
        "grey alpha 8",
        "rgb 16",
        "rgba 16",
        "tiff 16",
        "tiff float",
        "tiff half",
    ],
)
def test_images_of_every_bit_depth_show_the_same_ramp(tmp_path: Path, grey: Scene, depth: str) -> None:
    scene = loaded(checkered(ramp(depth)), tmp_path)
    pixels = scene.objects[0].material.maps.base_color
    assert pixels is not None and pixels.dtype == np.uint8
    assert np.abs(pixels[0, :, 1].astype(int) - np.arange(256)).max() <= 1
    assert difference(scene, grey) <= 2


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_images_of_few_bits(tmp_path: Path, bits: int) -> None:
    """The texels of the PNG share bytes. It is encoded here because libraries write 8 bits."""
    count = 1 << bits
    packed = np.packbits(((np.arange(8)[:, None] % count >> np.arange(bits)[::-1]) & 1).astype(np.uint8))
    head = struct.pack(">2I5B", 8, 1, bits, 0, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(b"\0" + packed.tobytes())), (b"IEND", b"")]
    body = b"".join(struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    scene = loaded(checkered(b"\x89PNG\r\n\x1a\n" + body), tmp_path)
    pixels = scene.objects[0].material.maps.base_color
    assert pixels is not None
    assert pixels[0, :, 0].tolist() == [255 * (i % count) // (count - 1) for i in range(8)]


def test_a_cmyk_jpeg_is_read(tmp_path: Path, plain: Scene) -> None:
    from PIL import Image

    image = Image.fromarray(checker(size=128)).convert("CMYK")
    file = io.BytesIO()
    image.save(file, format="jpeg", quality=95)
    scene = loaded(checkered(file.getvalue()), tmp_path)
    pixels = scene.objects[0].material.maps.base_color
    assert pixels is not None
    assert np.abs(pixels[8, 8].astype(int) - RED).max() < 12 and np.abs(pixels[8, 24].astype(int) - BLUE).max() < 12


def test_alpha_does_not_change_the_colour_of_an_opaque_material(tmp_path: Path, plain: Scene) -> None:
    hidden = np.dstack([checker(), np.zeros((64, 64), np.uint8)])
    assert difference(loaded(checkered(encoded(hidden)), tmp_path), plain) == 0


@pytest.mark.parametrize("shape", [(1, MAX_SIDE + 1), (MAX_SIDE + 1, 1)])
def test_a_texture_larger_than_a_device_can_hold_is_left_out(tmp_path: Path, shape: tuple[int, int]) -> None:
    scene, lines = scene_and_notes(checkered(encoded(np.zeros((*shape, 3), np.uint8))), tmp_path)
    size = f"{shape[1]} x {shape[0]} pixels; at most {MAX_SIDE} on a side are possible"
    assert len(lines) == 1 and size in lines[0] and "image 0" in lines[0]
    assert scene.objects[0].material.maps.base_color is None


def test_a_huge_texture_is_left_out_before_it_is_decoded(tmp_path: Path) -> None:
    """The file has a header of 50000 x 50000 pixels and no pixels."""
    head = struct.pack(">2I5B", 50000, 50000, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", len(head)) + b"IHDR" + head + struct.pack(">I", zlib.crc32(b"IHDR" + head))
    idat = struct.pack(">I", 2) + b"IDATxx" + struct.pack(">I", zlib.crc32(b"IDATxx"))
    _, lines = scene_and_notes(checkered(b"\x89PNG\r\n\x1a\n" + chunk + idat), tmp_path)
    assert len(lines) == 1 and "50000 x 50000 pixels" in lines[0]


def test_bumps_on_mirrored_coordinates_are_mirrored(tmp_path: Path) -> None:
    """A normal map that tilts right and up tilts left and up if the coordinates are mirrored.

    Both results are compared with the ball without a map.
    """
    uvs = ball()[1]
    normals, slant = [], (210, 180, 220)
    for coordinates, slope in ((uvs, (128, 128, 255)), (uvs, slant), (uvs * [-1, 1] + [1, 0], slant)):
        file = File()
        bumps = {"index": texture(file, encoded(np.full((2, 2, 3), slope, np.uint8)))}
        material = file.add("materials", normalTexture=bumps)
        attributes = {"TEXCOORD_0": file.rows(coordinates, "VEC2")}
        file.node(mesh=file.mesh(ball_primitive(file, material, attributes=attributes)))
        scene = loaded(file, tmp_path)
        normals.append(render(scene, "lambert", (48, 48), aovs=("normal",)).aovs["normal"])
    flat, right, left = normals
    eastwards = np.cross([0, 1, 0], flat)
    middle = np.linalg.norm(eastwards, axis=2) > 0.7  # not near the poles
    for axis, sign in ((eastwards, -1), (np.broadcast_to([0, 1, 0], flat.shape), 1)):
        first, second = (np.einsum("ijk,ijk->ij", bent - flat, axis)[middle] for bent in (right, left))
        assert (first > 0.05).mean() > 0.95
        assert second == pytest.approx(sign * first, abs=0.2), "the rest is due to skewed faces"
