"""Translucent shadow maps against closed forms: slabs lit from behind, balls too thick for light to pass."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import MATTE, lit, plane
from scipy.stats import norm

from wgsss.errors import InputError
from wgsss.methods import translucent_shadow_maps
from wgsss.optics import SumOfGaussians
from wgsss.registry import make_method
from wgsss.rendering import Image, Renderer
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Mesh,
    Object,
    OrthographicCamera,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
)
from wgsss.scene.shapes import ear, slab, sphere

VARIANCES, WEIGHTS = np.array([0.3, 1.0, 4.0]), np.array([[0.3, 0.1, 0.5], [0.2, 0.3, 0.2], [0.4, 0.2, 0.1]])
WAX = replace(MATTE, gaussians=SumOfGaussians(VARIANCES, WEIGHTS))
FRONT = OrthographicCamera((0, 0, 50), (0, 0, 0), height=12)
SIZE = 48
MAP = {"map_size": 256}


def pixels(height: float = FRONT.height) -> Any:
    """Return x and y in mm of the pixels of an orthographic view."""
    t = ((np.arange(SIZE) + 0.5) / SIZE - 0.5) * height
    return np.meshgrid(t, -t)


def through(d: Any) -> Any:
    """Return M at distance d from a plane under uniform light, divided by its irradiance."""
    return np.exp(-np.square(d)[..., None, None] / (2 * VARIANCES[:, None])) * WEIGHTS


def frame(gpu: Any, scene: Scene, **knobs: Any) -> Image:
    return Renderer(scene, make_method("deon07", {**MAP, **knobs}), (SIZE, SIZE), gpu).frame(
        aovs=["M_front", "M_back"], timed=False
    )


def M_back(gpu: Any, *lights: Any, thickness: float = 2.0, extra: tuple = (), **changes: Any) -> Any:
    """Return M_back of a slab seen from +z."""
    plate = slab((50.0, 50.0, thickness), 1000)
    scene = lit(*lights, mesh=plate, material=WAX, camera=FRONT, extra=extra)
    return frame(gpu, replace(scene, **changes)).aovs["M_back"]


@pytest.mark.parametrize("thickness", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("angle", [0, 60])
def test_parallel_light_through_a_slab(gpu, thickness, angle):
    """The thickness of the slab counts at all angles of the light, not the distance along the ray."""
    a = np.radians(angle)
    got = M_back(gpu, DirectionalLight((np.sin(a), 0, np.cos(a)), (1, 2, 3)), thickness=thickness)
    expected = np.cos(a) * np.array([1, 2, 3]) * through(np.float64(thickness)).sum(axis=0)
    np.testing.assert_allclose(got, np.broadcast_to(expected, got.shape), rtol=0.02)


@pytest.mark.parametrize(("z", "views"), [(-25.0, 6), (-90.0, 1), (-1e6, 1)])
def test_a_point_light_behind_a_slab(gpu, z, views):
    """Seen as a cube, of which it takes several faces, as a cone and as parallel light.

    Irradiance that varies as smoothly as this is E + v / 2 times its Laplacian after a Gaussian.
    """
    light_x, light_y, intensity = 14.0, -9.0, (z / 1000) ** 2
    light = PointLight((light_x, light_y, z), (intensity,) * 3)
    camera = replace(FRONT, height=48)
    image = frame(gpu, lit(light, mesh=slab((80.0, 80.0, 2.0), 1000), material=WAX, camera=camera))
    met = [
        item.writes["x_i"].size
        for item in image.graph.passes
        if item.module.name == "translucent_shadow_maps/first_hit"
    ]
    assert met == [(1024, 1024) if views == 1 else (512, 512)] * views
    x, y = pixels(camera.height)
    depth = -1.0 - z
    along = depth / (1.0 - z)  # to x_i, of the way from the light to x_o
    dx, dy = along * (x - light_x), along * (y - light_y)

    def irradiance(dx: Any, dy: Any) -> Any:
        return intensity * 1e6 * depth / (dx**2 + dy**2 + depth**2) ** 1.5

    h = 1e-3 * depth
    around = sum(irradiance(dx + i, dy + j) for i, j in ((h, 0), (-h, 0), (0, h), (0, -h)))
    laplacian = (around - 4 * irradiance(dx, dy)) / h**2
    blurred = irradiance(dx, dy)[..., None] + VARIANCES / 2 * laplacian[..., None]
    expected = (blurred[..., None] * through(np.float64(2.0))).sum(axis=2)
    np.testing.assert_allclose(image.aovs["M_back"], expected, rtol=0.02)


def test_light_enters_where_it_hits_the_object(gpu, monkeypatch):
    """The shadow of something behind the slab ends where slanting light brings its edge, blurred as on the back: even
    where a map has a texel for half a millimetre."""
    monkeypatch.setattr(translucent_shadow_maps, "SIDE", {1: 128})
    a = np.radians(40)
    half = Mesh(plane(side=60.0).positions[:, [0, 2, 1]] + np.float32([-30, 0, -6]), plane().faces)
    light = DirectionalLight((np.sin(a), 0, np.cos(a)), (1, 1, 1))
    got = M_back(gpu, light, thickness=2.0, extra=(Object(half, MATTE),))
    x_i = pixels()[0] - 2.0 * np.tan(a)
    edge = 5.0 * np.tan(a)
    inside = norm.cdf((x_i - edge)[..., None] / np.sqrt(VARIANCES))
    expected = np.cos(a) * (inside[..., None] * through(np.float64(2.0))).sum(axis=2)
    assert expected.min() < 0.01 * expected.max()
    np.testing.assert_allclose(got, expected, atol=0.02 * expected.max())


def test_a_small_area_light_equals_a_point_light(gpu):
    distance, side, radius = 300.0, 10.0, 6.0
    metres = (distance - 1.0) / 1000.0
    expected = through(np.float64(2.0)).sum(axis=0)
    for light, area in (
        (RectLight((0, 0, -distance), (0, 0, 1), (0, 1, 0), side, side, (1e3,) * 3), side**2),
        (SphereLight((0, 0, -distance), radius, (1e3,) * 3), np.pi * radius**2),
    ):
        got = M_back(gpu, light) / (1e-3 * area / metres**2)
        np.testing.assert_allclose(got, np.broadcast_to(expected, got.shape), rtol=0.02)


BEHIND = DirectionalLight((0.4, 0, 1), (1, 2, 3))
ASIDE = PointLight((40, 30, -60), (0.01, 0.02, 0.005))
AHEAD = DirectionalLight((0, -0.5, -1), (3, 2, 1))
SKY = EnvironmentLight((0.5, 0.4, 0.3))


def test_lights_add_up_and_do_not_see_each_others_light(gpu):
    wide = RectLight((-40, 30, -60), (0.6, -0.4, 1), (0, 1, 0), 20, 20, (9, 8, 7), samples=4)
    apart = sum(M_back(gpu, light) for light in (wide, BEHIND, ASIDE))
    together = M_back(gpu, wide, SKY, BEHIND, ASIDE)
    np.testing.assert_allclose(together, apart, rtol=2e-3, atol=1e-4)


def test_a_single_light_shares_the_surfaces_maps_and_brings_the_sky(gpu):
    scene = lit(BEHIND, SKY, mesh=slab((50.0, 50.0, 2.0), 1000), material=WAX, camera=FRONT)
    image = frame(gpu, scene)
    assert sum(item.module.name == "texture_space/dilate" for item in image.graph.passes) == 1
    arriving = np.array(BEHIND.irradiance) / np.sqrt(1.16) + np.pi * np.array(SKY.radiance)
    expected = arriving * through(np.float64(2.0)).sum(axis=0)
    got = image.aovs["M_back"]
    np.testing.assert_allclose(got, np.broadcast_to(expected, got.shape), rtol=0.02)


@pytest.mark.parametrize("lights", [(SKY,), (PointLight((0, 0, -50), (0, 0, 0)), SKY), ()], ids=["sky", "dark", "none"])
def test_without_light_there_are_no_passes(gpu, lights):
    image = frame(gpu, lit(*lights, mesh=slab(vertices=100), material=WAX, camera=FRONT))
    assert not [item for item in image.graph.passes if item.module.name.startswith("translucent_shadow_maps/")]
    assert sum(item.module.name == "texture_space/dilate" for item in image.graph.passes) == 1
    assert not image.aovs["M_back"].any()


def test_lit_points_do_not_lie_behind_themselves(gpu, monkeypatch):
    """Light at lit points belongs to M_front. With coarse maps on a bent surface there would be acne."""
    assert M_back(gpu, AHEAD).max() < 1e-6
    monkeypatch.setattr(translucent_shadow_maps, "SIDE", {1: 128})
    camera = OrthographicCamera((0, 30, 100), (0, 30, 0), height=70)
    scene = lit(DirectionalLight((0.1, 0, -1), (1, 1, 1)), mesh=ear(3000), material=WAX, camera=camera)
    aovs = frame(gpu, scene).aovs
    assert np.quantile(aovs["M_back"][aovs["M_front"] > 0], 0.97) < 0.005 * aovs["M_front"].max()


def test_light_reaches_the_edge_of_the_object(gpu, monkeypatch):
    """Rays that miss the object do not darken it, even with coarse maps."""
    monkeypatch.setattr(translucent_shadow_maps, "SIDE", {1: 4})
    fine = replace(MATTE, gaussians=SumOfGaussians(VARIANCES / 100, WEIGHTS))
    light = DirectionalLight((0, 0, 1), (1, 1, 1))
    got = frame(gpu, lit(light, mesh=slab((10.0, 5.0, 0.2), 1000), material=fine, camera=FRONT)).aovs["M_back"]
    x, y = pixels()
    inside = (np.abs(x) < 4.3) & (np.abs(y) < 1.8)
    expected = np.broadcast_to(through(np.float64(2.0)).sum(axis=0), got.shape)
    np.testing.assert_allclose(got[inside], expected[inside], rtol=0.02)


def test_a_ball_much_wider_than_the_gaussians_transmits_no_light(gpu):
    """Nor is there a halo where its light ends: M_front has what crosses there. A ball shows what is corrected that is
    not level, what is not faded, and where charts end."""
    camera = OrthographicCamera((0, 0, 100), (0, 0, 0), height=84)
    for light in (DirectionalLight((-1, 0, 0), (1, 1, 1)), DirectionalLight((-0.5, 0, 0.8), (1, 1, 1))):
        image = frame(gpu, lit(light, mesh=sphere(40.0, 6000), material=WAX, camera=camera), map_size=256)
        assert image.aovs["M_back"].max() < 0.03 * WAX.profile.total.max()


def test_light_that_enters_around_an_edge_fades_in_with_the_distance_along_the_surface(gpu):
    """A block lit from above and behind, seen from the front. Between faces at a right angle the ray is not corrected,
    and the way over the surface is taken to be twice as long: it counts in full from four sigmas on."""
    wax = replace(MATTE, gaussians=SumOfGaussians(np.ones(1), np.full((1, 3), 0.9)))
    camera = OrthographicCamera((0, 8, 50), (0, 8, 0), height=6)
    scene = lit(
        DirectionalLight((0, -(0.75**0.5), 0.5), (1, 1, 1)), mesh=slab((20.0,) * 3, 3000), material=wax, camera=camera
    )
    got = frame(gpu, scene, map_size=1024).aovs["M_back"][:, SIZE // 2, 0]
    below = 10.0 - (8.0 + pixels(camera.height)[1][:, 0])
    t = below / 0.75**0.5
    share = np.clip(2 * t / 4, 0, 1)
    blurred = norm.cdf(0.5 * t)  # the front is dark
    expected = 0.9 * 0.75**0.5 * blurred * np.exp(-t * t / 2) * share**2 * (3 - 2 * share)
    seen = (below > 0.5) & (below < 2.5)
    np.testing.assert_allclose(got[seen], expected[seen], rtol=0.1, atol=0.01)


def test_other_objects_block_the_light_and_do_not_shine(gpu):
    shade = Object(Mesh(plane(side=60.0).positions[:, [0, 2, 1]] + np.float32([0, 0, -6]), plane().faces), WAX)
    assert M_back(gpu, BEHIND, extra=(shade,)).max() < 1e-4
    beside = Object(slab((50.0, 50.0, 2.0), 1000), WAX, translate=(0, 0, 8))  # seen, in the first one's shade
    got = M_back(gpu, DirectionalLight((0, 0, 1), (1, 1, 1)), extra=(beside,))
    assert got.max() < 1e-4


def test_an_open_sheet_has_no_inside(gpu):
    sheet = Mesh(plane().positions[:, [0, 2, 1]] * np.float32([1, -1, 1]), plane().faces)
    for z in (1, -1):
        got = frame(gpu, lit(DirectionalLight((0, 0, z), (1, 1, 1)), mesh=sheet, material=WAX, camera=FRONT))
        assert got.aovs["M_back"].max() < 1e-6


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_base_colour(gpu, share):
    """Half in front of the slab and half behind: in all, it is applied once."""
    color = (0.5, 0.25, 0.9)
    plain = M_back(gpu, BEHIND)
    scene = lit(BEHIND, mesh=slab((50.0, 50.0, 2.0), 1000), material=WAX, camera=FRONT)
    painted = replace(WAX, base_color=color, color_after=share)
    scene = replace(scene, objects=(replace(scene.objects[0], material=painted),))
    np.testing.assert_allclose(frame(gpu, scene).aovs["M_back"], plain * color, rtol=5e-3)


def test_same_scene_same_bits(gpu):
    scene = lit(BEHIND, ASIDE, SKY, mesh=sphere(10.0, 1000), material=WAX, camera=replace(FRONT, height=24))
    renderer = Renderer(scene, make_method("deon07", {"map_size": 128}), (SIZE, SIZE), gpu)
    first = renderer.frame(timed=False)
    assert all(renderer.frame(timed=False).pixels.tobytes() == first.pixels.tobytes() for _ in range(5))
    other = Renderer(scene, make_method("deon07", {"map_size": 128}), (SIZE, SIZE), gpu).frame(timed=False)
    assert other.pixels.tobytes() == first.pixels.tobytes()


def test_translucent_shadow_maps_need_texture_space():
    assert type(make_method("texture+tsm")) is type(make_method("deon07"))
    with pytest.raises(InputError, match="translucency tsm goes with surface texture, not with screen"):
        make_method("screen+tsm")
