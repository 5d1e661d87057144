"""Suns of environment images: their light, and the rest of the image."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import MATTE, WHITE, lit, plane, write_environment

from wgsss.bake.environment import prefilter, split_environments
from wgsss.bake.suns import MOST_SUNS, solid_angles, take_suns, texel_directions
from wgsss.gpu import Gpu
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight, EnvironmentLight, Object, OrthographicCamera, SphereLight
from wgsss.scene.shapes import sphere
from wgsss.stage import Stage

SUN = (1000.0, 800.0, 500.0)


def with_sun(row: int, column: int, height: int = 128, sky: float = 0.0) -> np.ndarray:
    """Return a sky with a sun of one texel."""
    pixels = np.full((height, 2 * height, 3), sky, np.float32)
    pixels[row, column] = SUN
    return pixels


def softboxes(height: int = 128) -> np.ndarray:
    """Return two soft boxes of 30 degrees; one of them lies across the border of the image."""
    pixels = np.zeros((height, 2 * height, 3), np.float32)
    side = height // 6
    pixels[side : 2 * side, -side // 2 :] = pixels[side : 2 * side, : side // 2] = (20, 15, 10)
    pixels[4 * side : 5 * side, height : height + side] = (5, 10, 20)
    return pixels


def bulbs(count: int) -> np.ndarray:
    pixels = np.zeros((128, 256, 3), np.float32)
    for i in range(count):
        pixels[20 + 29 * (i % 4), 30 * (i // 4) + 5] = SUN
    return pixels


def tube() -> np.ndarray:
    pixels = np.zeros((128, 256, 3), np.float32)
    pixels[50:52, 20:80] = 30.0
    return pixels


def spread(count: int) -> np.ndarray:
    """Return directions in the whole sphere, including the poles."""
    i = np.arange(count) + 0.5
    y, phi = 1.0 - 2.0 * i / count, np.pi * (3.0 - np.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - y * y)
    return np.concatenate([np.stack([ring * np.sin(phi), y, ring * np.cos(phi)], axis=1), [[0, 1, 0], [0, -1, 0]]])


def irradiance(pixels: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return the integral of radiance times cosine, summed over texels: (N, 3), W/m^2."""
    height, width = pixels.shape[:2]
    row, column = np.nonzero(pixels.any(axis=2))
    power = pixels[row, column] * solid_angles(height, width)[row, None]
    return np.maximum(n @ texel_directions(row, column, height, width).T, 0.0) @ power.astype(np.float64)


def received(gpu: Gpu, light: EnvironmentLight, n: np.ndarray) -> np.ndarray:
    """Return the irradiance as rendered: of the suns, and of the prefiltered map as shaders interpolate it."""
    found = split_environments([light])
    texels = gpu.read_texture(prefilter(gpu, found.rest, MATTE).irradiance).astype(np.float64)
    values = texels[..., :3] * texels[..., 3:] ** 2
    height, width = values.shape[:2]
    u = (0.5 + np.arctan2(n[:, 0], -n[:, 2]) / (2.0 * np.pi)) * width - 0.5
    v = np.arccos(np.clip(n[:, 1], -1.0, 1.0)) / np.pi * (height - 1)
    left, top = np.floor(u).astype(int), np.clip(np.floor(v).astype(int), 0, max(height - 2, 0))
    s, t = (u - left)[:, None], (v - top)[:, None]
    rows = [values[y, left % width] * (1 - s) + values[y, (left + 1) % width] * s for y in (top, (top + 1) % height)]
    total = rows[0] * (1 - t) + rows[1] * t
    for sun in found.suns:
        towards = -np.asarray(sun.direction) / np.linalg.norm(sun.direction)
        total = total + np.maximum(n @ towards, 0.0)[:, None] * np.asarray(sun.irradiance)
    return total


@pytest.mark.parametrize(
    "place", [(60, 30), (40, 0), (40, 255), (0, 100), (127, 200), (3, 0), (63, 127)], ids=lambda place: f"{place}"
)
@pytest.mark.parametrize("sky", [0.0, 0.01])
def test_a_bright_texel_becomes_a_light(place: tuple[int, int], sky: float) -> None:
    pixels = with_sun(*place, sky=sky)
    (sun,), rest = take_suns(pixels)
    np.testing.assert_allclose(rest, sky, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(sun.towards, texel_directions(*place, 128, 256), atol=1e-6)
    np.testing.assert_allclose(sun.irradiance, (np.array(SUN) - sky) * solid_angles(128, 256)[place[0]], rtol=1e-5)


def test_a_disc_and_its_glare_are_one_sun_at_their_centre() -> None:
    height, width = 512, 1024
    row, column = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    centre = texel_directions(150.3, 10.7, height, width)
    angle = np.degrees(np.arccos(np.clip(texel_directions(row, column, height, width) @ centre, -1.0, 1.0)))
    pixels = np.repeat((1e5 * (angle < 0.4) + 50.0 * np.exp(-angle))[..., None], 3, axis=2).astype(np.float32) + 1
    suns, rest = take_suns(pixels)
    assert len(suns) == 1
    assert np.degrees(np.arccos(min(float(suns[0].towards @ centre), 1.0))) < 0.05
    gone = (pixels - rest)[..., 0] * solid_angles(height, width)[:, None]
    assert suns[0].irradiance[0] == pytest.approx(gone.sum(), rel=1e-4)
    assert rest.max() < 100.0 and gone.min() >= 0.0


@pytest.mark.parametrize(
    ("pixels", "count"),
    [
        (np.full((64, 128, 3), 3.0, np.float32), 0),
        (np.zeros((64, 128, 3), np.float32), 0),
        (np.random.default_rng(1).random((64, 128, 3), np.float32), 0),
        (softboxes(), 0),
        (tube(), 0),
        (with_sun(2, 3, height=8), 0),  # 23 degrees wide
        (with_sun(9, 9, sky=100.0), 0),  # too weak to be visible
        (bulbs(5), 5),
        (bulbs(12), MOST_SUNS),
    ],
    ids=["even", "black", "noise", "softboxes", "tube", "coarse", "faint", "5 bulbs", "12 bulbs"],
)
def test_only_small_and_bright_regions_are_suns(pixels: np.ndarray, count: int) -> None:
    suns, rest = take_suns(pixels)
    assert len(suns) == count
    light = (pixels - rest) * solid_angles(*pixels.shape[:2])[:, None, None]
    np.testing.assert_allclose(sum((sun.irradiance for sun in suns), np.zeros(3)), light.sum(axis=(0, 1)), rtol=1e-4)


@pytest.mark.parametrize(
    "pixels",
    [with_sun(1, 3), with_sun(50, 255, sky=0.2), softboxes(), softboxes(60), tube(), bulbs(12)],
    ids=["sun at the pole", "sun at the seam", "softboxes", "softboxes of another size", "tube", "bulbs"],
)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e8])
def test_the_irradiance_is_that_of_the_image(gpu: Gpu, tmp_path: Path, pixels: np.ndarray, scale: float) -> None:
    """The error is below 1 % of the largest irradiance, for any normal, also beyond the range of half floats."""
    light = EnvironmentLight((scale,) * 3, write_environment(tmp_path / "sky.exr", pixels))
    n = spread(400)
    wanted = irradiance(pixels, n) * scale
    error = np.abs(received(gpu, light, n) - wanted).max() / wanted.max()
    print(f"largest error {error:.2%}")
    assert error < 0.01


@pytest.mark.parametrize("rotation", [90.0, 1.0, -37.5, 725.0])
def test_the_image_and_its_suns_rotate_together(gpu: Gpu, tmp_path: Path, rotation: float) -> None:
    pixels = softboxes() + with_sun(40, 90)
    n, turn = spread(200), np.radians(rotation)
    file = write_environment(tmp_path / "sky.exr", pixels)
    c, s = np.cos(turn), np.sin(turn)
    back = n @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])  # turned about +y by -rotation
    wanted = irradiance(pixels, back)
    found = received(gpu, EnvironmentLight(file=file, rotation=rotation), n)
    assert np.abs(found - wanted).max() < 0.01 * wanted.max()


@pytest.mark.parametrize("name", ["studio.exr", "forest.exr", "chinese_garden_1k.hdr", "brown_photostudio_02_1k.hdr"])
def test_irradiance_of_real_light_probes(gpu: Gpu, data: Path, name: str) -> None:
    light = EnvironmentLight(file=str(data / "env" / name))
    n = spread(60)
    wanted = irradiance(light.pixels(), n)
    error = np.abs(received(gpu, light, n) - wanted).max() / wanted.max()
    print(f"{name}: largest error {error:.2%}")
    assert error < 0.01


@pytest.mark.parametrize("method", ["deon07", "sam"])
def test_a_sun_in_an_image_lights_as_the_directional_light_does(gpu: Gpu, tmp_path: Path, method: str) -> None:
    """M of a ball, in the shadow of another ball, is the same up to rounding."""
    pixels = with_sun(30, 100)
    towards, E = texel_directions(30, 100, 128, 256), np.array(SUN) * solid_angles(128, 256)[30]
    camera = OrthographicCamera((0, 0, 50), (0, 0, 0), height=24)
    ball = sphere(radius=5.0, vertices=500)
    shown = []
    for light in (
        EnvironmentLight(file=write_environment(tmp_path / "sky.exr", pixels)),
        DirectionalLight(tuple(-towards), tuple(E)),
    ):
        scene = lit(
            light, mesh=ball, material=WHITE, camera=camera, extra=(Object(ball, WHITE, translate=tuple(9 * towards)),)
        )
        shown.append(Renderer(scene, make_method(method), (32, 32), gpu).frame().pixels)
    np.testing.assert_allclose(shown[0], shown[1], rtol=1e-4, atol=1e-6)
    assert shown[0][..., :3].max() > 0.01


def test_the_shadow_of_a_sun_is_sharp(gpu: Gpu, tmp_path: Path) -> None:
    """The ground is dark where a ball hides the sun and lit elsewhere, however coarse its mesh is."""
    file = write_environment(tmp_path / "sky.exr", with_sun(32, 0))
    ball = Object(sphere(radius=3.0, vertices=4000), MATTE, translate=(0, 10, 0))
    camera = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=36)
    scene = replace(lit(EnvironmentLight(file=file), mesh=plane(side=80.0, cells=2), extra=(ball,)), camera=camera)
    image = Renderer(scene, make_method("lambert"), (121, 121), gpu).frame(aovs=["irradiance"])
    t = (np.arange(121) + 0.5) / 121 * 36 - 18
    x, z = np.meshgrid(t, t)
    to_ball = np.stack([-x, np.full_like(x, 10.0), -z], axis=-1)
    towards = texel_directions(32, 0, 128, 256)
    off = np.linalg.norm(np.cross(to_ball, towards), axis=-1)  # of the ray from the centre of the ball
    ground = np.where(np.hypot(x, z) > 3.2, image.aovs["irradiance"][..., 0], np.nan)  # without the ball
    E = SUN[0] * solid_angles(128, 256)[32] * towards[1]
    assert (off < 2.8).sum() > 100
    assert np.nanmax(ground[off < 2.8]) < 1e-3 * E
    np.testing.assert_allclose(np.nanmin(ground[off > 3.2]), E, rtol=0.01)


def test_the_light_of_soft_boxes_is_smooth_on_a_body(gpu: Gpu, tmp_path: Path) -> None:
    """All vertices of a convex body see the whole sky above their horizon."""
    light = EnvironmentLight(file=write_environment(tmp_path / "sky.exr", softboxes()))
    stage = Stage(gpu, lit(light, mesh=sphere(radius=5.0, vertices=4000)))
    n = stage.bodies[0].render_mesh.normals.astype(np.float64)
    E = irradiance(softboxes(), n).mean(axis=1)
    hidden = (1.0 - stage.bodies[0].sky) * E
    assert hidden.max() < 0.01 * E.max()


def test_suns_come_after_the_lights_of_the_scene(gpu: Gpu, tmp_path: Path) -> None:
    """Methods identify the emitters of the lights by their index."""
    lamp = SphereLight((0, 90, 0), 5, (9, 9, 9), samples=4)
    sky = EnvironmentLight(file=write_environment(tmp_path / "sky.exr", bulbs(5)))
    stage = Stage(gpu, lit(sky, lamp))
    lights: list[Any] = stage.lights
    assert lights[:2] == [sky, lamp] and [type(light) for light in lights[2:]] == [DirectionalLight] * 5
