"""The shared passes against closed forms: each type of light, shadows, reflection at the surface, the composite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import ABOVE, MATTE, WHITE, lit, plane, write_environment

from wgsss import frame as shared
from wgsss.bake.environment import rho_dt_table
from wgsss.graph import Graph
from wgsss.registry import make_method
from wgsss.rendering import AOVS, Renderer
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Mesh,
    Object,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RectLight,
    SphereLight,
)
from wgsss.scene.motion import BendAndSwell
from wgsss.scene.shapes import capsule, sphere
from wgsss.stage import Stage

SIZE = 64
DOWN = DirectionalLight((0, -1, 0), (2.0, 1.0, 0.5))


def pixel_places(size=SIZE, height=20.0):
    """Return world x and z of each pixel of the camera ABOVE."""
    t = ((np.arange(size) + 0.5) / size - 0.5) * height
    return np.meshgrid(t, t)


def irradiance(gpu, scene, size=SIZE):
    graph = Graph(gpu)
    handle = shared.irradiance_pixels(shared.begin(graph, Stage(gpu, scene), (size, size)))
    graph.run(handle)
    return graph.read(handle)[..., :3]


def image(gpu, scene, size=SIZE):
    return Renderer(scene, make_method("lambert"), (size, size), gpu).frame(aovs=AOVS)


def reflectance_by_quadrature(cos_o, roughness, eta, n=600):
    """Return the directional albedo of the GGX lobe, by a sum of f_r cos over a grid of half vectors."""
    alpha = roughness**2
    w_o = np.array([np.sqrt(1 - cos_o**2), 0, cos_o])
    # theta_h from the distribution's inverse, which crowds the grid where the lobe is
    u = (np.arange(n) + 0.5) / n
    tan2 = alpha**2 * u / (1 - u)
    cos_h = 1 / np.sqrt(1 + tan2)
    phi = 2 * np.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    sin_h = np.sqrt(1 - cos_h**2)
    h = np.stack(np.broadcast_arrays(sin_h[:, None] * np.cos(phi), sin_h[:, None] * np.sin(phi), cos_h[:, None]), -1)
    dot = h @ w_o
    cos_i = 2 * dot * h[..., 2] - cos_o
    good = (dot > 0) & (cos_i > 0)

    def smith(c):
        return 0.5 * (np.sqrt(1 + alpha**2 * (1 - c**2) / c**2) - 1)

    with np.errstate(all="ignore"):
        g = 1 / (1 + smith(cos_o) + smith(cos_i))
        cos_t = np.sqrt(1 - (1 - dot**2) / eta**2)
        r_s = (dot - eta * cos_t) / (dot + eta * cos_t)
        r_p = (eta * dot - cos_t) / (eta * dot + cos_t)
        weight = 0.5 * (r_s**2 + r_p**2) * g * dot / (cos_o * h[..., 2])
    return np.where(good, weight, 0).mean()


@pytest.mark.parametrize(("roughness", "eta"), [(0.2, 1.3), (0.35, 1.5), (0.7, 1.4), (1.0, 1.3)])
def test_rho_dt_is_one_minus_the_lobes_albedo(gpu, roughness, eta):
    graph = Graph(gpu)
    table = rho_dt_table(graph, replace(WHITE, roughness=roughness, eta=eta))
    graph.run(table)
    got = graph.read(table)[0, :, 0]
    for i in (8, 20, 40, 63):
        expected = 1 - reflectance_by_quadrature((i / 63) ** 2 - 1e-9, roughness, eta)
        assert got[i] == pytest.approx(expected, abs=2e-3), f"entry {i}"


@pytest.mark.parametrize("angle", [0, 30, 75])
def test_directional_light(gpu, angle):
    a = np.radians(angle)
    light = DirectionalLight((np.sin(a), -np.cos(a), 0), (2.0, 1.0, 0.5))
    got = irradiance(gpu, lit(light))
    np.testing.assert_allclose(got, np.broadcast_to(np.array([2, 1, 0.5]) * np.cos(a), got.shape), rtol=2e-3)
    entered = irradiance(gpu, lit(light, material=WHITE))
    expected = 1 - reflectance_by_quadrature(np.cos(a) - 1e-9, WHITE.roughness, WHITE.eta)
    np.testing.assert_allclose(entered / got, expected, atol=2e-3)


def test_point_light_falls_with_the_square_of_metres(gpu):
    got = irradiance(gpu, lit(PointLight((3, 30, 0), (1, 2, 3))))
    x, z = pixel_places()
    d2 = (x - 3) ** 2 + z**2 + 30**2
    expected = 30 / np.sqrt(d2) / (d2 * 1e-6)
    np.testing.assert_allclose(got[..., 0], expected, rtol=1e-4)
    np.testing.assert_allclose(got[..., 2], 3 * expected, rtol=1e-4)


def test_a_point_light_inside_the_scene_casts_shadows_in_all_directions(gpu):
    """A lamp between a ceiling and a floor has a cube of shadow views; a small square is below it."""
    lamp = PointLight((0, 6, 0), (1, 1, 1))
    ceiling = Object(plane(y=12.0).deformed(plane(y=12.0).positions * [1, 1, -1]), MATTE)
    shade = Object(plane(side=2.0, y=3.0), MATTE)
    camera = PerspectiveCamera((0, 11.9, 0.01), (0, 0, 0), up=(0, 0, -1), fov=80)
    stage = Stage(gpu, lit(lamp, camera=camera, extra=(ceiling, shade)))
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (128, 128))
    handle = shared.irradiance_pixels(frame)
    graph.run(handle, frame.gbuffer.gbuffer_id, frame.gbuffer.depth)
    assert len(frame.lighting.views) == 6
    got = graph.read(handle)[..., 0]
    ids = graph.read(frame.gbuffer.gbuffer_id)[..., 2]
    clip = np.stack(np.meshgrid((np.arange(128) + 0.5) / 64 - 1, 1 - (np.arange(128) + 0.5) / 64), -1)
    clip = np.concatenate([clip, graph.read(frame.gbuffer.depth), np.ones((128, 128, 1))], -1)
    p = clip @ frame.view.clip_to_world.T
    x, z = p[..., 0] / p[..., 3], p[..., 2] / p[..., 3]
    floor, reach = ids == 1, np.maximum(abs(x), abs(z))
    assert (got[floor & (reach < 1.9)] < 1e-6).all()  # the shade's shadow is twice its size: a square of 4 mm
    d2 = x**2 + z**2 + 36
    bright = floor & (reach > 2.1)
    np.testing.assert_allclose(got[bright], (6 / np.sqrt(d2) / (d2 * 1e-6))[bright], rtol=1e-3)


def test_rectangle_matches_its_form_factor(gpu):
    width, height, up = 12.0, 8.0, 10.0
    light = RectLight((0, up, 0), (0, -1, 0), (0, 0, -1), width, height, (5, 5, 5), samples=36)
    got = irradiance(gpu, lit(light))[SIZE // 2, SIZE // 2, 0]
    x, y = width / 2 / up, height / 2 / up  # a quarter of the rectangle, its corner above the point
    a, b = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    quarter = (x / a * np.arctan(y / a) + y / b * np.arctan(x / b)) / (2 * np.pi)
    assert got == pytest.approx(4 * quarter * np.pi * 5, rel=0.01)


def test_sphere_matches_its_solid_angle(gpu):
    light = SphereLight((0, 40, 0), 10.0, (5, 5, 5), samples=64)
    got = irradiance(gpu, lit(light))[SIZE // 2, SIZE // 2, 0]
    assert got == pytest.approx(np.pi * 5 * (10 / 40) ** 2, rel=0.02)


def test_a_sphere_light_inside_the_scene_lights_all_directions(gpu):
    """A lamp halfway between floor and ceiling lights both by its solid angle."""
    ceiling = Object(plane(y=20.0).deformed(plane(y=20.0).positions * [1, 1, -1]), MATTE)
    light = SphereLight((0, 10, 0), 2.0, (5, 5, 5), samples=40)
    looks = ((0, 5, 0), (0, 0, 0)), ((0, 15, 0), (0, 20, 0))
    for eye, target in looks:
        camera = PerspectiveCamera(eye, target, up=(0, 0, 1), fov=20)
        got = irradiance(gpu, lit(light, extra=(ceiling,), camera=camera))[SIZE // 2, SIZE // 2, 0]
        assert got == pytest.approx(np.pi * 5 * (2 / 10) ** 2, rel=0.03)


def test_sphere_around_the_middle_of_the_scene(gpu):
    left, right = (Object(sphere(5.0, 500), MATTE, translate=(x, 0, 0)) for x in (-20, 20))
    scene = replace(lit(SphereLight((0, 0, 0), 2.0, (5, 5, 5))), objects=(left, right))
    got = irradiance(gpu, replace(scene, camera=replace(ABOVE, height=60.0)))[..., 0]
    assert got[:, : SIZE // 2].max() > 0.1
    np.testing.assert_allclose(got[:, : SIZE // 2].sum(), got[:, SIZE // 2 :].sum(), rtol=0.1)


@pytest.mark.parametrize("distance", [2e3, 1e5, 1e9])
def test_a_distant_light_casts_the_shadows_of_a_parallel_one(gpu, distance):
    away = np.array([0.6, 0.8, 0.0]) * distance
    lamp = PointLight(tuple(away), (2 * (distance * 1e-3) ** 2,) * 3)
    parallel = DirectionalLight((-0.6, -0.8, 0), (2, 2, 2))
    shade = Object(plane(side=4.0, y=5.0), MATTE)
    got, expected = (irradiance(gpu, lit(light, extra=(shade,)), 128)[..., 0] for light in (lamp, parallel))
    assert (expected < 0.01).any()
    differs = np.abs(got - expected) > 0.05
    assert differs.mean() < 40 / distance


def test_an_environment_with_one_bright_half(gpu, tmp_path):
    """A hemisphere of radiance L around +x gives pi L (1 + n_x) / 2, also when the environment is rotated."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[:, 64:] = (2, 1, 0)  # +x is right of the middle
    file = write_environment(tmp_path / "half.exr", pixels)
    for rotation, axis in ((0.0, 0), (-90.0, 2)):  # clockwise from above: +x turns to +z
        light = EnvironmentLight((1, 1, 1), file, rotation)
        got = image(gpu, lit(light, mesh=sphere(5.0, 4000), camera=replace(ABOVE, height=12.0)))
        seen = got.pixels[..., 3] > 0
        n = got.aovs["normal"]
        expected = np.pi * (1 + n[..., axis]) / 2
        np.testing.assert_allclose(got.aovs["irradiance"][seen][:, 0], 2 * expected[seen], rtol=0.02, atol=0.03)
        np.testing.assert_allclose(got.aovs["irradiance"][seen][:, 1], expected[seen], rtol=0.02, atol=0.03)


def test_constant_environment_is_split_between_surface_and_medium(gpu):
    """Under radiance L from all directions, L (1 - rho_dt) is reflected, and L_d is pi L times the mean of rho_dt."""
    got = image(gpu, lit(EnvironmentLight((2, 2, 2)), material=WHITE))
    cosines = (np.arange(400) + 0.5) / 400
    albedo = np.array([reflectance_by_quadrature(c, WHITE.roughness, WHITE.eta, n=120) for c in cosines])
    mean = (2 * cosines * (1 - albedo)).mean()
    np.testing.assert_allclose(got.aovs["irradiance"], np.pi * 2 * mean, rtol=3e-3)
    at_normal = reflectance_by_quadrature(1 - 1e-9, WHITE.roughness, WHITE.eta)
    np.testing.assert_allclose(got.aovs["specular"], 2 * at_normal, rtol=0.03)
    assert not got.graph.culled or all("shadow" not in p.name for p in got.graph.passes)


def test_a_scene_lit_by_its_environment_alone_has_no_shadow_pass(gpu):
    got = image(gpu, lit(EnvironmentLight((2, 2, 2))))
    assert not any("shadow" in p.name for p in got.graph.passes)
    assert any("shadow" in p.name for p in image(gpu, lit(DOWN)).graph.ran)


def test_only_objects_that_reflect_have_a_pass_for_reflection(gpu):
    """A glossy ball beside a matte one reflects as it does alone; a scene with matte objects only has no such pass."""
    ball = sphere(4.0, 600)
    matte, glossy = Object(ball, MATTE, translate=(-5, 0, 0)), Object(ball, WHITE, translate=(5, 0, 0))
    found, alone, none = (
        image(gpu, replace(lit(DOWN), objects=objects)) for objects in ((matte, glossy), (glossy,), (matte,))
    )
    passes = [sum(item.module.name == "frame/specular" for item in got.graph.ran) for got in (found, alone, none)]
    assert passes == [1, 1, 0]
    np.testing.assert_allclose(found.aovs["specular"], alone.aovs["specular"], rtol=1e-3, atol=1e-4)
    assert found.aovs["specular"].max() > 0.05 and not none.aovs["specular"].any()
    for got in (found, none):
        left = np.s_[:, : SIZE // 2, :3]
        np.testing.assert_allclose(got.pixels[left], got.aovs["M_front"][left] / np.pi, rtol=1e-5)


@pytest.mark.parametrize("amid", [False, True])
def test_passes_leave_out_no_pixel_of_an_object(gpu, amid):
    """The rectangle of a pass is that of the object as posed, or the whole image if a part is behind the camera."""
    rod = Object(capsule(20.0, 2.0, 500), WHITE, motion=BendAndSwell(length=20.0, period_s=1.0), translate=(8, 0, 0))
    pair, aside = (rod, replace(rod, translate=(-12, 0, 0))), OrthographicCamera((0, 10, 50), (0, 10, 0), height=40)
    ground, within = (Object(plane(), WHITE),), PerspectiveCamera((0, 2, 0), (0, 0, -3), fov=90)
    scene = lit(EnvironmentLight((1, 1, 1)), camera=within if amid else aside)
    scene = replace(scene, objects=ground if amid else pair)
    got = Renderer(scene, make_method("lambert"), (SIZE, SIZE), gpu).frame(0.25, AOVS)
    seen = np.isfinite(got.aovs["depth"][..., 0])
    assert 50 < seen.sum() < SIZE * SIZE
    for values in (got.pixels, *(got.aovs[name] for name in ("irradiance", "M_front", "specular"))):
        assert (values[seen] > 0).all() and not values[~seen].any()


@pytest.mark.parametrize("gap", [0.3, 10.0])
def test_shadow_of_a_square_is_sharp_and_does_not_leak(gpu, gap):
    shade = Object(plane(side=8.0, y=gap), MATTE)
    camera = PerspectiveCamera((0, 0.15, 40), (0, 0, 0)) if gap < 1 else None
    scene = lit(DOWN, extra=(shade,), **({"camera": camera} if camera else {}))
    if gap < 1:  # seen from above the square hides its shadow: look at the texels of the floor instead
        stage = Stage(gpu, scene)
        stage.bodies[0].unwrap()
        graph = Graph(gpu)
        frame = shared.begin(graph, stage, (8, 8))
        handle = shared.irradiance_texels(frame, stage.bodies[0], 256)
        graph.run(handle)
        got = graph.read(handle)[..., 0] * frame.lighting.unit
        x = ((np.arange(256) + 0.5) / 256 - 0.01) / 0.98 * 40 - 20
        x, z = np.meshgrid(x, x)
    else:
        got = irradiance(gpu, replace(scene, objects=scene.objects), 128)[..., 0]
        x, z = pixel_places(128)
        hidden = np.maximum(abs(x), abs(z)) < 4.0
        got = np.where(hidden, 0.0, got)  # the square itself
    reach = np.maximum(abs(x), abs(z))
    texel = 2 * 40 / 2048
    on_plane = reach < 19.9
    assert np.abs(got[(reach < 4 - 3 * texel) & on_plane]).max() < 1e-6
    np.testing.assert_allclose(got[(reach > 4 + 3 * texel) & on_plane], 2.0, rtol=1e-5)


def test_a_sphere_does_not_shadow_its_lit_side(gpu):
    light = DirectionalLight((-1, -1, 0), (1, 1, 1))
    got = image(gpu, lit(light, mesh=sphere(5.0, 20000), camera=replace(ABOVE, height=11.0)), 128)
    n = got.aovs["normal"]
    cosine = (n[..., 0] + n[..., 1]) / np.sqrt(2)
    sure = (got.pixels[..., 3] > 0) & (cosine > 0.08)
    np.testing.assert_allclose(got.aovs["irradiance"][sure][:, 0], cosine[sure], rtol=0.02, atol=2e-3)


def test_texels_vertices_and_pixels_agree(gpu):
    lights = (
        PointLight((4, 15, -3), (1, 2, 3)),
        DirectionalLight((1, -2, 0.5), (0.5, 0.2, 0.1)),
        EnvironmentLight((0.1, 0.2, 0.3)),
    )
    shade = Object(plane(side=4.0, y=5.0), MATTE)
    scene = lit(*lights, mesh=plane(cells=40), material=WHITE, extra=(shade,))
    stage = Stage(gpu, scene)
    body = stage.bodies[0]
    surface = body.unwrap()
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (256, 256))
    pixels, texels = shared.irradiance_pixels(frame), shared.irradiance_texels(frame, body, 400)
    vertices = shared.irradiance_points(frame, body, body.vertices, len(body.render_mesh.vertex))
    graph.run(pixels, texels, vertices, frame.gbuffer.gbuffer_id)
    pixels, texels, vertices, seen = (graph.read(h) for h in (pixels, texels, vertices, frame.gbuffer.gbuffer_id))
    texels = texels * frame.lighting.unit
    place = body.rest.mesh.positions[surface.vertex]
    inside = np.abs(place[:, [0, 2]]).max(axis=1) < 9
    column = ((place[:, 0] / 20 + 0.5) * 256 - 0.5)[inside]
    row = ((place[:, 2] / 20 + 0.5) * 256 - 0.5)[inside]
    tu, tv = (surface.atlas[inside] * 400 - 0.5).T
    from scipy.ndimage import map_coordinates

    hidden = map_coordinates(seen[..., 2], [row, column], order=0) != 1
    at_pixels = np.stack([map_coordinates(pixels[..., c], [row, column], order=1) for c in range(3)], 1)
    at_texels = np.stack([map_coordinates(texels[..., c].astype(float), [tv, tu], order=1) for c in range(3)], 1)
    at_vertices = vertices[inside][:, :3]
    three = np.stack([at_pixels, at_texels, at_vertices])
    edge = (np.ptp(three, axis=0) > 0.2 * three.max(axis=0)).any(axis=1)  # a shadow's edge, sampled here and there
    assert (edge & ~hidden).mean() < 0.05
    good = ~edge & ~hidden
    np.testing.assert_allclose(at_pixels[good], at_vertices[good], rtol=0.02, atol=0.02)
    np.testing.assert_allclose(at_texels[good], at_vertices[good], rtol=0.02, atol=0.02)


def test_composite_adds_diffusion_and_reflection(gpu):
    a = np.radians(40)
    light = DirectionalLight((np.sin(a), -np.cos(a), 0), (2.0, 1.0, 0.5))
    rough = replace(WHITE, roughness=0.8, base_color=(0.5, 1.0, 0.8))
    got = image(gpu, lit(light, material=rough))
    entered = (1 - reflectance_by_quadrature(np.cos(a), 0.8, 1.4)) * np.cos(a) * np.array([2, 1, 0.5])
    M = entered * rough.profile.total * [0.5, 1.0, 0.8]
    np.testing.assert_allclose(got.aovs["M_front"], np.broadcast_to(M, got.aovs["M_front"].shape), rtol=5e-3)
    leaves = 1 - reflectance_by_quadrature(1 - 1e-9, 0.8, 1.4)
    diffuse = got.pixels[..., :3] - got.aovs["specular"]
    np.testing.assert_allclose(diffuse, np.broadcast_to(leaves / np.pi * M, diffuse.shape), rtol=8e-3)
    # the lobe seen along the normal: D F G / (4 cos cos) cos
    h, alpha = np.cos(a / 2), 0.64
    d = alpha**2 / (np.pi * (h * h * (alpha**2 - 1) + 1) ** 2)
    lam = 0.5 * (np.sqrt(1 + alpha**2 * np.tan(a) ** 2) - 1)
    cos_t = np.sqrt(1 - (1 - h * h) / 1.4**2)
    f = 0.5 * (((h - 1.4 * cos_t) / (h + 1.4 * cos_t)) ** 2 + ((1.4 * h - cos_t) / (1.4 * h + cos_t)) ** 2)
    np.testing.assert_allclose(got.aovs["specular"][..., 0], 2 * d * f / (1 + lam) / 4, rtol=2e-3)
    assert (got.aovs["M_back"] == 0).all() and (got.pixels[..., 3] == 1).all()


@pytest.mark.parametrize("camera", [ABOVE, PerspectiveCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), fov=20)])
def test_depth_is_the_distance_along_the_view(gpu, camera):
    shade = Object(plane(side=4.0, y=5.0), MATTE)
    got = image(gpu, lit(DOWN, camera=camera, extra=(shade,)))
    depth = got.aovs["depth"][..., 0]
    assert depth[0, 0] == pytest.approx(50, rel=1e-5) and depth[32, 32] == pytest.approx(45, rel=1e-5)
    np.testing.assert_allclose(got.aovs["normal"], np.broadcast_to([0, 1, 0], (64, 64, 3)), atol=1e-3)


def test_the_background_is_transparent_and_infinitely_far(gpu):
    got = image(gpu, lit(DOWN, mesh=plane(side=4.0)))
    assert got.pixels[0, 0].tolist() == [0, 0, 0, 0] and got.display[0, 0].tolist() == [0, 0, 0, 0]
    assert np.isinf(got.aovs["depth"][0, 0, 0])


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        ("none", lambda c: np.minimum(c, 1)),
        ("reinhard", lambda c: c / (1 + c)),
        ("aces", lambda c: np.clip(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0, 1)),
    ],
)
def test_exposure_tone_curve_and_srgb(gpu, curve, expected):
    scene = replace(lit(DOWN), tone_map=curve, exposure=-1.0)
    got = image(gpu, scene)
    c = expected(0.5 * got.pixels[0, 0, :3].astype(float))
    encoded = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(got.display[0, 0, :3], 255 * encoded, atol=0.6)


def test_extreme_radiance_is_white(gpu):
    blinding = DirectionalLight((0, -1, 0), (1e12, 1e12, 1e12))
    assert (image(gpu, replace(lit(blinding), tone_map="aces")).display == 255).all()


def test_an_open_sheet_lit_from_behind_shows_its_lit_back(gpu):
    below = replace(ABOVE, eye=(0, -50, 0))
    got = image(gpu, lit(DirectionalLight((0, 1, 0), (1, 1, 1)), camera=below))
    np.testing.assert_allclose(got.aovs["normal"][..., 1], -1, atol=1e-3)
    np.testing.assert_allclose(got.aovs["irradiance"][..., 0], 1, rtol=1e-4)


def test_normal_map_bends_towards_its_texture_axes(gpu):
    """A texel of (1, 0.5, 0.5) tilts the normal along u, one of (0.5, 1, 0.5) against v: green points up."""
    for texel, axis, sign in (((230, 128, 205), 0, 1), ((128, 230, 205), 2, -1)):
        maps = replace(MATTE.maps, normal=np.array([[texel]], np.uint8))
        n = image(gpu, lit(DOWN, material=replace(MATTE, maps=maps))).aovs["normal"]
        slope = (texel[0 if axis == 0 else 1] - 128) / (205 - 128)
        np.testing.assert_allclose(n[..., axis] / n[..., 1], sign * slope, rtol=0.02)


def test_base_color_and_specular_maps(gpu):
    color = np.zeros((1, 4, 3), np.uint8)
    color[0, :2] = (188, 0, 0)  # sRGB 188 is linear 0.5
    color[0, 2:] = (0, 255, 0)
    maps = replace(WHITE.maps, base_color=color, specular=np.array([[0, 0, 255, 255]], np.uint8))
    got = image(gpu, lit(DOWN, material=replace(WHITE, maps=maps)))
    left, right = (
        got.aovs["M_front"][32, 8] / got.aovs["irradiance"][32, 8],
        got.aovs["M_front"][32, 56] / got.aovs["irradiance"][32, 56],
    )
    np.testing.assert_allclose(left, [0.5 * 0.9, 0, 0], atol=5e-3)
    np.testing.assert_allclose(right, [0, 0.5, 0], atol=5e-3)
    assert got.aovs["specular"][32, 8, 0] == 0 < got.aovs["specular"][32, 56, 0]


def test_objects_hide_each_other_and_keep_their_materials(gpu):
    other = replace(MATTE, gaussians=None, sigma_a=(0.1, 0.1, 0.1), sigma_s_prime=(1, 1, 1))
    shade = Object(plane(side=4.0, y=0.0), other, translate=(0, 5, 0))
    got = image(gpu, lit(DOWN, extra=(shade,)))
    ratio = got.aovs["M_front"] / got.aovs["irradiance"]
    np.testing.assert_allclose(ratio[0, 0], MATTE.profile.total, rtol=1e-4)
    np.testing.assert_allclose(ratio[32, 32], other.profile.total, rtol=1e-4)


def test_normals_rotate_with_their_object(gpu):
    tilted = Mesh(plane().positions, plane().faces)
    scene = lit(DOWN, mesh=tilted)
    scene = replace(scene, objects=(Object(tilted, MATTE, rotate=(0, 0, 30)),))
    got = image(gpu, scene)
    np.testing.assert_allclose(got.aovs["irradiance"][32, 32, 0], 2 * np.cos(np.radians(30)), rtol=1e-4)
