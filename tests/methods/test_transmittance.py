"""Transmittance through plates and balls whose thickness is known, under every kind of light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import ABOVE, MATTE, WHITE, lit, plane
from scipy.integrate import trapezoid

from wgsss.frame import begin
from wgsss.graph import Graph
from wgsss.methods.transmittance import table
from wgsss.optics import SKIN_GAUSSIANS, Dipole, SumOfGaussians
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Mesh,
    Object,
    OrthographicCamera,
    PointLight,
    RectLight,
)
from wgsss.scene.shapes import sphere

SKIN = replace(MATTE, gaussians=SKIN_GAUSSIANS)
WEIGHTS = np.array([0.9, 0.5, 0.1])
WIDE = replace(MATTE, gaussians=SumOfGaussians(np.array([20.0]), WEIGHTS[None]))
UP = DirectionalLight((0, 1, 0), (1, 2, 3))
RADIUS = np.sqrt(40 * np.log(2))  # mm: half of WIDE's light leaves within
TEXEL = 60 / 2048  # mm, or a little less: of the shadow maps here


def plate(thickness: float, side: float = 40.0) -> Mesh:
    """Two squares, the upper one at y = 0 facing up, the lower one facing down."""
    top, bottom = plane(side), plane(side, y=-thickness)
    faces = np.concatenate([top.faces, bottom.faces[:, ::-1] + len(top.positions)])
    return Mesh(np.concatenate([top.positions, bottom.positions]), faces)


def through(gpu, scene, method="none+transmittance", size=32):
    """Return M_back."""
    image = Renderer(scene, make_method(method), (size, size), gpu).frame(aovs=["M_back"], timed=False)
    return image.aovs["M_back"]


def floor_points(size=32, height=20.0):
    """Return the points of y = 0 at the pixels of ABOVE."""
    t = ((np.arange(size) + 0.5) / size - 0.5) * height
    x, z = np.meshgrid(t, t)
    return np.stack([x, np.zeros_like(x), z], axis=-1)


def thickness_by(M, E):
    """Return the thickness of WIDE at which it transmits M of E."""
    return np.sqrt(-40.0 * np.log(M / (WEIGHTS * E)))


def depth_in_a_plate(thickness, cosine, distance=np.inf):
    """Along a ray to a light at `distance`, which passes x_o as far below as WIDE asks for."""
    shrink = RADIUS * (1 - cosine**2)
    lowered = cosine - shrink / distance
    return (thickness - shrink) / (lowered / np.hypot(lowered, np.sqrt(1 - cosine**2))) + shrink * cosine


def test_table_is_the_sum_over_gaussians():
    thickness, share = table(SKIN_GAUSSIANS)
    d = np.linspace(0, 12, 700)
    read = np.stack([np.interp(np.sqrt(d), np.sqrt(thickness), column) for column in share.T], axis=-1)
    v, w = SKIN_GAUSSIANS.variances, SKIN_GAUSSIANS.weights
    np.testing.assert_allclose(read, np.exp(-(d[:, None] ** 2) / (2 * v)) @ w, atol=2e-4)
    assert share[0] == pytest.approx(1.0) and (share[-1] == 0).all() and (np.diff(share, axis=0) <= 0).all()


def test_table_of_a_dipole_is_its_integral_over_a_plane():
    medium = Dipole((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.3)
    thickness, share = table(medium)
    r = np.geomspace(1e-4, 300, 20_000)
    for d in (0.5, 2.0, 6.0):
        ring = 2 * np.pi * r[:, None] * medium.reflectance(np.hypot(r, d))
        plane_at_d = trapezoid(ring, r, axis=0)
        read = [np.interp(d, thickness, column) for column in share.T] * medium.total
        np.testing.assert_allclose(read, plane_at_d, rtol=0.01, atol=2e-5)


@pytest.mark.parametrize("thickness", [0.3, 1.0, 4.0])
def test_a_plate_lit_straight_from_behind(gpu, thickness):
    M = through(gpu, lit(UP, mesh=plate(thickness), material=SKIN, camera=ABOVE))
    T = np.exp(-(thickness**2) / (2 * SKIN_GAUSSIANS.variances)) @ SKIN_GAUSSIANS.weights
    expected = 1.3 * np.array([1, 2, 3]) * T  # max(0.3 - n.l, 0) is more than all of it
    np.testing.assert_allclose(M, np.broadcast_to(expected, M.shape), rtol=0.01, atol=1e-3)


@pytest.mark.parametrize("far", [0.0, 300.0])
@pytest.mark.parametrize("angle", [20, 50, 70])
def test_a_plate_lit_aslant(gpu, angle, far):
    """The result does not depend on the size of shadow texels, which a distant object increases."""
    a = np.radians(angle)
    light = DirectionalLight((np.sin(a), np.cos(a), 0), (1, 1, 1))
    beside = (Object(plane(side=4.0, y=-3.0), MATTE, translate=(0, 0, far)),) if far else ()
    M = through(gpu, lit(light, mesh=plate(6.0), material=WIDE, camera=ABOVE, extra=beside))
    found = thickness_by(M, 0.3 + np.cos(a))
    np.testing.assert_allclose(found, depth_in_a_plate(6.0, np.cos(a)), atol=3 * TEXEL / np.cos(a))
    assert np.ptp(found) < 1e-3 * found.mean(), "no grain"


def test_a_wedge_lit_straight_from_behind(gpu):
    """Thickness is not shifted, not even by a tenth of a texel; at the edge of the wedge half of the rays miss it."""
    flat = plate(3.0, side=14.0)
    x, y, z = flat.positions.T
    wedge = Mesh(np.stack([x, np.where(y < 0, y + 0.3 * x, y), z], axis=1), flat.faces)
    for middle in (0.0, 7.0):
        camera = replace(ABOVE, eye=(middle, 50, 0), target=(middle, 0, 0), height=0.08)
        scene = lit(DirectionalLight((0, 1, 0), (1, 1, 1)), mesh=wedge, material=WIDE, camera=camera)
        x = middle + floor_points(height=0.08)[16, :, 0]
        on = x < 7
        found = thickness_by(through(gpu, scene)[16, on], 1.3)
        inner = x[on] < 7 - 2 * 15 / 2048
        np.testing.assert_allclose(found[inner], np.outer(3.0 - 0.3 * x[on][inner], np.ones(3)), atol=3e-4)
        assert found.min() > 0.6


@pytest.mark.parametrize("angle", [6, 10, 16, 30, 60])
def test_the_lit_side_receives_hardly_any_light(gpu, angle):
    """This holds although E is 0 only from 17.5 degrees above the surface."""
    a = np.radians(angle)
    light = DirectionalLight((-np.cos(a), -np.sin(a), 0), (1, 1, 1))
    assert through(gpu, lit(light, mesh=plate(3.0), material=SKIN, camera=ABOVE)).max() < 5e-3


@pytest.mark.parametrize("depth", [60.0, 12.0, 400.0])
def test_point_lights(gpu, depth):
    """Seen by one view of the scene, from amid it by a cube, whose faces meet where its light is at 45 degrees, and
    from so far away that rays are parallel."""
    light = PointLight((0, -depth, 0), intensity=(1, 1, 1))
    if depth == 400.0:
        light = PointLight((0, -1e5, 0), intensity=(1e4, 1e4, 1e4))
    below = Object(plane(side=40.0, y=-30.0), MATTE)
    scene = lit(light, mesh=plate(6.0), material=WIDE, camera=ABOVE, extra=(below,) if depth == 12.0 else ())
    way = floor_points() - light.position
    distance = np.linalg.norm(way, axis=-1, keepdims=True)
    cosine = way[..., 1:2] / distance
    E = light.intensity * (0.3 + cosine) / (distance / 1000) ** 2
    found = thickness_by(through(gpu, scene), E)
    np.testing.assert_allclose(
        found, np.broadcast_to(depth_in_a_plate(6.0, cosine, distance), found.shape), atol=4 * TEXEL
    )


def test_the_face_of_a_cube_is_that_of_the_moved_point(gpu):
    """Through a wedge: between 5 and 8 mm from above the light, another face would see x_o."""
    flat, light = plate(6.0), PointLight((0, -8, 0), intensity=(1, 1, 1))
    x, y, z = flat.positions.T
    wedge = Mesh(np.stack([x, np.where(y < 0, y + 0.2 * x, y), z], axis=1), flat.faces)
    below = Object(plane(side=40.0, y=-30.0), MATTE)
    way = floor_points() - light.position
    distance = np.linalg.norm(way, axis=-1, keepdims=True)
    cosine = way[..., 1:2] / distance
    shrink = RADIUS * (1 - cosine**2)
    ray = way - shrink * [0, 1, 0]
    outside = 2.0 / (ray[..., 1:2] - 0.2 * ray[..., :1])  # the share of the ray before y = 0.2 x - 6
    expected = np.linalg.norm(ray, axis=-1, keepdims=True) * (1 - outside) + shrink * cosine
    M = through(gpu, lit(light, mesh=wedge, material=WIDE, camera=ABOVE, extra=(below,)))
    found = thickness_by(M, (0.3 + cosine) / (distance / 1000) ** 2)
    on = (np.abs(way[..., [0, 2]]).max(axis=-1) < 8) & (ray[..., 1] > 3.5)
    np.testing.assert_allclose(found[on], np.broadcast_to(expected[on], found[on].shape), atol=4 * TEXEL)
    crossed = on & (np.abs(way[..., [0, 2]]).max(axis=-1) > ray[..., 1])
    assert crossed.sum() > 100


def test_points_are_moved_by_shadow_texels_that_grow_with_distance(gpu):
    """Lit aslant from in front, by one face of a cube: 60 mm away a texel is 0.06 mm wide."""
    beyond = Object(plane(side=40.0, y=-30.0), MATTE, translate=(100, 0, 0))
    light = PointLight((60, 15, 0), intensity=(1, 1, 1))
    scene = lit(light, mesh=plate(30.0, side=60.0), material=WIDE, camera=ABOVE, extra=(beyond,))
    way = floor_points() - light.position
    distance = np.linalg.norm(way, axis=-1, keepdims=True)
    cosine = -way[..., 1:2] / distance
    texels, grazing = 2 * np.sqrt(1 - cosine**2) * (2 / 2048 * distance), RADIUS * (1 - cosine**2)
    shrink = texels + grazing
    lowered = np.linalg.norm(way - shrink * [0, 1, 0], axis=-1, keepdims=True)
    expected = lowered * shrink / (15 + shrink) + texels / 0.3 - grazing * cosine
    E = (0.3 - cosine) / (distance / 1000) ** 2
    on = ((expected < 17) & (cosine < 0.29))[..., 0]
    assert on.sum() > 100
    found = thickness_by(through(gpu, scene)[on], E[on])
    np.testing.assert_allclose(found, np.broadcast_to(expected[on], found.shape), atol=0.02)


def test_area_lights(gpu):
    light = RectLight((0, -40, 0), (0, 1, 0), (0, 0, 1), 30, 20, radiance=(50, 40, 30), samples=24)
    M = through(gpu, lit(light, mesh=plate(6.0), material=WIDE, camera=ABOVE))
    x, z = np.meshgrid(*((np.arange(60) + 0.5) / 60 * side - side / 2 for side in (30, 20)))
    for row, column in ((16, 16), (3, 28)):
        x_o = floor_points()[row, column]
        way = x_o - np.stack([x, np.full_like(x, -40), z], axis=-1)
        distance = np.linalg.norm(way, axis=-1)
        cosine = way[..., 1] / distance
        T = np.exp(-(depth_in_a_plate(6.0, cosine, distance) ** 2) / 40)
        E = cosine / distance**2 * (0.3 + cosine) * T * (30 * 20 / x.size)
        np.testing.assert_allclose(M[row, column], WEIGHTS * [50, 40, 30] * E.sum(), rtol=0.02)


def test_a_ball_lit_from_aside(gpu):
    """Thickness is the chord of a ball. Up to where the light grazes it there is neither noise nor a step."""
    light = DirectionalLight((-1, 0, 0), (1, 1, 1))
    M = through(gpu, lit(light, mesh=sphere(8.0, 40_000), material=WIDE, camera=ABOVE), size=200)[100, :, 0]
    x = ((np.arange(200) + 0.5) / 200 - 0.5) * 20
    on = (x > -7.2) & (x < 2.2)
    cosine = -x[on] / 8.0  # 0 where the light grazes the ball: it comes from +x
    sine = np.sqrt(1 - cosine**2)
    depth = 8.0 * cosine + np.sqrt(64 - (8.0 - RADIUS * sine**2) ** 2 * sine**2)
    np.testing.assert_allclose(M[on] / WEIGHTS[0], np.exp(-(depth**2) / 40) * (0.3 + cosine), atol=0.004)
    assert np.abs(np.diff(M[on], n=2)).max() < 0.002


def test_a_ball_of_skin_has_no_noise(gpu):
    """Where the light grazes it, a shadow texel's depth is more than the narrowest Gaussian."""
    scene = lit(DirectionalLight((-1, 0, 0), (1, 1, 1)), mesh=sphere(8.0, 40_000), material=SKIN, camera=ABOVE)
    M = through(gpu, scene, size=200)[60:140, 30:118]
    assert np.abs(np.diff(M, n=2, axis=1)).max() < 0.01 and np.abs(np.diff(M, axis=0)).max() < 0.01
    assert M.max() > 0.01


def test_the_back_transmits_as_much_as_the_front(gpu):
    """rho_dt is that of the angle of incidence assumed at the back, as it is for lambert at the front."""
    a, grazing = np.radians(80), np.arcsin(0.3 + np.cos(np.radians(80)))
    behind = DirectionalLight((np.sin(a), np.cos(a), 0), (1, 1, 1))
    before = DirectionalLight((np.cos(grazing), -np.sin(grazing), 0), (1, 1, 1))
    material = replace(WHITE, gaussians=SumOfGaussians(np.array([2000.0]), WEIGHTS[None]))
    M = through(gpu, lit(behind, mesh=plate(0.5), material=material, camera=ABOVE))
    front = lit(before, mesh=plate(0.5), material=material, camera=ABOVE)
    lambert = Renderer(front, make_method("lambert"), (32, 32), gpu).frame(aovs=["M_front"], timed=False)
    np.testing.assert_allclose(M, lambert.aovs["M_front"], rtol=0.005)


def test_the_sky_alone_has_no_passes(gpu):
    scene = lit(EnvironmentLight((1, 1, 1)), mesh=plate(1.0), material=WIDE, camera=ABOVE)
    for name in ("none+transmittance", "jimenez15"):
        image = Renderer(scene, make_method(name), (16, 16), gpu).frame(aovs=["M_back"], timed=False)
        assert (image.aovs["M_back"] == 0).all()
        blurs = [item for item in image.graph.passes if item.module.name == "screen_space/blur"]
        assert not any(item.module.name.startswith("transmittance") for item in image.graph.passes)
        assert len(blurs) == (2 if name == "jimenez15" else 0)  # none for a sum, none for M_back


def test_a_distant_object_in_front_blocks_the_light(gpu):
    sheet = Object(plane(side=40.0, y=-40.0), MATTE)
    assert through(gpu, lit(UP, mesh=plate(1.0), material=SKIN, camera=ABOVE, extra=(sheet,))).max() < 1e-8


def test_an_object_that_nearly_touches_counts_as_a_part(gpu):
    """Both plates are visible, each with its own profile."""
    lower = Object(plate(2.0, side=60.0), WIDE, translate=(0, -2.5, 0))
    wide = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=56)
    M = through(gpu, lit(UP, mesh=plate(2.0), material=SKIN, camera=wide, extra=(lower,)), size=56)
    skin = np.exp(-(4.5**2) / (2 * SKIN_GAUSSIANS.variances)) @ SKIN_GAUSSIANS.weights
    np.testing.assert_allclose(M[28, 28], 1.3 * np.array([1, 2, 3]) * skin, rtol=0.01, atol=1e-3)
    np.testing.assert_allclose(M[2, 2], 1.3 * np.array([1, 2, 3]) * WEIGHTS * np.exp(-4 / 40), rtol=0.01)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("surface", ["none", "screen"])
def test_the_base_colour_is_that_of_the_pixel(gpu, surface, share):
    colour = (0.5, 1.0, 0.25)
    material = replace(WIDE, base_color=colour, color_after=share)
    M = through(gpu, lit(UP, mesh=plate(1.0), material=material, camera=ABOVE), f"{surface}+transmittance")
    expected = 1.3 * np.array([1, 2, 3]) * WEIGHTS * colour * np.exp(-1 / 40)
    np.testing.assert_allclose(M, np.broadcast_to(expected, M.shape), rtol=0.01)


def test_screen_space_blurs_the_transmitted_light(gpu):
    """Where a step of the plate's thickness throws an edge, which alone is sharp; nothing leaves the plate."""
    half = Mesh(plane(side=30.0, y=-14.0).positions - np.float32([15, 0, 0]), plane().faces)
    scene = lit(UP, mesh=plate(1.0, side=14.0), material=SKIN, camera=ABOVE, extra=(Object(half, MATTE),))
    sharp, soft = (through(gpu, scene, name, size=96)[..., 0] for name in ("none+transmittance", "jimenez15"))
    points = floor_points(96)
    off = (np.abs(points[..., [0, 2]]).max(axis=-1) > 7) & (points[..., 0] > 0)
    assert (soft[off] == 0).all() and (sharp[off] == 0).all()
    full = sharp[48, 78]
    x = points[48, :, 0]
    inner = np.abs(x) < 3
    response = SKIN_GAUSSIANS.step_response(x[inner])[:, 0]
    np.testing.assert_allclose(soft[48, inner], full * response, atol=0.03 * full)
    assert np.abs(np.diff(sharp[48])).max() > 0.5 * full


@pytest.mark.parametrize("kernel", ["line-spread", "svd"])
def test_one_blur_equals_the_sum_of_two(gpu, kernel):
    """The image has one blur; M_front and M_back are blurred separately where they are asked for."""
    half = Object(Mesh(plane(side=30.0, y=-14.0).positions - np.float32([15, 0, 0]), plane().faces), MATTE)
    other = Object(plate(1.0, side=6.0), WIDE, translate=(0, 3, 0))
    lights = (UP, DirectionalLight((0.5, -1, 0), (3, 2, 1)))
    scene = lit(*lights, mesh=plate(1.0, side=14.0), material=SKIN, camera=ABOVE, extra=(half, other))
    renderer = Renderer(scene, make_method("jimenez15", {"kernel": kernel}), (48, 48), gpu)
    image = renderer.frame(timed=False)
    apart = renderer.frame(aovs=["M_front", "M_back"], timed=False)
    blurs = [sum(p.module.name == "screen_space/blur" for p in shown.graph.ran) for shown in (image, apart)]
    assert blurs == [3 * 2 * (1 + (kernel == "svd")), 3 * blurs[0]]
    assert image.pixels.tobytes() == apart.pixels.tobytes()

    graph = Graph(gpu)
    found = renderer.method.passes(begin(graph, renderer.stage, (48, 48)))
    graph.run(found.together, found.M_front, found.M_back)
    together, front, back = (graph.read(part)[..., :3] for part in (found.together, found.M_front, found.M_back))
    np.testing.assert_allclose(together, front + back, rtol=1e-4, atol=1e-5)
    assert min(front.max(), back.max()) > 0.1 and found.M == (found.together,)


def test_channels_that_do_not_reflect(gpu):
    for weights in ([[0.5, 0.0, 0.2]], [[0.0, 0.0, 0.0]]):
        material = replace(MATTE, gaussians=SumOfGaussians(np.array([2.0]), np.array(weights)))
        M = through(gpu, lit(UP, mesh=plate(0.5), material=material, camera=ABOVE), "jimenez15")
        assert np.isfinite(M).all() and (M[..., np.array(weights[0]) == 0] == 0).all()


def test_same_scene_same_bits(gpu):
    light = PointLight((5, -60, 3), intensity=(1, 1, 1))
    scene = lit(light, mesh=sphere(5.0, 1000), material=SKIN, camera=ABOVE)
    first = through(gpu, scene, "jimenez15", 48)
    assert np.isfinite(first).all() and first.max() > 0
    for _ in range(3):
        assert through(gpu, scene, "jimenez15", 48).tobytes() == first.tobytes()
