"""Lights and their validation; environments from files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import write_environment

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
            "irradiance must be .* from 0 to 1e\\+12 \\(W/m\\^2\\)",
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


def test_an_image_is_multiplied_by_the_radiance(tmp_path: Path) -> None:
    pixels = np.linspace(0, 2, 4 * 8 * 3).reshape(4, 8, 3).astype(np.float32)
    light = EnvironmentLight((1, 2, 3), write_environment(tmp_path / "sky.exr", pixels))
    radiance = light.pixels()
    assert radiance.dtype == np.float32
    np.testing.assert_allclose(radiance, pixels * [1, 2, 3], rtol=1e-6)


@pytest.mark.parametrize(("radiance", "pixel"), [(1e12, 10.0), (1.0, 1e13), (1.0, 1e38)])
def test_an_environment_that_is_too_bright_is_refused(tmp_path: Path, radiance: float, pixel: float) -> None:
    file = write_environment(tmp_path / "sky.exr", np.full((4, 8, 3), pixel))
    light = EnvironmentLight((radiance,) * 3, file)
    with pytest.raises(InputError, match=r"sky\.exr: an environment has at most 1e\+12 W/\(m\^2 sr\), not 1e\+"):
        light.pixels()
    with pytest.raises(InputError, match=r"radiance must be three numbers, each from 0 to 1e\+12"):
        EnvironmentLight((1.1e12,) * 3)


@pytest.mark.parametrize(
    ("file", "message"), [("no.hdr", "no such file"), ("sky.png", "must be a .hdr or .exr file"), (".", "must be a")]
)
def test_a_missing_file_or_another_format_is_an_error(tmp_path: Path, file: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        EnvironmentLight(file=str(tmp_path / file)).pixels()


@pytest.mark.parametrize("name", ["studio.exr", "forest.exr", "chinese_garden_1k.hdr", "brown_photostudio_02_1k.hdr"])
def test_real_light_probes(data: Path, name: str) -> None:
    pixels = EnvironmentLight(file=str(data / "env" / name)).pixels()
    assert pixels.shape == (512, 1024, 3)
    assert np.isfinite(pixels).all() and pixels.min() >= 0
    assert 0.1 < pixels.mean() < 2 and pixels.max() > 50, "a light probe has bright lamps or a sun"
