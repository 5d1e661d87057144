"""Texture-space diffusion against closed forms: a shadow's edge, uniform light, chart borders, vanishing width."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import MATTE, lit, plane
from scipy.stats import norm

from wgsss import frame as shared
from wgsss.graph import Graph
from wgsss.methods import texture_space
from wgsss.methods.lambert import Lambert
from wgsss.methods.texture_space import TextureSpace
from wgsss.optics import SKIN_GAUSSIANS, SumOfGaussians
from wgsss.rendering import Renderer
from wgsss.scene import MATERIALS, DirectionalLight, EnvironmentLight, Mesh, Object, OrthographicCamera
from wgsss.scene.shapes import capsule, ear, slab, sphere
from wgsss.stage import Stage

SKIN = replace(MATTE, gaussians=SKIN_GAUSSIANS)
MARBLE = replace(MATERIALS["marble"], specular=0.0)
DOWN = DirectionalLight((0, -1, 0), (1, 1, 1))
ABOVE = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=16)
# It looks under the shade from the lit side: along the image's rows, x is foreshortened by the root of 2.
BESIDE = OrthographicCamera((50, 50, 0), (0, 0, 0), up=(0, 0, -1), height=10)
SIZE = 256


def half_shade(angle: float = 0.0) -> Object:
    """Return a sheet over the half x < 0, rotated by `angle` degrees about y."""
    half = Mesh(plane(side=60.0).positions + np.float32([-30, 15, 0]), plane().faces)
    return Object(half, MATTE, rotate=(0, angle, 0))


def with_uvs(mesh: Mesh, angle: float, stretch: float) -> Mesh:
    """Return the plane's texture coordinates rotated and stretched, inside the unit square."""
    a = np.radians(angle)
    t = (mesh.corner_uvs - 0.5) @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    t = t * [1, 1 / stretch]
    return replace(mesh, corner_uvs=(t / (2.05 * np.abs(t).max()) + 0.5).astype(np.float32))


def edge_difference(gpu, mesh, map_size, material=MARBLE, rotate=(0, 0, 0), angle=0.0, shift=0.0):
    """(SIZE, SIZE, 3): difference from the step's convolution, of the profile's total, in a square of 10 mm about the
    edge. The mesh is moved by `shift` mm along x, the edge is not."""
    scene = lit(DOWN, mesh=mesh, material=material, camera=BESIDE)
    placed = replace(scene.objects[0], rotate=rotate, translate=(shift, 0, 0))
    scene = replace(scene, objects=(placed, half_shade(angle)))
    renderer = Renderer(scene, TextureSpace(map_size=map_size), (SIZE, SIZE), gpu)
    M = renderer.frame(aovs=["M_front"]).aovs["M_front"]
    profile = renderer.method.profile(renderer.stage.bodies[0])
    t = ((np.arange(SIZE) + 0.5) / SIZE - 0.5) * BESIDE.height
    x, z = np.meshgrid(np.sqrt(2) * t, t)
    a = np.radians(angle)
    expected = profile.step_response(x * np.cos(a) - z * np.sin(a))
    return (M - expected) / profile.total


def edge_error(gpu, mesh, map_size, *rest, **more):
    """Return the largest of these differences."""
    return np.abs(edge_difference(gpu, mesh, map_size, *rest, **more)).max()


# A texel of the slab's large faces is 0.17 mm at 512; the narrowest Gaussian of marble has a sigma of 0.15 mm.
@pytest.mark.parametrize("map_size", [512, 1024, 2048])
def test_edge_on_the_slab(gpu, map_size):
    top = slab(size=(40, 40, 4))
    lowered = Mesh(top.positions - np.float32([0, 0, 2]), top.faces, top.corner_normals, top.corner_uvs)
    assert edge_error(gpu, lowered, map_size, rotate=(-90, 0, 0)) < 0.01


@pytest.mark.parametrize(("stretch", "side"), [(1, 40), (4, 20)])
@pytest.mark.parametrize("angle", [0, 30, 45, 100])
def test_edge_with_any_chart_orientation_and_stretch(gpu, angle, stretch, side):
    assert edge_error(gpu, with_uvs(plane(side, cells=4), angle, stretch), 1024) < 0.01


@pytest.mark.parametrize("angle", [30, 45])
def test_edge_at_an_angle_to_the_blurs(gpu, angle):
    assert edge_error(gpu, plane(cells=4), 1024, angle=angle) < 0.01


def test_edge_by_gaussians_to_their_ends(gpu):
    """If the Gaussian were cut off at two sigmas instead of three, the error would be 0.02."""
    for variances in ([4.0], [1.0, 4.0]):
        weights = np.eye(len(variances))[-1][:, None] * [0.9, 0.5, 0.1]
        wax = replace(MATTE, gaussians=SumOfGaussians(np.array(variances), weights))
        assert edge_error(gpu, plane(cells=4), 512, wax) < 0.007


def test_edge_by_a_gaussian_of_a_texel(gpu):
    """Beside it counts what maps blur by themselves, which depends on where in a texel the edge is: in the mean over
    four places. It would be off by 0.016 if a texel were taken to be a point."""
    fine = replace(MATTE, gaussians=SumOfGaussians(np.array([0.04]), np.array([[0.9, 0.5, 0.1]])))
    texel = 40.0 / (0.98 * 256)
    found = [edge_difference(gpu, plane(cells=4), 256, fine, shift=0.25 * k * texel) for k in range(4)]
    assert np.abs(np.mean(found, axis=0)).max() < 0.014


def test_edge_where_the_directions_of_a_blur_are_undefined(gpu):
    """The surface faces the axis that they turn about, but for bumps of 0.01 mm: they are any. With other axes for
    other Gaussians that is so for a third of them; with one for all it would be off by 0.035."""
    flat = plane(cells=40)
    bumps = np.random.default_rng(1).normal(0.0, 0.01, len(flat.positions))[:, None] * [0, 1, 0]
    bumpy = replace(flat, positions=(flat.positions + bumps).astype(np.float32))
    assert edge_error(gpu, bumpy, 512) < 0.025


def test_edge_on_skin(gpu):
    """The narrowest Gaussian has a sigma of 0.08 mm, two texels here; on coarser maps the error of blue is larger."""
    assert edge_error(gpu, plane(cells=4), 1024, SKIN) < 0.015


def test_edge_on_a_material_with_variances_of_its_own_per_channel(gpu):
    """The blurs need variances that the channels share: they are fitted."""
    own = SumOfGaussians(np.array([[0.1, 0.2, 0.3], [3.0, 2.0, 1.0]]), np.array([[0.5, 0.2, 0.7], [0.1, 0.2, 0.3]]))
    assert edge_error(gpu, plane(cells=4), 512, replace(MATTE, gaussians=own)) < 0.015


def diffused_map(gpu, scene, monkeypatch, map_size=512):
    """Return M_front over the atlas, with maps of one size for all Gaussians; the render mesh; and its charts."""
    monkeypatch.setattr(texture_space, "MOST_HALVINGS", 0)
    stage = Stage(gpu, scene)
    method = TextureSpace(map_size=map_size)
    method.bake(stage)
    body = stage.bodies[0]
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (8, 8))
    maps = method.blurs(frame, body)
    graph.run(*maps)
    M = frame.lighting.unit * sum(
        graph.read(m)[..., :3].astype(float) * w for m, w in zip(maps, SKIN_GAUSSIANS.weights, strict=True)
    )
    return M, body.unwrap(), texture_space.atlas(body, map_size)


@pytest.mark.parametrize(
    "mesh", [plane(), slab(), sphere(10.0, 2000), ear(2000)], ids=["plane", "slab", "sphere", "ear"]
)
def test_uniform_light_stays_uniform(gpu, mesh, monkeypatch):
    """At chart borders, open ones included, the light neither increases nor decreases."""
    monkeypatch.setattr("wgsss.stage.sky_visibility", lambda scene, lights, positions, normals: np.ones(len(positions)))
    M, _, charts = diffused_map(gpu, lit(EnvironmentLight((1, 1, 1)), mesh=mesh, material=SKIN), monkeypatch)
    used = gpu.read_texture(charts.ids)[..., 0] > 0
    lost = used & ~M.any(axis=2)  # texels without a value at a chart's corner, which are left out when the map is read
    assert lost.sum() < 1e-5 * used.sum()
    found = M[used & ~lost]
    np.testing.assert_allclose(found, np.broadcast_to(np.pi * SKIN_GAUSSIANS.total, found.shape), rtol=4e-3)


def test_chart_borders_of_a_sphere_are_invisible(gpu, monkeypatch):
    """The light's terminator crosses the borders of xatlas' charts; sampled at the same point from both sides, M must
    differ by no more than it does from texel to texel within a chart."""
    from scipy.ndimage import map_coordinates

    mesh = sphere(20.0, 4000)
    scene = lit(DirectionalLight((-0.7, -0.5, -0.5), (1, 1, 1)), mesh=mesh, material=SKIN)
    M, surface, charts = diffused_map(gpu, scene, monkeypatch)
    ids = gpu.read_texture(charts.ids)[..., 0]
    inside = ids >= 1 << 31
    jumps = []
    for axis in (0, 1):
        same = inside & (np.roll(ids, -1, axis) == ids)
        jumps.append(np.abs(np.roll(M, -1, axis) - M).max(axis=2)[same].max())
    rows, columns = (surface.atlas[:, ::-1] * 512 - 0.5).T
    at_vertex = np.stack([map_coordinates(M[..., c], [rows, columns], order=1) for c in range(3)], axis=1)
    highest, lowest = np.full((len(mesh.positions), 3), -np.inf), np.full((len(mesh.positions), 3), np.inf)
    np.maximum.at(highest, surface.vertex, at_vertex)
    np.minimum.at(lowest, surface.vertex, at_vertex)
    count = np.bincount(surface.vertex)
    assert (count > 1).sum() > 50, "the sphere should have borders"
    across = (highest - lowest)[count > 1].max()
    assert across <= 2 * max(jumps), f"{across:.4f} across borders, {max(jumps):.4f} inside charts"


def test_wide_blurs_cross_jagged_borders_correctly(gpu):
    """M is constant along a cylinder lit from the side, although xatlas cuts it into strips with jagged borders."""
    wide = replace(MATTE, gaussians=SumOfGaussians(np.array([0.2, 9.0]), np.array([[0.3] * 3, [0.6] * 3])))
    camera = OrthographicCamera((0, 0, 50), (0, 0, 0), height=24)
    rod = capsule(length=80.0, radius=9.0, vertices=3000)
    rod = rod.deformed(rod.positions - np.float32([0, rod.bounds.mean(axis=0)[1], 0]))
    scene = lit(DirectionalLight((-1, 0, -0.2), (1, 1, 1)), mesh=rod, material=wide, camera=camera)
    M = Renderer(scene, TextureSpace(map_size=1024), (96, 96), gpu).frame(aovs=["M_front"]).aovs["M_front"]
    inside = M[:, 20:76, 0]  # away from the silhouette, where a pixel sees several millimetres
    assert np.abs(inside - inside.mean(axis=0)).max() < 0.01


def test_blurs_go_round_a_thin_bar(gpu, monkeypatch):
    """One of four faces is lit. Light spreads by 2 mm over a perimeter of 6 mm, so that taps cross up to four edges."""
    monkeypatch.setattr(texture_space, "MOST_HALVINGS", 0)
    wide = replace(MATTE, gaussians=SumOfGaussians(np.array([4.0]), np.ones((1, 3))))
    bar = slab(size=(1.5, 22.0, 1.5), vertices=1000)
    for towards, middle in (((0, 0, 50), 0.0), ((50, 0, 0), 1.5), ((0, 0, -50), 3.0)):
        camera = OrthographicCamera(towards, (0, 0, 0), height=1.2)
        scene = lit(DirectionalLight((0, 0, -1), (1, 1, 1)), mesh=bar, material=wide, camera=camera)
        M = Renderer(scene, TextureSpace(map_size=512), (16, 16), gpu).frame(aovs=["M_front"]).aovs["M_front"]
        s = middle + ((np.arange(16) + 0.5) / 16 - 0.5) * camera.height + 6.0 * np.arange(-3, 4)[:, None]
        expected = (norm.cdf((s + 0.75) / 2) - norm.cdf((s - 0.75) / 2)).sum(axis=0)
        np.testing.assert_allclose(M[..., 0], np.broadcast_to(expected, (16, 16)), rtol=0.04)


def test_vanishing_width_is_lambert(gpu):
    narrow = replace(MATTE, gaussians=SumOfGaussians(np.array([1e-8]), np.array([[0.9, 0.5, 0.1]])))
    scene = lit(
        DirectionalLight((1, -1, 0.3), (1, 2, 3)),
        mesh=sphere(5.0, 3000),
        material=narrow,
        camera=replace(ABOVE, height=8),
    )
    blurred = Renderer(scene, TextureSpace(), (64, 64), gpu).frame(aovs=["M_front"]).aovs["M_front"]
    sharp = Renderer(scene, Lambert(), (64, 64), gpu).frame(aovs=["M_front"]).aovs["M_front"]
    np.testing.assert_allclose(blurred, sharp, rtol=0.02, atol=0.02)


@pytest.mark.parametrize("power", [1e-9, 1.0, 1e6])
def test_faint_and_bright_light_give_the_same_picture(gpu, power):
    """Half floats range from 1e-7 to 65504: the maps are in a unit near the scene's irradiance."""
    pictures = []
    for level in (1.0, power):
        light = DirectionalLight((-1, -0.5, 0.2), (level, level, level))
        scene = lit(light, mesh=sphere(10.0, 1000), material=SKIN, camera=replace(ABOVE, height=24))
        image = Renderer(scene, TextureSpace(map_size=128), (48, 48), gpu).frame(aovs=["M_front"])
        pictures.append(image.aovs["M_front"] / level)
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=2e-3, atol=1e-4)


def test_the_base_colour_may_be_applied_before_or_after(gpu):
    """On a checker, colour after diffusion keeps its edge, colour before is blurred; both keep the mean."""
    checker = np.zeros((1, 128, 3), np.uint8)
    checker[0, :64] = 255
    wide = SumOfGaussians(np.array([4.0]), np.ones((1, 3)))
    sides = {}
    for share in (0.0, 1.0):
        material = replace(
            MATTE, gaussians=wide, color_after=share, maps=replace(MATTE.maps, base_color=np.repeat(checker, 64, 1))
        )
        scene = lit(DOWN, material=material, mesh=plane(cells=2), camera=ABOVE)
        image = Renderer(scene, TextureSpace(), (64, 64), gpu).frame(aovs=["M_front"])
        sides[share] = image.aovs["M_front"][32, :, 0]
    assert np.abs(np.diff(sides[1.0])).max() > 0.4
    assert np.abs(np.diff(sides[0.0])).max() < 0.1
    assert sides[0.0].mean() == pytest.approx(sides[1.0].mean(), rel=0.02)


def test_same_scene_same_bits(gpu):
    scene = lit(DOWN, mesh=sphere(10.0, 1000), material=SKIN, camera=replace(ABOVE, height=24))
    renderer = Renderer(scene, TextureSpace(map_size=128), (48, 48), gpu)
    first = renderer.frame(timed=False)
    for i in range(20):
        if i % 10 == 9:  # a new stage and new buffers
            renderer = Renderer(scene, TextureSpace(map_size=128), (48, 48), gpu)
        again = renderer.frame(timed=bool(i % 2))
        assert again.pixels.tobytes() == first.pixels.tobytes() and again.display.tobytes() == first.display.tobytes()
