"""Textures of every bit depth and format."""

from __future__ import annotations

import io
import os
import struct
import tracemalloc
import warnings
import zlib
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
from pictures import chunk, png
from PIL import Image

from wgsss.errors import InputError
from wgsss.scene.images import MAX_SIDE, read_map, read_pixels

DEEP = np.random.default_rng(3).integers(0, 65536, (23, 17, 4)).astype(np.uint16)
SHALLOW = (DEEP >> 8).astype(np.uint8)


def rounded(deep: np.ndarray) -> np.ndarray:
    return np.floor(deep / 257.0 + 0.5).astype(np.uint8)


def encoded(image: Image.Image, **options: Any) -> bytes:
    file = io.BytesIO()
    image.save(file, **options)
    return file.getvalue()


def tiff(pixels: np.ndarray, **options: Any) -> bytes:
    data = iio.imwrite("<bytes>", pixels, plugin="tifffile", extension=".tif", **options)
    assert data is not None
    return data


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("pixels", [DEEP, SHALLOW], ids=["16 bits", "8 bits"])
def test_a_png_keeps_its_depth(pixels: np.ndarray, channels: int, interlaced: bool) -> None:
    result = read_pixels(png(pixels[..., :channels], interlaced=interlaced))
    np.testing.assert_array_equal(result, pixels[..., :channels])
    assert result.dtype == pixels.dtype


def test_a_map_has_the_channels_of_its_mode_in_eight_bits() -> None:
    grey, colours, alpha = DEEP[..., :1], DEEP[..., :3], DEEP[..., 3]
    luma = colours @ np.array([0.299, 0.587, 0.114])
    for pixels, rgb, light, opacity in (
        (grey, np.repeat(grey, 3, axis=2), grey[..., 0], None),
        (np.dstack([grey, alpha]), np.repeat(grey, 3, axis=2), grey[..., 0], alpha),
        (colours, colours, luma, None),
        (DEEP, colours, luma, alpha),
    ):
        file = png(pixels)
        np.testing.assert_array_equal(read_map(file, "RGB"), rounded(rgb))
        assert np.abs(read_map(file, "L").astype(int) - light / 257.0).max() <= 0.51
        np.testing.assert_array_equal(read_map(file, "A"), 255 if opacity is None else rounded(opacity))
        np.testing.assert_array_equal(read_map(file, "RGBA"), np.dstack([read_map(file, "RGB"), read_map(file, "A")]))


@pytest.mark.parametrize("mode", ["RGB", "L"])
def test_eight_bits_agree_with_pillow(mode: str) -> None:
    for channels in (1, 3, 4):
        file = png(SHALLOW[..., :channels])
        np.testing.assert_array_equal(read_map(file, mode), np.asarray(Image.open(io.BytesIO(file)).convert(mode)))


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_grey_of_few_bits_spans_the_whole_range(depth: int) -> None:
    largest = 2**depth - 1
    values = np.arange(16 * 8, dtype=np.uint8).reshape(16, 8) & largest
    np.testing.assert_array_equal(read_map(png(values, depth=depth), "L"), np.round(values * 255.0 / largest))


def test_a_palette_with_transparency() -> None:
    index = np.arange(12, dtype=np.uint8).reshape(3, 4) % 3
    palette = np.array([[9, 8, 7], [255, 0, 1], [3, 200, 100]])
    file = png(index, palette=palette, trns=bytes([0, 128]))
    np.testing.assert_array_equal(read_map(file, "RGB"), palette[index])
    np.testing.assert_array_equal(read_map(file, "A"), np.array([0, 128, 255])[index])
    assert (read_map(png(index, palette=palette), "A") == 255).all()


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("pixels", [DEEP, SHALLOW], ids=["16 bits", "8 bits"])
def test_a_transparent_colour_becomes_alpha(pixels: np.ndarray, channels: int) -> None:
    key = pixels[4, 5, :channels]
    file = png(pixels[..., :channels], trns=key.astype(">u2").tobytes())
    alpha = read_map(file, "A")
    assert alpha[4, 5] == 0 and (alpha == 255).sum() >= alpha.size - 20
    np.testing.assert_array_equal(
        read_map(file, "RGB")[..., 0], rounded(DEEP[..., 0]) if pixels is DEEP else pixels[..., 0]
    )


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("shape", [(9, 8), (9, 8, 3)])
def test_floating_point_colours_are_encoded_as_srgb(dtype: type, shape: tuple[int, ...]) -> None:
    linear = np.linspace(0, 1, int(np.prod(shape))).reshape(shape).astype(dtype)
    file = tiff(linear)
    expected = linear.astype(float) if linear.ndim == 3 else np.repeat(linear[..., None].astype(float), 3, axis=2)
    np.testing.assert_array_equal(read_map(file, "RGB", linear=True), np.floor(expected * 255 + 0.5))
    srgb = np.where(expected <= 0.0031308, 12.92 * expected, 1.055 * expected ** (1 / 2.4) - 0.055)
    assert np.abs(read_map(file, "RGB") - srgb * 255).max() <= 0.51
    assert (read_map(file, "A") == 255).all()


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_adobe_deflate"])
def test_floating_point_in_any_compression(compression: str | None) -> None:
    linear = np.linspace(0, 1, 72, dtype=np.float32).reshape(9, 8)
    file = encoded(Image.fromarray(linear), format="tiff", compression=compression)
    np.testing.assert_array_equal(read_map(file, "L", linear=True), np.floor(linear * 255 + 0.5))


def test_numbers_beyond_one_are_clamped_with_a_warning_and_nan_is_refused(tmp_path: Path) -> None:
    linear = np.full((4, 4), 0.5, np.float32)
    linear[0, 0], linear[1, 1] = 7.0, -1.0
    (tmp_path / "a.tif").write_bytes(tiff(linear))
    with pytest.warns(UserWarning, match=r"a\.tif: 2 pixels outside 0 to 1 are clamped"):
        result = read_map(tmp_path / "a.tif", "L", linear=True)
    assert (result[0, 0], result[1, 1], result[2, 2]) == (255, 0, 128)
    linear[2, 2] = np.nan
    with pytest.raises(InputError, match=r"^1 pixels are not finite numbers$"):
        read_map(tiff(linear), "L")


@pytest.mark.parametrize("options", [{}, {"planarconfig": "separate"}, {"byteorder": ">"}, {"compression": "zlib"}])
def test_tiff_of_sixteen_bits_and_colours(options: dict[str, str]) -> None:
    pixels = DEEP[..., :3]
    order = options.pop("byteorder", None)
    file = io.BytesIO()
    import tifffile

    planes = np.moveaxis(pixels, 2, 0) if "planarconfig" in options else pixels
    tifffile.imwrite(file, planes, photometric="rgb", byteorder=order, **options)
    np.testing.assert_array_equal(read_pixels(file.getvalue()), pixels)
    tifffile.imwrite(file := io.BytesIO(), DEEP, photometric="rgb", extrasamples=["unassalpha"])
    np.testing.assert_array_equal(read_pixels(file.getvalue()), DEEP)


def test_tiff_in_which_white_is_zero() -> None:
    file = tiff(DEEP[..., 0], photometric="miniswhite")
    np.testing.assert_array_equal(read_pixels(file)[..., 0], 65535 - DEEP[..., 0])


@pytest.mark.parametrize(
    ("dtype", "full"), [(np.int16, 2**15 - 1), (np.uint32, 2**32 - 1), (np.int32, 2**31 - 1), (np.int32, 2**16 - 1)]
)
def test_integers_of_other_types_span_their_range(dtype: type, full: int) -> None:
    """Integers of 32 bits that fit into 16 bits are read as 16 bits, since many programs store 16 bits in this way."""
    values = (np.linspace(0, 1, 64).reshape(8, 8) * full).astype(dtype)
    result = read_map(tiff(values), "L").astype(float)
    assert np.abs(result - np.linspace(0, 255, 64).reshape(8, 8)).max() <= 0.51


def test_negative_integers_become_zero_with_a_warning() -> None:
    values = np.array([[-32768, -1], [0, 32767]], np.int16)
    with pytest.warns(UserWarning, match="below 0"):
        assert read_map(tiff(values), "L").tolist() == [[0, 0], [0, 255]]


def test_cmyk_and_orientation_of_jpeg() -> None:
    image = Image.new("CMYK", (16, 8), (0, 255, 255, 0))
    red = read_map(encoded(image, format="jpeg"), "RGB")
    assert red.shape == (8, 16, 3) and np.abs(red - np.array([255, 0, 0])).max() < 8
    exif = Image.Exif()
    exif[0x0112] = 6  # a quarter turn, which glTF ignores
    turned = encoded(Image.new("RGB", (16, 8), "red"), format="jpeg", exif=exif)
    assert read_map(turned, "RGB").shape == (8, 16, 3)


@pytest.mark.parametrize("kind", ["WEBP", "BMP", "GIF", "PPM", "TGA", "DDS"])
def test_other_formats(tmp_path: Path, kind: str) -> None:
    file = tmp_path / f"a.{kind.lower()}"
    Image.fromarray(np.full((4, 4, 3), (255, 0, 0), np.uint8)).save(
        file, format=kind, **({"lossless": True} if kind == "WEBP" else {})
    )
    assert read_map(file, "RGB")[1, 2].tolist() == [255, 0, 0]


def test_a_wrong_extension_does_not_matter(tmp_path: Path) -> None:
    file = tmp_path / "a.jpg"
    file.write_bytes(png(SHALLOW[..., :3]))
    np.testing.assert_array_equal(read_map(file, "RGB"), SHALLOW[..., :3])


def header_only(width: int, height: int, depth: int = 8, kind: int = 2) -> bytes:
    """Make a PNG with a size in its header and almost no pixels."""
    head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(bytes(99))), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(name, content) for name, content in chunks)


@pytest.mark.parametrize(("width", "height"), [(9000, 9000), (MAX_SIDE + 1, 1), (1, 40000), (60000, 60000)])
def test_a_large_image_is_refused_before_decoding(tmp_path: Path, width: int, height: int) -> None:
    wide = io.BytesIO(
        b"II*\0\x08\0\0\0\x04\0"
        + struct.pack("<HHIIHHIIHHIIHHII", 256, 4, 1, width, 257, 4, 1, height, 258, 3, 1, 16, 273, 4, 1, 8)
        + bytes(4)
    )
    for data in (header_only(width, height), header_only(width, height, 16, 6), wide.getvalue()):
        tracemalloc.start()
        with (
            warnings.catch_warnings(),
            pytest.raises(InputError, match=rf"^the image has {width} x {height} pixels; at most 8192"),
        ):
            warnings.simplefilter("error")
            read_map(data, "RGB")
        assert tracemalloc.get_traced_memory()[1] < 10e6
        tracemalloc.stop()
    (tmp_path / "a.png").write_bytes(header_only(width, height))
    with pytest.raises(InputError, match=rf"a\.png: the image has {width} x"):
        read_map(tmp_path / "a.png", "RGB")


def test_unreadable_images_give_one_line(tmp_path: Path) -> None:
    whole = png(SHALLOW)
    deep = png(DEEP)
    files = {
        "cut.png": (whole[: len(whole) // 2], "damaged, or not an image"),
        "deep.png": (deep[: len(deep) // 2], "damaged, or not an image"),
        "text.png": (b"hello", "damaged, or not an image"),
        "empty.png": (b"", "the file is empty"),
        "claims.png": (header_only(4000, 4000), "damaged, or not an image"),
        "a.eps": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "damaged, or not an image"),
        "a.exr": (b"\x76\x2f\x31\x01" + bytes(50), "not be a texture"),
        "a.hdr": (b"#?RADIANCE\n", "not be a texture"),
        "cut.tif": (tiff(DEEP[..., 0])[:200], "damaged, or not an image"),
        "cut.jpg": (encoded(Image.fromarray(SHALLOW[..., :3]), format="jpeg")[:300], "damaged, or not an image"),
    }
    for name, (content, message) in files.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=message) as raised:
            read_map(tmp_path / name, "RGB")
        assert str(raised.value).startswith(f"{tmp_path / name}: ") and "\n" not in str(raised.value)


def test_pipes_and_folders_are_refused_unopened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")  # opening it would block
    (tmp_path / "link.png").symlink_to("/dev/zero")
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "lost.png").symlink_to(tmp_path / "nowhere")
    for name, message in {
        "pipe.png": "not a regular file",
        "link.png": "not a regular file",
        "folder.png": "a folder",
        "lost.png": "no such file",
        "\0.png": "not the name of a file",
        "a" * 300: "cannot be read",
    }.items():
        with pytest.raises(InputError, match=message):
            read_map(tmp_path / name, "RGB")


def test_damaged_bytes_give_one_line_or_a_picture() -> None:
    """In each of 100 files, a few bytes are changed or missing."""
    whole = [
        png(DEEP),
        png(SHALLOW[..., :3], interlaced=True),
        tiff(DEEP[..., :3]),
        tiff(np.linspace(0, 1, 60, dtype=np.float32).reshape(6, 10)),
        encoded(Image.fromarray(SHALLOW[..., :3]), format="jpeg"),
        encoded(Image.fromarray(SHALLOW[..., 0]), format="tiff", compression="tiff_lzw"),
        encoded(Image.fromarray(SHALLOW), format="webp"),
        encoded(Image.fromarray(SHALLOW[..., :3]).quantize(8), format="gif"),
    ]
    random = np.random.default_rng(7)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for i in range(100):
            data = bytearray(whole[i % len(whole)])
            for at in random.integers(0, min(len(data), 200) if i % 2 else len(data), 4):
                data[at] = random.integers(256)
            cut = len(data) if i % 3 else int(random.integers(len(data)))
            try:
                result = read_map(bytes(data[:cut]), "RGBA")
            except InputError as error:
                assert "\n" not in str(error) and len(str(error)) < 200
            else:
                assert result.dtype == np.uint8 and result.shape[2] == 4
