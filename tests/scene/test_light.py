"""Lights and what is wrong with them; environments from Radiance and OpenEXR files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene import DirectionalLight, EnvironmentLight, PointLight, RectLight, SphereLight

RECT: dict[str, Any] = {
    "position": (0, 9, 0),
    "direction": (0, -1, 0),
    "up": (0, 0, 1),
    "width": 2,
    "height": 3,
    "radiance": (1, 1, 1),
}


@pytest.mark.parametrize(
    ("kind", "fields", "message"),
    [
        (DirectionalLight, {"direction": (0, 0, 0), "irradiance": (1, 1, 1)}, "direction must not be the zero vector"),
        (
            DirectionalLight,
            {"direction": (0, 0, 1), "irradiance": (1, -1, 1)},
            "irradiance must be .* from 0 to 1e\\+09 \\(W/m\\^2\\)",
        ),
        (DirectionalLight, {"direction": (0, math.nan, 1), "irradiance": (1, 1, 1)}, "direction must be three numbers"),
        (PointLight, {"position": (0, 0), "intensity": (1, 1, 1)}, "position must be three numbers"),
        (PointLight, {"position": (0, 0, 0), "intensity": 1}, "intensity must be three numbers"),
        (RectLight, {**RECT, "up": (0, 5, 0)}, "up must not be parallel to direction"),
        (RectLight, {**RECT, "width": 0}, "width must be from 1e-06 to 1e\\+13 \\(mm\\), not 0"),
        (RectLight, {**RECT, "height": True}, "height must be from 1e-06"),
        (RectLight, {**RECT, "samples": 0}, "samples must be a whole number from 1 to 256, not 0"),
        (RectLight, {**RECT, "samples": 257}, "samples must be a whole number"),
        (SphereLight, {"position": (0, 0, 0), "radius": -1, "radiance": (1, 1, 1)}, "radius must be from 1e-06"),
        (
            SphereLight,
            {"position": (0, 0, 0), "radius": 1, "radiance": (1, 1, 1), "samples": 2.5},
            "samples must be a whole number",
        ),
        (EnvironmentLight, {"radiance": (1, 1)}, "radiance must be three numbers"),
        (EnvironmentLight, {"rotation": math.inf}, "rotation must be from .*degrees"),
        (EnvironmentLight, {"file": 3}, "file must be the path"),
    ],
)
def test_a_field_out_of_range_is_named(kind: type, fields: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        kind(**fields)


def test_lists_become_tuples_of_float() -> None:
    assert RectLight(**{**RECT, "direction": [0, -1, 0]}) == RectLight(**RECT)
    assert RectLight(**RECT).samples == 16


def test_constant_environment_is_one_pixel() -> None:
    pixels = EnvironmentLight((0.5, 1.0, 2.0)).pixels()
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, [[[0.5, 1.0, 2.0]]])


# Mantissas and one exponent per pixel; radiance is mantissa x 2^(exponent - 136).
RGBE = np.random.default_rng(1).integers(0, 256, (6, 12, 4), np.uint8)
RGBE[..., 3] = 120 + RGBE[..., 3] % 20
RGBE[2, :, :3] = 77  # a row that consists of runs
RGBE[3, 4] = (9, 9, 9, 0)  # an exponent of 0 is black, whatever the mantissa
EXPECTED = np.where(RGBE[..., 3:] == 0, 0.0, RGBE[..., :3] * 2.0 ** (RGBE[..., 3:].astype(float) - 136))


def run_length(rgbe: np.ndarray) -> bytes:
    """The adaptive encoding: per row a marker, then each channel as runs (128 + n, value) and literals (n, values)."""
    out = bytearray()
    for row in rgbe:
        out += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for plane in row.T:
            if (plane == plane[0]).all():
                out += bytes([128 + len(plane), plane[0]])
            else:
                out += bytes([5, *plane[:5], len(plane) - 5, *plane[5:]])
    return bytes(out)


def hdr(data: bytes, head: str = "FORMAT=32-bit_rle_rgbe\n", size: str = "-Y 6 +X 12") -> bytes:
    return f"#?RADIANCE\n{head}\n{size}\n".encode() + data


@pytest.mark.parametrize("data", [run_length(RGBE), RGBE.tobytes()], ids=["run-length", "flat"])
def test_radiance_file(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / "sky.HDR"
    file.write_bytes(hdr(data))
    pixels = EnvironmentLight((1, 2, 3), str(file)).pixels()
    assert pixels.shape == (6, 12, 3) and pixels.dtype == np.float32
    np.testing.assert_allclose(pixels, EXPECTED * [1, 2, 3], rtol=1e-6)


def test_radiance_file_with_exposure_and_turned_rows(tmp_path: Path) -> None:
    file = tmp_path / "sky.hdr"
    file.write_bytes(hdr(run_length(RGBE), "EXPOSURE=4\nEXPOSURE= .5\n", "+Y 6 -X 12"))
    np.testing.assert_allclose(EnvironmentLight(file=str(file)).pixels(), EXPECTED[::-1, ::-1] / 2, rtol=1e-6)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"\x89PNG\r\n", "not a Radiance .hdr file"),
        (hdr(run_length(RGBE)[:-3]), "damaged or truncated in row 5 of 6"),
        (hdr(run_length(RGBE)[:100]), "damaged or truncated in row 1 of 6"),
        (hdr(run_length(RGBE).replace(b"\2\2\0\x0c", b"\2\2\0\x0d")), "damaged or truncated in row 0 of 6"),
        (hdr(run_length(RGBE)[:60] + b"\0" * 400), "damaged or truncated in row 1 of 6"),
        (hdr(RGBE.tobytes()[:-1]), "truncated"),
        (hdr(RGBE.tobytes(), size="+X 12 -Y 6"), "orientation"),
        (hdr(RGBE.tobytes(), size="-Y 0 +X 12"), "the image is empty"),
        (hdr(RGBE.tobytes(), head="FORMAT=32-bit_rle_xyze\n"), "XYZ"),
    ],
)
def test_a_damaged_radiance_file_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "sky.hdr"
    file.write_bytes(content)
    with pytest.raises(InputError, match=message) as raised:
        EnvironmentLight(file=str(file)).pixels()
    assert str(raised.value).startswith(f"{file}: ") and "\n" not in str(raised.value)


def write_exr(file: Path, channels: dict[str, np.ndarray], compression: str = "DWAB") -> None:
    openexr = pytest.importorskip("OpenEXR")
    header = {"compression": getattr(openexr, f"{compression}_COMPRESSION"), "type": openexr.scanlineimage}
    openexr.File(header, channels).write(str(file))


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_openexr_file(tmp_path: Path, dtype: type) -> None:
    file = tmp_path / "sky.exr"
    rgb = np.linspace(0.25, 8, 32 * 64 * 3).reshape(32, 64, 3).astype(dtype)
    write_exr(file, {"RGB": rgb})
    pixels = EnvironmentLight((2, 2, 2), str(file)).pixels()
    assert pixels.dtype == np.float32
    np.testing.assert_allclose(pixels, 2 * rgb.astype(np.float32), rtol=0.02)  # DWAB is lossy


def test_openexr_channels_are_found_by_name(tmp_path: Path) -> None:
    plane = np.arange(12, dtype=np.float32).reshape(3, 4)
    write_exr(tmp_path / "rgba.exr", {"RGBA": np.dstack([plane, plane + 1, plane + 2, plane])}, "ZIP")
    write_exr(tmp_path / "y.exr", {"Y": plane}, "ZIP")
    write_exr(tmp_path / "depth.exr", {"Z": plane}, "ZIP")
    np.testing.assert_array_equal(
        EnvironmentLight(file=str(tmp_path / "rgba.exr")).pixels(), np.dstack([plane, plane + 1, plane + 2])
    )
    np.testing.assert_array_equal(EnvironmentLight(file=str(tmp_path / "y.exr")).pixels(), np.dstack([plane] * 3))
    with pytest.raises(InputError, match=r"depth\.exr: no R, G and B channels \(it has Z\)"):
        EnvironmentLight(file=str(tmp_path / "depth.exr")).pixels()


def test_negative_radiance_is_clamped_and_nan_refused(tmp_path: Path) -> None:
    file = tmp_path / "sky.exr"
    rgb = np.full((4, 8, 3), 0.5, np.float32)
    rgb[1, 2] = -3
    write_exr(file, {"RGB": rgb}, "ZIP")
    assert EnvironmentLight(file=str(file)).pixels()[1, 2].tolist() == [0, 0, 0]
    rgb[3, 4, 1], rgb[0, 0, 2] = np.nan, np.inf
    write_exr(file, {"RGB": rgb}, "ZIP")
    with pytest.raises(InputError, match=r"sky\.exr: 2 pixels are not finite"):
        EnvironmentLight(file=str(file)).pixels()


def test_a_damaged_openexr_file_is_named_and_nothing_else_printed(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    file = tmp_path / "sky.exr"
    write_exr(file, {"RGB": np.random.default_rng(2).random((64, 128, 3), np.float32)})
    whole = file.read_bytes()
    for content in (whole[: len(whole) // 2], whole[:-20], b"not an image", whole[:2000] + bytes(len(whole) - 2000)):
        file.write_bytes(content)
        with pytest.raises(InputError, match=r"sky\.exr: damaged, or not an OpenEXR file$"):
            EnvironmentLight(file=str(file)).pixels()
    assert capfd.readouterr() == ("", ""), "what the library prints would end up in --json"


@pytest.mark.parametrize(
    ("file", "message"), [("no.hdr", "no such file"), ("sky.png", "must be a .hdr or .exr file"), (".", "must be a")]
)
def test_a_file_that_is_not_there_or_of_another_kind(tmp_path: Path, file: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        EnvironmentLight(file=str(tmp_path / file)).pixels()


@pytest.mark.parametrize("name", ["studio.exr", "forest.exr", "chinese_garden_1k.hdr", "brown_photostudio_02_1k.hdr"])
def test_real_light_probes(data: Path, name: str) -> None:
    pixels = EnvironmentLight(file=str(data / "env" / name)).pixels()
    assert pixels.shape == (512, 1024, 3)
    assert np.isfinite(pixels).all() and pixels.min() >= 0
    assert 0.1 < pixels.mean() < 2 and pixels.max() > 50, "a probe has bright lamps or a sun"
