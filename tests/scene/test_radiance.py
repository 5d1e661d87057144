"""Radiance from .hdr and .exr files of every kind, and the shapes of skies."""

from __future__ import annotations

import os
import struct
import tracemalloc
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from pictures import chromaticities, exr, hdr, run_length

from wgsss.errors import InputError
from wgsss.scene.images import read_radiance, read_sky

# Mantissas and one exponent per pixel; radiance is mantissa x 2^(exponent - 136).
RGBE = np.random.default_rng(1).integers(128, 256, (6, 12, 4), np.uint8)
RGBE[..., 3] = 120 + RGBE[..., 3] % 20
RGBE[2, :, :3] = 177  # a row that consists of runs
RGBE[3, 4] = (9, 9, 9, 0)  # an exponent of 0 is black for any mantissa
EXPECTED = np.where(RGBE[..., 3:] == 0, 0.0, RGBE[..., :3] * 2.0 ** (RGBE[..., 3:].astype(float) - 136))

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
RGB = np.linspace(0.1, 5, 4 * 8 * 3).reshape(4, 8, 3).astype(np.float32)


def read(path: Path, content: bytes) -> np.ndarray:
    path.write_bytes(content)
    return read_radiance(path)


def named(rgb: np.ndarray, layer: str = "", names: str = "RGB") -> dict[str, np.ndarray]:
    return {f"{layer}.{c}" if layer else c: rgb[..., i] for i, c in enumerate(names)}


def old_runs(rgbe: np.ndarray) -> bytes:
    """Encode in the old way: 1, 1, 1, n repeats the pixel before; n of each further run has 256 times the weight."""
    flat, out, i = rgbe.reshape(-1, 4), b"", 0
    while i < len(flat):
        n = 1
        while i + n < len(flat) and (flat[i + n] == flat[i]).all():
            n += 1
        out += flat[i].tobytes()
        count = n - 1
        while count:
            out += bytes([1, 1, 1, count & 255])
            count >>= 8
        i += n
    return out


# ---- Radiance


@pytest.mark.parametrize("data", [run_length(RGBE), RGBE.tobytes(), old_runs(RGBE)], ids=["new", "flat", "old"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_radiance_file(tmp_path: Path, data: bytes, end: str) -> None:
    pixels = read(tmp_path / "sky.HDR", hdr(data, end=end))
    assert pixels.dtype == np.float32
    np.testing.assert_allclose(pixels, EXPECTED, rtol=1e-6)


def test_old_runs_of_more_than_256(tmp_path: Path) -> None:
    rgbe = np.empty((40, 80, 4), np.uint8)
    rgbe[:], rgbe[-1, -1] = (200, 130, 7, 128), (255, 1, 2, 129)
    data = old_runs(rgbe)
    assert len(data) == 4 * 4
    pixels = read(tmp_path / "sky.hdr", hdr(data, size="-Y 40 +X 80"))
    assert pixels[0, 0].tolist() == pixels[39, 78].tolist() == [200 / 256, 130 / 256, 7 / 256]
    assert pixels[39, 79, 0] == 255 / 128


@pytest.mark.parametrize("row", [0, 3])
def test_flat_pixels_may_look_like_a_run_length_marker(tmp_path: Path, row: int) -> None:
    rgbe = RGBE.copy()
    rgbe[row, 0] = (2, 2, 0, 12)
    pixels = read(tmp_path / "sky.hdr", hdr(rgbe.tobytes()))
    np.testing.assert_allclose(pixels[row, 1:], EXPECTED[row, 1:], rtol=1e-6)
    np.testing.assert_allclose(pixels[row, 0], np.array([2, 2, 0]) * 2.0 ** (12 - 136))


@pytest.mark.parametrize("first", "+-")
@pytest.mark.parametrize("second", "+-")
@pytest.mark.parametrize("columns", [False, True])
def test_orientation(tmp_path: Path, first: str, second: str, columns: bool) -> None:
    """Lines run along the second axis. With +Y, lines go up; with -X, pixels go to the left."""
    size = f"{first}X 6 {second}Y 12" if columns else f"{first}Y 6 {second}X 12"
    pixels = read(tmp_path / "sky.hdr", hdr(run_length(RGBE), size=size))
    expected = EXPECTED.transpose(1, 0, 2) if columns else EXPECTED
    x, y = (first, second) if columns else (second, first)
    expected = expected[:: 1 if y == "-" else -1, :: 1 if x == "+" else -1]
    np.testing.assert_allclose(pixels, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("head", "factor"),
    [
        ("EXPOSURE=4\nEXPOSURE= .5\n", 0.5),
        ("EXPOSURE=  2e0 \n# EXPOSURE=9\n", 0.5),
        ("\tEXPOSURE=7\nVIEW= -vtl\nSOFTWARE=x=y\nCAPDATE=\n", 1.0),  # an indented line describes another file
        ("COLORCORR=1 2 4\n", (1, 1 / 2, 1 / 4)),
        ("COLORCORR=1 2 4\nEXPOSURE=2\nCOLORCORR=2 1 1\n", 1 / 4),
        ("GAMMA=1\nPRIMARIES=0 0 0 0 0 0 0 0\n", 1.0),
        (f"PRIMARIES={' '.join(map(str, REC709))}\n", 1.0),
    ],
)
def test_variables_of_the_header(tmp_path: Path, head: str, factor: Any) -> None:
    if "COLORCORR=2" in head:
        factor = np.array([1 / 4, 1 / 4, 1 / 8])
    pixels = read(tmp_path / "sky.hdr", hdr(run_length(RGBE), head))
    np.testing.assert_allclose(pixels, EXPECTED * factor, rtol=1e-6)


def test_gamma_is_noted(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"sky\.hdr: GAMMA=2\.2 is not applied"):
        read(tmp_path / "sky.hdr", hdr(run_length(RGBE), "GAMMA=2.2\n"))


def test_xyz_of_radiance_is_photometric_about_equal_energy(tmp_path: Path) -> None:
    """The luminous efficacy is 179 lm/W, and X = Y = Z is neutral."""
    rgbe = np.full((6, 12, 4), (179, 179, 179, 136), np.uint8)
    pixels = read(tmp_path / "sky.hdr", hdr(rgbe.tobytes(), "FORMAT=32-bit_rle_xyze\n"))
    np.testing.assert_allclose(pixels, 1.0, rtol=2e-4)
    rgbe[..., 0] = 220  # a larger X is redder
    pixels = read(tmp_path / "sky.hdr", hdr(rgbe.tobytes(), "FORMAT=32-bit_rle_xyze\n"))
    assert pixels[0, 0, 0] > 1.5 and pixels[0, 0, 1] < 1.0


def test_other_primaries_keep_white_and_widen_red(tmp_path: Path) -> None:
    head = f"PRIMARIES={' '.join(map(str, REC2020))}\n"
    rgbe = np.full((6, 12, 4), (128, 128, 128, 129), np.uint8)
    np.testing.assert_allclose(read(tmp_path / "sky.hdr", hdr(rgbe.tobytes(), head)), 1.0, rtol=1e-5)
    rgbe[..., 1:3] = 0
    np.testing.assert_allclose(read(tmp_path / "sky.hdr", hdr(rgbe.tobytes(), head))[0, 0], [1.6605, 0, 0], atol=1e-3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"\x89PNG\r\n", "not a Radiance .hdr file"),
        (b"#?RADIANCE\n" + b"x" * 100_000, "not a Radiance .hdr file"),
        (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 6", "expected the size of the image, not '-Y 6'"),
        (hdr(run_length(RGBE)[:-3]), "damaged or truncated in row 5 of 6"),
        (hdr(run_length(RGBE)[:100]), "damaged or truncated in row 1 of 6"),
        (hdr(run_length(RGBE).replace(b"\2\2\0\x0c", b"\2\2\0\x0d")), "damaged or truncated in row 0 of 6"),
        (hdr(run_length(RGBE)[:60] + b"\0" * 400), "damaged or truncated in row 1 of 6"),
        (hdr(RGBE.tobytes()[:-1]), "truncated: it does not contain the 72 pixels"),
        (hdr(old_runs(RGBE)[:-4]), "truncated"),
        (hdr(bytes([1, 1, 1, 72]) + RGBE.tobytes()), "truncated"),  # a run without a pixel before it
        (hdr(RGBE[0, 0].tobytes() + bytes([1, 1, 1, 255] * 9)), "truncated"),  # a run beyond the image
        (hdr(b"", size="-Y 0 +X 12"), "the image is empty"),
        (hdr(b"", size="-Y 6 +Y 12"), "expected the size of the image"),
        (hdr(b"", size="-Y six +X 12"), "expected the size of the image"),
        (hdr(b"", head="FORMAT=32-bit_rle_spectral\n"), "FORMAT=32-bit_rle_spectral is not supported"),
        (hdr(b"", size="-Y 999999 +X 32767"), "32767 x 999999 pixels; at most 16384"),
        (hdr(b"", size="-Y 99999999999 +X 9"), "expected the size of the image"),
        *(
            (hdr(RGBE.tobytes(), head=f"EXPOSURE={value}\n"), f"EXPOSURE={value} is not a number above 0")
            for value in ("1.0.0", "0", "-1", "inf", "nan", "1 2", "", "one")
        ),
        (hdr(RGBE.tobytes(), head="EXPOSURE=1e300\n" * 2), "is out of range"),
        (hdr(RGBE.tobytes(), head="EXPOSURE=1e-300\n" * 2), "is out of range"),
        (hdr(RGBE.tobytes(), head="EXPOSURE=1e-40\n"), "pixels are not finite"),
        (hdr(RGBE.tobytes(), head="COLORCORR=1 1\n"), "COLORCORR=1 1 is not 3 numbers above 0"),
        (hdr(RGBE.tobytes(), head="PRIMARIES=1 1\n"), "PRIMARIES=1 1 is not 8 numbers"),
        (hdr(RGBE.tobytes(), head="PRIMARIES=1 0 1 0 1 0 1 0\n"), "do not span a colour space"),
    ],
)
def test_a_damaged_radiance_file_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "sky.hdr"
    file.write_bytes(content)
    with warnings.catch_warnings(), pytest.raises(InputError, match=message.replace(".", r"\.")) as raised:
        warnings.simplefilter("error")
        read_radiance(file)
    assert str(raised.value).startswith(f"{file}: ") and "\n" not in str(raised.value)


# ---- OpenEXR


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "DWAA", "DWAB"])
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("tiled", [False, True])
def test_openexr_file(tmp_path: Path, compression: str, dtype: type, tiled: bool) -> None:
    header: dict[str, Any] = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION")}
    header |= (
        {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()} if tiled else {"type": OpenEXR.scanlineimage}
    )
    rgb = np.linspace(0.25, 8, 32 * 64 * 3).reshape(32, 64, 3).astype(dtype)
    with OpenEXR.File(header, {"RGB": rgb}) as file:
        file.write(str(tmp_path / "sky.exr"))
    np.testing.assert_allclose(read_radiance(tmp_path / "sky.exr"), rgb.astype(np.float32), rtol=0.02)  # DWA is lossy


@pytest.mark.parametrize(
    "channels",
    [
        named(RGB),
        {**named(RGB), "A": RGB[..., 0], "Z": RGB[..., 1]},
        named(RGB, names="rgb"),
        {**named(RGB, "ViewLayer.Combined"), **named(RGB + 9, "ViewLayer.DiffDir"), "ViewLayer.Depth.Z": RGB[..., 0]},
        {**named(RGB, "Composite.Combined"), **named(RGB + 9, "View Layer.Environment")},
        named(RGB, "View Layer.Environment"),
        {**named(RGB), **named(RGB + 9, "left"), **named(RGB + 9, "Combined")},
        {**named(RGB, "beauty"), **named(RGB + 9, "albedo"), **named(RGB + 9, "normal", "XYZ")},
        {**named(RGB, "Image"), "depth.Y": RGB[..., 0]},
    ],
    ids=lambda channels: " ".join(channels)[:40],
)
def test_the_picture_is_chosen_by_its_layer_name(tmp_path: Path, channels: dict[str, np.ndarray]) -> None:
    np.testing.assert_array_equal(read(tmp_path / "sky.exr", exr(channels)), RGB)


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        ({"Z": RGB[..., 0]}, r"no R, G and B channels \(it has Z\)"),
        ({"R": RGB[..., 0], "G": RGB[..., 0]}, r"no R, G and B channels \(it has G, R\)"),
        (
            {**named(RGB, "albedo"), **named(RGB, "light")},
            r"which of its pictures to read \(it has albedo\.B, .*light\.R\)",
        ),
        ({**named(RGB, "A.Combined"), **named(RGB, "B.Combined")}, "which of its pictures to read"),
        ({f"n{i:02}.Z": RGB[..., 0] for i in range(20)}, r"n11\.Z, …\)"),
    ],
)
def test_an_ambiguous_picture_is_an_error(tmp_path: Path, channels: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path / "sky.exr", exr(channels))


def test_luminance_alone_is_grey(tmp_path: Path) -> None:
    pixels = read(tmp_path / "sky.exr", exr({"Y": RGB[..., 0], "A": RGB[..., 1]}))
    np.testing.assert_array_equal(pixels, RGB[..., :1].repeat(3, axis=2))


@pytest.mark.parametrize("size", [(4, 8), (6, 12)])
def test_luminance_and_chroma_become_colours(tmp_path: Path, size: tuple[int, int]) -> None:
    """Chroma has values at even rows and columns only. Linear ramps are reproduced except at the border."""
    y, x = np.meshgrid(*(np.arange(n) / n for n in size), indexing="ij")
    RY, BY = 0.5 * x - 0.2, 0.3 * y
    Y = 1.0 + x * y
    red, blue = (RY + 1) * Y, (BY + 1) * Y
    green = (Y - 0.2126 * red - 0.0722 * blue) / 0.7152
    channels = {"Y": Y, "RY": RY[::2, ::2], "BY": BY[::2, ::2]}
    content = exr({k: v.astype(np.float32) for k, v in channels.items()}, sampling={"RY": 2, "BY": 2})
    pixels = read(tmp_path / "sky.exr", content)
    inner = slice(0, -1), slice(0, -1)
    np.testing.assert_allclose(pixels[inner], np.stack([red, green, blue], axis=-1)[inner], rtol=1e-3)
    assert np.isfinite(pixels).all()


def test_xyz_channels_are_converted(tmp_path: Path) -> None:
    white = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])
    pixels = np.broadcast_to(white, (4, 8, 3)).astype(np.float32)
    np.testing.assert_allclose(read(tmp_path / "sky.exr", exr(named(pixels, names="XYZ"))), 1.0, rtol=1e-5)


def test_channels_of_mixed_types(tmp_path: Path) -> None:
    channels = {"R": RGB[..., 0].astype(np.float16), "G": np.full((4, 8), 7, np.uint32), "B": RGB[..., 2]}
    pixels = read(tmp_path / "sky.exr", exr(channels))
    np.testing.assert_array_equal(pixels[..., 0], channels["R"].astype(np.float32))
    assert (pixels[..., 1] == 7).all()
    np.testing.assert_array_equal(pixels[..., 2], RGB[..., 2])


@pytest.mark.parametrize(
    ("data", "display"),
    [
        ((3, 2, 10, 5), (0, 0, 15, 7)),
        ((-2, -1, 5, 2), (0, 0, 5, 2)),
        ((0, 0, 7, 3), (2, 1, 5, 2)),
        ((20, 20, 27, 23), (0, 0, 7, 3)),
    ],
    ids=["smaller", "shifted", "larger", "beside"],
)
def test_a_data_window_is_placed_in_the_display_window(tmp_path: Path, data: Any, display: Any) -> None:
    pixels = read(tmp_path / "sky.exr", exr(named(RGB), data=data, display=display))
    expected = np.zeros((display[3] - display[1] + 1, display[2] - display[0] + 1, 3), np.float32)
    for y in range(display[1], display[3] + 1):
        for x in range(display[0], display[2] + 1):
            if data[0] <= x <= data[2] and data[1] <= y <= data[3]:
                expected[y - display[1], x - display[0]] = RGB[y - data[1], x - data[0]]
    np.testing.assert_array_equal(pixels, expected)


# Published matrices to linear Rec. 709, with Bradford adaptation.
@pytest.mark.parametrize(
    ("primaries", "matrix"),
    [
        (REC709, np.eye(3)),
        (REC2020, [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]),
        (AP1, [[1.7051, -0.6218, -0.0833], [-0.1303, 1.1408, -0.0105], [-0.0240, -0.1290, 1.1530]]),
        (AP0, [[2.5217, -1.1341, -0.3876], [-0.2765, 1.3727, -0.0962], [-0.0154, -0.1530, 1.1684]]),
    ],
    ids=["Rec. 709", "Rec. 2020", "ACES AP1", "ACES AP0"],
)
def test_chromaticities_are_converted(tmp_path: Path, primaries: tuple[float, ...], matrix: Any) -> None:
    content = exr(named(RGB), attributes=chromaticities(*primaries))
    expected = np.maximum(RGB @ np.array(matrix).T, 0.0)
    np.testing.assert_allclose(read(tmp_path / "sky.exr", content), expected, atol=2e-3)


def test_degenerate_chromaticities_are_refused(tmp_path: Path) -> None:
    for values in ((0.3,) * 8, (0.0,) * 8, (np.nan,) * 8, (*REC709[:6], 0.3, 0.0)):
        with pytest.raises(InputError, match="do not span a colour space"):
            read(tmp_path / "sky.exr", exr(named(RGB), attributes=chromaticities(*values)))


def test_file_partsof_a_file(tmp_path: Path) -> None:
    def write(*parts: tuple[str, dict[str, np.ndarray]]) -> np.ndarray:
        file_parts = [OpenEXR.Part({"name": name, "type": OpenEXR.scanlineimage}, channels) for name, channels in parts]
        with OpenEXR.File(file_parts) as file:
            file.write(str(tmp_path / "sky.exr"))
        return read_radiance(tmp_path / "sky.exr")

    planes = {k: np.ascontiguousarray(v) for k, v in named(RGB).items()}
    others = {k: v + 9 for k, v in planes.items()}
    depth = {"Z": planes["R"]}
    np.testing.assert_array_equal(write(("depth", depth), ("any", planes)), RGB)
    np.testing.assert_array_equal(write(("normal", others), ("ViewLayer.Combined", planes)), RGB)
    with pytest.raises(InputError, match=r"which of its pictures to read \(it has left: B, left: G, left: R, right: B"):
        write(("left", planes), ("right", others))


def test_deep_pixels_are_refused(tmp_path: Path) -> None:
    samples = np.empty((4, 8), object)
    for at in np.ndindex(4, 8):
        samples[at] = np.ones(2, np.float32)
    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.deepscanline}
    with OpenEXR.File(header, {"R": samples, "G": samples, "B": samples}) as file:
        file.write(str(tmp_path / "sky.exr"))
    with pytest.raises(InputError, match="deep images, with several samples per pixel, are not supported"):
        read_radiance(tmp_path / "sky.exr")


def test_negative_radiance_is_clamped_and_nan_refused(tmp_path: Path) -> None:
    rgb = np.full((4, 8, 3), 0.5, np.float32)
    rgb[1, 2] = -3
    assert read(tmp_path / "sky.exr", exr(named(rgb)))[1, 2].tolist() == [0, 0, 0]
    rgb[3, 4, 1], rgb[0, 0, 2] = np.nan, np.inf
    with pytest.raises(InputError, match=r"sky\.exr: 2 pixels are not finite"):
        read(tmp_path / "sky.exr", exr(named(rgb)))


def test_a_large_image_is_refused_before_decoding(tmp_path: Path) -> None:
    for window in ("data", "display"):
        content = exr(named(RGB), **{"data": (0, 0, 7, 3), window: (0, 0, 99_999, 9)} if window == "display" else {})
        if window == "data":
            content = content.replace(struct.pack("<4i", 0, 0, 7, 3), struct.pack("<4i", 0, 0, 99_999, 3))
        tracemalloc.start()
        with pytest.raises(InputError, match=r"100000 x .* at most 16384"):
            read(tmp_path / "sky.exr", content)
        assert tracemalloc.get_traced_memory()[1] < 10e6
        tracemalloc.stop()


def test_a_damaged_openexr_file_gives_one_line(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    file = tmp_path / "sky.exr"
    rgb = np.random.default_rng(2).random((64, 128, 3), np.float32)
    with OpenEXR.File(
        {"compression": OpenEXR.DWAB_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": rgb}
    ) as exr_file:
        exr_file.write(str(file))
    whole = file.read_bytes()
    for content in (whole[: len(whole) // 2], whole[:-20], b"not an image", whole[:2000] + bytes(len(whole) - 2000)):
        file.write_bytes(content)
        with pytest.raises(InputError, match=r"sky\.exr: damaged, or not an OpenEXR file$"):
            read_radiance(file)
    assert capfd.readouterr() == ("", ""), "the library prints nothing, which would break --json"


# ---- skies


@pytest.mark.parametrize("size", [(32, 64), (33, 65), (32, 63), (51, 101), (100, 198), (1, 1), (1, 2)])
def test_images_twice_as_wide_as_high_are_skies(tmp_path: Path, size: tuple[int, int]) -> None:
    (tmp_path / "sky.exr").write_bytes(exr(named(np.ones((*size, 3), np.float32))))
    assert read_sky(tmp_path / "sky.exr").shape[:2] == size


@pytest.mark.parametrize("size", [(64, 64), (64, 32), (30, 40), (10, 60), (60, 10), (32, 72)])
def test_images_of_other_shapes_are_not_skies(tmp_path: Path, size: tuple[int, int]) -> None:
    (tmp_path / "sky.exr").write_bytes(exr(named(np.ones((*size, 3), np.float32))))
    with pytest.raises(InputError, match=f"{size[1]} x {size[0]} pixels are not a sky"):
        read_sky(tmp_path / "sky.exr")


def test_a_cube_is_resampled_to_latitude_and_longitude(tmp_path: Path) -> None:
    """The faces are +x, -x, +y, -y, +z, -z. The centre of the sky is +z, with +x to its left, as seen from inside."""
    side = 16
    faces = np.zeros((6, side, side, 3), np.float32)
    faces[...] = np.arange(1, 7)[:, None, None, None]
    faces[4, :4, :, 1] = 9.0  # the upper rim of +z
    faces[4, :, -4:, 2] = 7.0  # the right rim of +z: towards -x
    cube = {"envmap": ("envmap", b"\1")}
    (tmp_path / "sky.exr").write_bytes(exr(named(faces.reshape(-1, side, 3)), attributes=cube))
    sky = read_sky(tmp_path / "sky.exr")
    assert sky.shape == (2 * side, 4 * side, 3)
    middle = side
    assert [sky[middle, round(u * 4 * side), 0] for u in (0.5, 0.25, 0.75, 0.02)] == [5, 1, 2, 6]
    assert sky[0].mean(axis=0)[0] == 3 and sky[-1].mean(axis=0)[0] == 4
    assert sky[middle - side // 2 + 2, 2 * side, 1] == 9 and sky[middle + 5, 2 * side, 1] == 5
    assert sky[middle, 2 * side + side // 2 - 2, 2] == 7 and sky[middle, 2 * side - side // 2 + 2, 2] == 5
    with pytest.raises(InputError, match="are not a cube"):
        (tmp_path / "sky.exr").write_bytes(exr(named(RGB), attributes=cube))
        read_sky(tmp_path / "sky.exr")


def test_pipes_and_folders_are_refused_unopened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.hdr")
    (tmp_path / "zero.exr").symlink_to("/dev/zero")
    for name in ("pipe.hdr", "zero.exr"):
        with pytest.raises(InputError, match="not a regular file"):
            read_radiance(tmp_path / name)


def test_the_extension_of_the_other_format_is_accepted(tmp_path: Path) -> None:
    np.testing.assert_array_equal(read(tmp_path / "sky.hdr", exr(named(RGB))), RGB)
    np.testing.assert_allclose(read(tmp_path / "sky.exr", hdr(run_length(RGBE))), EXPECTED, rtol=1e-6)


def test_damaged_bytes_give_one_line_or_a_sky(tmp_path: Path) -> None:
    """In each of 120 files, a few bytes are changed or missing."""
    rgb = np.random.default_rng(5).random((16, 32, 3), np.float32)
    whole = [(".hdr", hdr(run_length(RGBE), "EXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n")), (".hdr", hdr(old_runs(RGBE)))]
    for name in ("NO", "ZIP", "PIZ", "PXR24", "B44", "DWAA"):
        header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": rgb.astype(np.float16)}) as file:
            file.write(str(tmp_path / "whole.exr"))
        whole.append((".exr", (tmp_path / "whole.exr").read_bytes()))
    random = np.random.default_rng(11)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for i in range(120):
            extension, content = whole[i % len(whole)]
            data = bytearray(content)
            for at in random.integers(0, min(len(data), 400) if i % 2 else len(data), 4):
                data[at] = random.integers(256)
            cut = len(data) if i % 3 else int(random.integers(len(data)))
            (tmp_path / f"sky{extension}").write_bytes(data[:cut])
            try:
                pixels = read_sky(tmp_path / f"sky{extension}")
            except InputError as error:
                assert "\n" not in str(error)
            else:
                assert np.isfinite(pixels).all() and pixels.min() >= 0
