"""Screen-space diffusion against closed forms: a shadow's edge, uniform light, depth steps, neighbours."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scenes import MATTE, lit, plane

from wgsss import frame as shared
from wgsss.errors import InputError
from wgsss.graph import Graph
from wgsss.methods.lambert import Lambert
from wgsss.methods.screen_space import ScreenSpace, Taps, taps_for
from wgsss.optics import SKIN_GAUSSIANS, SumOfGaussians
from wgsss.optics.separable import line_spread
from wgsss.rendering import Renderer
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Mesh,
    Object,
    OrthographicCamera,
    PerspectiveCamera,
)
from wgsss.scene.motion import BendAndSwell
from wgsss.scene.shapes import capsule, sphere
from wgsss.stage import Stage

SKIN = replace(MATTE, gaussians=SKIN_GAUSSIANS)
WIDE = replace(MATTE, gaussians=SumOfGaussians(np.array([2.0]), np.array([[0.9, 0.5, 0.1]])))
DOWN = DirectionalLight((0, -1, 0), (1, 1, 1))
# Of irradiance 1 on the floor; what it throws there from aside is not in the picture.
SLANTED = DirectionalLight((0, -1, -1), (2**0.5,) * 3)
ABOVE = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=16)


def shade(height: float = 40.0) -> Object:
    """Return a sheet that blocks SLANTED on the half x < 0 of the floor."""
    half = Mesh(plane(side=50.0).positions - np.float32([25, 0, 0]), plane().faces)
    return Object(half, MATTE, translate=(0, height, 40))


def floor(camera):
    """Of skin, as high as the camera's target."""
    height = camera.target[1]
    level = plane(side=60.0, y=height, cells=4)
    return lit(SLANTED, mesh=level, material=SKIN, camera=camera, extra=(shade(40 + height),))


def M_of(gpu, scene, method, size):
    return Renderer(scene, method, (size, size), gpu).frame(aovs=["M_front"], timed=False).aovs["M_front"]


def places(gpu, scene, size):
    """Return world position (H, W, 3) and object id of each pixel."""
    graph = Graph(gpu)
    frame = shared.begin(graph, Stage(gpu, scene), (size, size))
    graph.run(frame.gbuffer.depth, frame.gbuffer.gbuffer_id)
    depth = graph.read(frame.gbuffer.depth)[..., 0].astype(float)
    t = (np.arange(size) + 0.5) / size
    clip = np.stack(np.broadcast_arrays(2 * t - 1, 1 - 2 * t[:, None], depth, 1.0), axis=-1)
    x = clip @ np.asarray(frame.view.clip_to_world).T
    return x[..., :3] / x[..., 3:], graph.read(frame.gbuffer.gbuffer_id)[..., 2]


def edge_error(gpu, camera, method, size=128):
    """Largest difference (3,) from the edge's true response, of the profile's total, within 8 mm of the middle and away
    from the image's border."""
    scene = floor(camera)
    x, seen = places(gpu, scene, size)
    error = np.abs(M_of(gpu, scene, method, size) - SKIN_GAUSSIANS.step_response(x[..., 0])) / SKIN_GAUSSIANS.total
    inner = (seen == 1) & (np.abs(x[..., [0, 2]]) < 8).all(axis=2)
    margin = size // 4
    return np.where(inner[..., None], error, 0)[margin:-margin, margin:-margin].max(axis=(0, 1))


def turned(degrees: float, pixels_per_mm: float, size: int) -> OrthographicCamera:
    a = np.radians(degrees)
    return replace(ABOVE, up=(np.sin(a), 0, -np.cos(a)), height=size / pixels_per_mm)


@pytest.mark.parametrize(("pixels_per_mm", "most"), [(1, 0.01), (2, 0.01), (4, 0.02), (8, 0.03)])
@pytest.mark.parametrize("degrees", [0, 90])
def test_edge_along_a_pass(gpu, pixels_per_mm, most, degrees):
    camera = turned(degrees, pixels_per_mm, 128)
    assert edge_error(gpu, camera, ScreenSpace(taps=17)).max() < most


def test_edge_with_more_taps(gpu):
    assert edge_error(gpu, turned(0, 8, 128), ScreenSpace(taps=33)).max() < 0.012


@pytest.mark.parametrize("degrees", [0, 11.25, 22.5, 33.75, 45])
def test_edge_at_any_angle_to_the_passes_by_two_products(gpu, degrees):
    """Checked in red, the channel with the widest response."""
    camera = turned(degrees, 8, 192)
    assert edge_error(gpu, camera, ScreenSpace(taps=17, kernel="svd"), 192)[0] < 0.02


@pytest.mark.parametrize(("degrees", "line"), [(22.5, 0.062), (45, 0.074)])
def test_edge_at_an_angle_to_the_passes(gpu, degrees, line):
    camera = turned(degrees, 8, 192)
    assert edge_error(gpu, camera, ScreenSpace(taps=17), 192)[0] == pytest.approx(line, abs=0.006)


@pytest.mark.parametrize("pixels_per_mm", [2, 8])
def test_radial_kernel(gpu, pixels_per_mm):
    assert 0.15 < edge_error(gpu, turned(0, pixels_per_mm, 128), ScreenSpace(kernel="radial"))[0] < 0.25


@pytest.mark.parametrize("slope", [1.0, 2.0])
def test_edge_on_a_slanted_surface(gpu, slope):
    """Across the picture a millimetre spans fewer pixels; along the edge nothing may change."""
    camera = replace(turned(0, 8, 128), eye=(50 * slope, 50, 0))
    assert edge_error(gpu, camera, ScreenSpace(taps=33)).max() < 0.012


def test_passes_stay_at_right_angles_on_a_surface_slanted_both_ways(gpu):
    """The picture's rows run along the edge; its columns, on the floor, meet them at 60 degrees."""
    back, edge = np.array([1, 1, -1]) / np.sqrt(3), np.array([0, 0, 1])
    right = edge - back * (back @ edge)
    camera = OrthographicCamera(tuple(50 * back), (0, 0, 0), up=tuple(np.cross(back, right)), height=16)
    assert edge_error(gpu, camera, ScreenSpace(taps=33)).max() < 0.012


@pytest.mark.parametrize("side", [1, -1])
def test_edge_seen_in_perspective(gpu, side):
    """Away from the camera millimetres span fewer pixels, and fewer still for the slope: 8 to 5 in the middle half."""
    camera = PerspectiveCamera((25.0 * side, 125, 0), (0, 100, 0), up=(0, 0, side), fov=25)
    assert edge_error(gpu, camera, ScreenSpace(taps=33)).max() < 0.03


@pytest.mark.parametrize("kernel", ["line-spread", "svd", "radial"])
def test_uniform_light(gpu, kernel):
    """On a plane up to its border the light neither increases nor decreases."""
    scene = lit(DirectionalLight((0, -1, 0), (3, 2, 1)), mesh=plane(side=10.0), material=SKIN, camera=ABOVE)
    M = M_of(gpu, scene, ScreenSpace(kernel=kernel), 96)
    on = np.abs(places(gpu, scene, 96)[0][..., [0, 2]]).max(axis=2) < 5
    np.testing.assert_allclose(M[on], np.broadcast_to([3, 2, 1], M[on].shape), rtol=1e-3)
    assert (M[~on] == 0).all() and not on.all()


def test_uniform_light_on_a_sphere(gpu, monkeypatch):
    monkeypatch.setattr("wgsss.stage.sky_visibility", lambda scene, lights, positions, normals: np.ones(len(positions)))
    scene = lit(EnvironmentLight((1, 1, 1)), mesh=sphere(5.0, 2000), material=SKIN, camera=ABOVE)
    M = M_of(gpu, scene, ScreenSpace(), 96)
    on = places(gpu, scene, 96)[1] == 1
    np.testing.assert_allclose(M[on], np.pi, rtol=1e-3)
    assert (M[~on] == 0).all()


def test_all_pixels_of_moving_objects_and_of_objects_around_the_camera_are_drawn(gpu):
    """The passes are drawn over rectangles: those of an object as posed, and the whole picture where some of it lies
    behind the camera."""
    light = EnvironmentLight((1, 1, 1))
    motion = BendAndSwell(length=20.0, period_s=1.0)
    rod = capsule(length=20.0, radius=2.0, vertices=500)
    finger = Object(rod, SKIN, motion=motion, translate=(8, 0, 0))
    aside = OrthographicCamera((0, 10, 50), (0, 10, 0), height=40)
    amid = PerspectiveCamera((0, 2, 0), (0, 0, -3), fov=90)
    for scene, time in ((replace(lit(light, camera=aside), objects=(finger,)), 0.25), (lit(light, camera=amid), 0.0)):
        image = Renderer(scene, ScreenSpace(), (64, 64), gpu).frame(time, aovs=["M_front"], timed=False)
        seen = image.pixels[..., 3] > 0
        assert seen.sum() > 50 and (image.aovs["M_front"][seen] > 0).all()


def painted(mesh: Mesh, left: int, right: int, material=WIDE):
    """The left half of a mesh's texture and the right, as colours applied before diffusion."""
    texels = np.zeros((1, 2048, 3), np.uint8)
    texels[:, :1024], texels[:, 1024:] = left, right
    return mesh, replace(material, color_after=0.0, maps=replace(material.maps, base_color=texels))


@pytest.mark.parametrize("height", [2.0, 4.0, 10.0])
def test_nothing_bleeds_across_a_step(gpu, height):
    """One object in two levels, white above and black below; seen straight from above they touch."""
    level = plane(side=20.0, cells=8)
    lower = level.positions[:, 0] > 0.1
    rim = np.abs(level.positions[:, 0]) < 0.1
    positions = np.concatenate([level.positions, level.positions[rim]])
    copy = np.arange(len(lower))
    copy[rim] = len(lower) + np.arange(rim.sum())
    below = lower[level.faces].any(axis=1)
    faces = np.where(below[:, None], copy[level.faces], level.faces)
    positions[np.unique(faces[below]), 1] = -height
    mesh, material = painted(Mesh(positions, faces, corner_uvs=level.corner_uvs), 255, 0)
    M = M_of(gpu, lit(DOWN, mesh=mesh, material=material, camera=ABOVE), ScreenSpace(), 128)
    np.testing.assert_allclose(M[:, :63], np.broadcast_to(material.profile.total, M[:, :63].shape), rtol=2e-3)
    assert M[:, 65:].max() < 2e-3  # of the filtered texel between white and black


def test_light_crosses_a_bend(gpu):
    """The same without a step: light from the white half of the floor reaches the black one."""
    mesh, material = painted(plane(side=20.0), 255, 0)
    M = M_of(gpu, lit(DOWN, mesh=mesh, material=material, camera=ABOVE), ScreenSpace(taps=33), 128)
    x = ((np.arange(128) + 0.5) / 128 - 0.5) * 16
    np.testing.assert_allclose(M[64], WIDE.gaussians.step_response(-x), atol=0.02)


def test_light_spreads_over_bent_surfaces(gpu):
    """Over a cylinder of 6 mm, as far as 50 degrees from the top, light goes by the length of the arc."""
    flat, material = painted(plane(side=20.0, cells=64), 255, 0)
    angle = np.clip(flat.positions[:, 0] / 6, -1.6, 1.6)
    bent = np.stack([6 * np.sin(angle), 6 * np.cos(angle) - 6, flat.positions[:, 2]], axis=1)
    scene = lit(EnvironmentLight((1, 1, 1)), mesh=flat.deformed(bent), material=material, camera=ABOVE)
    M = M_of(gpu, scene, ScreenSpace(taps=33), 128)[64]
    arc = 6 * np.arcsin(np.clip((np.arange(128) - 63.5) / 48, -1, 1))
    near = np.abs(arc) < 5.2
    np.testing.assert_allclose(M[near] / np.pi, WIDE.gaussians.step_response(-arc[near]), atol=0.022)


def test_bodies_keep_their_light_and_their_kernels(gpu):
    """Two floors side by side, of different materials, under one edge that crosses both."""
    t = plane(side=60.0, cells=2)
    near = Mesh(t.positions + np.float32([0, 0, 30]), t.faces)
    far = Mesh(t.positions - np.float32([0, 0, 30]), t.faces)
    scene = lit(SLANTED, mesh=near, material=SKIN, camera=ABOVE, extra=(Object(far, WIDE), shade()))
    M = M_of(gpu, scene, ScreenSpace(taps=33), 128)
    x = ((np.arange(128) + 0.5) / 128 - 0.5) * 16
    np.testing.assert_allclose(M[36], WIDE.gaussians.step_response(x), atol=0.015)
    np.testing.assert_allclose(M[92], SKIN_GAUSSIANS.step_response(x), atol=0.015)
    np.testing.assert_allclose(M[63], WIDE.gaussians.step_response(x), atol=0.015)  # to where they meet
    np.testing.assert_allclose(M[64], SKIN_GAUSSIANS.step_response(x), atol=0.015)


def test_vanishing_width_is_lambert(gpu):
    narrow = replace(MATTE, gaussians=SumOfGaussians(np.array([1e-8]), np.array([[0.9, 0.5, 0.1]])))
    light = DirectionalLight((1, -1, 0.3), (1, 2, 3))
    scene = lit(light, mesh=sphere(5.0, 3000), material=narrow, camera=ABOVE)
    for kernel in ("line-spread", "svd"):
        blurred = M_of(gpu, scene, ScreenSpace(kernel=kernel), 64)
        np.testing.assert_allclose(blurred, M_of(gpu, scene, Lambert(), 64), rtol=1e-4, atol=1e-5)


def test_the_base_colour_may_be_applied_before_or_after(gpu):
    sides = {}
    for share in (0.0, 1.0):
        mesh, material = painted(plane(cells=2), 0, 188)
        material = replace(material, color_after=share, base_color=(0.5, 1.0, 0.25))
        sides[share] = M_of(gpu, lit(DOWN, mesh=mesh, material=material, camera=ABOVE), ScreenSpace(), 64)[32]
    lit_side = WIDE.profile.total * 0.503 * [0.5, 1.0, 0.25]
    for row in sides.values():
        np.testing.assert_allclose(row[-4], lit_side, rtol=0.02)
    assert np.abs(np.diff(sides[1.0][:, 1])).max() > 0.4 * lit_side[1]
    assert np.abs(np.diff(sides[0.0][:, 1])).max() < 0.1 * lit_side[1]


@pytest.mark.parametrize("count", [1, 5, 17, 65])
def test_taps(count):
    """The weights of a level sum to the kernel, and the number of taps is the knob's."""
    (term,) = line_spread(SKIN_GAUSSIANS)
    taps = Taps(term, term, count // 2)
    levels = len(taps.pixels_per_mm)
    assert taps.offset.shape == (levels, 1 + count // 2) and taps.weight.shape == (levels, 1 + count // 2, 3)
    np.testing.assert_allclose(taps.weight[:, 0] + 2 * taps.weight[:, 1:].sum(axis=1), 1.0, rtol=1e-6)
    assert (taps.weight > -1e-9).all()
    assert (taps.offset[:, 0] == 0).all() and (np.diff(taps.offset, axis=1) >= 1).all()
    np.testing.assert_allclose(taps.weight[0], np.eye(1 + count // 2)[:, :1] @ np.ones((1, 3)), atol=1e-6)
    assert (np.abs(taps.pixels_per_mm[1:] / taps.pixels_per_mm[:-1] - 1) < 0.022).all()


@pytest.mark.parametrize("level", [150, 200, 230])
def test_the_pixels_of_taps_have_the_smallest_error_at_an_edge(level):
    """Compared with all triples of pixels, each with the best weights."""
    (term,) = line_spread(SKIN_GAUSSIANS)
    taps = Taps(term, term, 3)
    edges = np.arange(0.5, 40)
    light = np.stack([np.interp(edges / taps.pixels_per_mm[level], term.x, column) for column in term.within.T], axis=1)

    def error(offset):
        between = np.split(light, [round(tap) for tap in offset])
        return max(
            *(0.5 * np.ptp(part, axis=0).max() for part in between[:-1] if len(part)), (1 - between[-1][0]).max()
        )

    best = min(error(offset) for offset in combinations(range(1, 40), 3))
    assert error(taps.offset[level, 1:]) == pytest.approx(best, abs=2e-4) and best > 0.01
    read = taps.weight[level, 0] + 2 * np.concatenate([np.zeros((1, 3)), np.cumsum(taps.weight[level, 1:], axis=0)])
    reached = np.searchsorted(taps.offset[level, 1:], edges)
    assert np.abs(read[reached] - light).max() == pytest.approx(best, abs=2e-4)


@pytest.mark.parametrize("size", [64, 256])
def test_the_number_of_taps_follows_from_the_width_of_the_kernel(gpu, size):
    """Half of a Gaussian's light leaves within sqrt(2 v ln 2)."""
    below = replace(ABOVE, height=20)
    beside = PerspectiveCamera((30, 10, 0), (0, 10, 0), fov=40)
    scale = {below: size / 20, beside: size / (2 * 30 * np.tan(np.radians(20)))}
    for camera, pixels_per_mm in scale.items():
        for pixels, taps in ((1.0, 17), (7.9, 17), (8.1, 33), (15.9, 33), (16.1, 65), (500.0, 65)):
            v = (pixels / pixels_per_mm) ** 2 / (2 * np.log(2))
            material = replace(MATTE, gaussians=SumOfGaussians(np.array([v]), np.array([[0.9, 0.5, 0.1]])))
            finger = Object(capsule(length=20.0, radius=2.0, vertices=100), material)
            stage = Stage(gpu, replace(lit(DOWN, camera=camera), objects=(finger,)))
            frame = shared.begin(Graph(gpu), stage, (size, size))
            assert taps_for(frame, stage.bodies[0]) == taps


def test_each_object_has_its_own_number_of_taps_by_default(gpu):
    wide = replace(MATTE, gaussians=SumOfGaussians(np.array([200.0]), np.array([[0.9, 0.5, 0.1]])))
    near, far = (replace(plane(side=20.0), name=name) for name in ("near", "far"))
    scene = lit(DOWN, mesh=near, material=SKIN, camera=ABOVE, extra=(Object(far, wide, translate=(0, -3, 0)),))
    for method, expected in ((ScreenSpace(), (17, 65)), (ScreenSpace(taps=9), (9, 9))):
        graph = Renderer(scene, method, (64, 64), gpu).frame(timed=False).graph
        blurs = [item for item in graph.passes if item.module.name == "screen_space/blur"]
        levels, size = 448, 16
        assert [item.imports["taps"].size // (levels * size) * 2 - 1 for item in blurs[::2]] == list(expected)


def test_taps_of_a_black_material():
    (term,) = line_spread(SumOfGaussians(np.array([0.5]), np.zeros((1, 3))))
    taps = Taps(term, term, 8)
    assert np.isfinite(taps.weight).all() and np.isfinite(taps.offset).all() and (taps.scale == 0).all()


def test_knobs():
    with pytest.raises(InputError, match="odd"):
        ScreenSpace(taps=16)
    with pytest.raises(InputError, match="did you mean 'radial'"):
        ScreenSpace(kernel="radal")


def test_same_scene_same_bits(gpu):
    scene = lit(DOWN, mesh=sphere(5.0, 1000), material=SKIN, camera=ABOVE)
    first = M_of(gpu, scene, ScreenSpace(), 48)
    for _ in range(5):
        assert M_of(gpu, scene, ScreenSpace(), 48).tobytes() == first.tobytes()
