"""Environment images of other programs: suns, softboxes, unusual headers and channels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wgsss import render
from wgsss.cli import main
from wgsss.errors import InputError
from wgsss.scene import DirectionalLight, EnvironmentLight, OrthographicCamera, Scene, load_scene
from wgsss.scene.images import read_radiance

Array = np.ndarray[Any, Any]

BLACK_BALL = {"preset": "marble", "base_color": [0.8, 0.8, 0.8], "specular": 0.0}
FROM_FRONT = OrthographicCamera((0, 0, 500), (0, 0, 0), height=42)


def lit(*lights: Any) -> Scene:
    """Make a scene of a ball with a camera and lights."""
    return load_scene("sphere", vertices=4000, lights=lights, material=BLACK_BALL, camera=FROM_FRONT)


def write_exr(path: Path, channels: dict[str, Array], **header: Any) -> str:
    import OpenEXR

    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}, channels).write(
        str(path)
    )
    return str(path)


def write_hdr(path: Path, rows: bytes, width: int, height: int, header: str = "") -> str:
    path.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{header}\n-Y {height} +X {width}\n".encode() + rows)
    return str(path)


# --- light -----------------------------------------------------------------------------------------------------------


def test_a_sun_of_one_texel_is_like_a_directional_light(tmp_path: Path) -> None:
    """One texel of 1250 W/(m^2 sr) on black lights like a directional light from its centre.

    Its solid angle is that between the borders of its row.
    """
    height, width, row, column = 64, 128, 16, 64 + 8
    image = np.zeros((height, width, 3), np.float32)
    image[row, column] = 1250
    path = write_exr(tmp_path / "sun.exr", {"RGB": image})
    polar, turn = np.pi * (row + 0.5) / height, 2 * np.pi * ((column + 0.5) / width - 0.5)
    solid = 2 * np.pi / width * (np.cos(np.pi * row / height) - np.cos(np.pi * (row + 1) / height))
    towards = (np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn))
    travels = (float(towards[0]), float(-towards[1]), float(towards[2]))  # half a turn about y, then reversed
    by_image = render(lit(EnvironmentLight(file=path, rotation=180.0)), "lambert", (64, 64)).pixels
    by_sun = render(lit(DirectionalLight(travels, (1250 * solid,) * 3)), "lambert", (64, 64)).pixels
    bright = by_sun[..., 0] > 0.2 * by_sun[..., 0].max()
    assert bright.mean() > 0.1
    assert np.abs(by_image[bright][:, :3] / by_sun[bright][:, :3] - 1).max() < 0.02


def test_two_softboxes_light_a_ball_smoothly(tmp_path: Path) -> None:
    image = np.zeros((64, 128, 3), np.float32)
    image[10:22, 20:30], image[10:22, 90:96] = 30.0, 15.0
    path = write_exr(tmp_path / "boxes.exr", {"RGB": image})
    pixels = render(lit(EnvironmentLight(file=path)), "lambert", (64, 64)).pixels[..., :3].mean(axis=2)
    inside = np.hypot(*np.mgrid[-31.5:32, -31.5:32]) < 28
    bends = np.abs(pixels[:, 2:] - 2 * pixels[:, 1:-1] + pixels[:, :-2])[inside[:, 1:-1]]
    assert pixels[inside].max() > 0
    assert np.quantile(bends, 0.98) < 0.006 * pixels[inside].max(), "the brightness is smooth"


# --- channels of EXR files -------------------------------------------------------------------------------------------

SKY = np.random.default_rng(2).uniform(0.2, 1.0, (8, 16, 3)).astype(np.float32)


def test_layers_are_chosen_by_the_names_of_other_programs(tmp_path: Path) -> None:
    planes = {name: np.ascontiguousarray(SKY[..., i]) for i, name in enumerate("RGB")}
    for prefix in ("", "ViewLayer.Combined.", "RenderLayer.", "rgba."):
        path = write_exr(tmp_path / "sky.exr", {f"{prefix}{name}": plane for name, plane in planes.items()})
        assert read_radiance(path) == pytest.approx(SKY), prefix


def test_channels_of_mixed_types(tmp_path: Path) -> None:
    planes = {"R": SKY[..., 0].astype(np.float16), "G": SKY[..., 1].copy(), "B": SKY[..., 2].astype(np.float16)}
    path = write_exr(tmp_path / "sky.exr", planes)
    assert read_radiance(path) == pytest.approx(SKY, rel=1e-3)


def test_luminance_and_chroma_become_colours(tmp_path: Path) -> None:
    """Y, RY and BY, not subsampled, give the original colours."""
    red, green, blue = np.moveaxis(SKY, 2, 0)
    Y = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    planes = {"Y": Y, "RY": (red - Y) / Y, "BY": (blue - Y) / Y}
    path = write_exr(tmp_path / "sky.exr", {name: np.ascontiguousarray(p, np.float32) for name, p in planes.items()})
    assert read_radiance(path) == pytest.approx(SKY, rel=2e-3, abs=1e-3)


def test_chroma_that_is_not_finite_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Chroma is not finite after a division by a luminance of 0."""
    planes = {name: SKY[..., i].copy() for i, name in enumerate(("Y", "RY", "BY"))}
    planes["RY"][2, 3] = np.nan
    path = write_exr(tmp_path / "sky.exr", planes)
    with pytest.raises(InputError, match=r"sky\.exr: .*not finite"):
        read_radiance(path)
    assert main(["info", path]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "sky.exr" in err


# --- HDR files -------------------------------------------------------------------------------------------------------


def rgbe(pixels: Array) -> Array:
    """Encode pixels with shared exponents: uint8 (H, W, 4)."""
    top = pixels.max(axis=2, keepdims=True)
    exponent = np.floor(np.log2(top)) + 1
    shared = np.concatenate([np.floor(pixels / 2.0**exponent * 256), exponent + 128], axis=2)
    return shared.astype(np.uint8)


@pytest.mark.parametrize("first", [(2, 2), (1, 1)])
def test_flat_rows_may_begin_like_runs(tmp_path: Path, first: tuple[int, int]) -> None:
    """A row that begins with 2 2 is flat if the width of the row does not follow. 1 1 1 begins a run in old files."""
    flat = rgbe(SKY)
    flat[:, 0, :2] = first
    flat[:, 0, 2] = 200
    path = write_hdr(tmp_path / "sky.hdr", flat.tobytes(), 16, 8)
    expected = flat[..., :3].astype(float) * 2.0 ** (flat[..., 3:].astype(float) - 136)
    assert read_radiance(path) == pytest.approx(expected, rel=0.01, abs=3e-3)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("EXPOSURE=1.0.0\n", "EXPOSURE=1.0.0"),
        ("EXPOSURE=\n", "EXPOSURE"),
        ("EXPOSURE=-2\n", "EXPOSURE=-2"),
        ("EXPOSURE=nan\n", "EXPOSURE=nan"),
        ("EXPOSURE=1e-300\nEXPOSURE=1e-300\n", "EXPOSURE"),
        ("COLORCORR=1 1\n", "COLORCORR"),
    ],
)
def test_a_malformed_header_is_one_line(
    tmp_path: Path, header: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_hdr(tmp_path / "sky.hdr", rgbe(SKY).tobytes(), 16, 8, header)
    with pytest.raises(InputError) as raised:
        read_radiance(path)
    assert str(raised.value).startswith(f"{path}: ") and words in str(raised.value)
    sky = f'{{kind = "environment", file = "{path}"}}'
    assert main(["render", "sphere", "--vertices", "500", "--light", sky, "-o", str(tmp_path / "a.png")]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "Traceback" not in err
    assert not (tmp_path / "a.png").exists()


def test_exposures_multiply(tmp_path: Path) -> None:
    path = write_hdr(tmp_path / "sky.hdr", rgbe(SKY).tobytes(), 16, 8, "EXPOSURE=2\nEXPOSURE= 4.0 \n")
    assert read_radiance(path) == pytest.approx(SKY / 8, rel=0.02)


def test_a_huge_image_is_refused_before_decoding(tmp_path: Path) -> None:
    path = write_hdr(tmp_path / "sky.hdr", b"\2\2\2\2" * 50, 999999, 32767)
    with pytest.raises(InputError, match=r"sky\.hdr: .*999999 x 32767"):
        read_radiance(path)


def test_a_sky_that_is_not_twice_as_wide_as_high_is_refused(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "sky.exr", {"RGB": np.ones((8, 8, 3), np.float32)})
    with pytest.raises(InputError, match=r"sky\.exr: .*8 x 8"):
        EnvironmentLight(file=path).pixels()
