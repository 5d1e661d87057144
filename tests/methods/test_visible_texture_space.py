"""Diffusion over the visible texels only gives the same picture as over all texels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenes import MATTE, lit, plane
from scipy.ndimage import minimum_filter

from wgsss import frame as shared
from wgsss.errors import InputError
from wgsss.graph import Graph
from wgsss.methods import texture_space
from wgsss.methods.texture_space import TextureSpace
from wgsss.methods.visible_texture_space import VisibleTextureSpace
from wgsss.optics import SKIN_GAUSSIANS
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight, Mesh, Object, OrthographicCamera, PerspectiveCamera
from wgsss.scene.shapes import ear, slab, sphere
from wgsss.stage import Stage

SKIN = replace(MATTE, gaussians=SKIN_GAUSSIANS)
DOWN = DirectionalLight((0, -1, 0), (1, 1, 1))
SIDE = DirectionalLight((-0.8, -0.4, -0.5), (2, 2, 2))
LIMIT = np.float32([math.cos(math.radians(105))])
TEXELS_PER_PIXEL = 1.5
FRONT = PerspectiveCamera((0, 0, 200), (0, 0, 0), fov=30)
OFF = {"culled": False, "depth_based": False, "clipped": False}


def only(switch: str) -> dict[str, bool]:
    return {**OFF, switch: True}


def picture(gpu, scene, method, size=(96, 64)):
    return Renderer(scene, method, size, gpu).frame(timed=False, aovs=["M_front"])


def drawn(image, module):
    """Return the sizes of the targets of a module's passes."""
    return [next(iter(item.writes.values())).size[0] for item in image.graph.ran if item.module.name == module]


def lit_texels(gpu, scene, size, **limits):
    """Return where the irradiance map of the first object has a value, bool (size, size), and its render mesh."""
    stage = Stage(gpu, scene)
    stage.bodies[0].unwrap()
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (96, 64))
    handle = shared.irradiance_texels(frame, stage.bodies[0], size, **limits)
    graph.run(handle)
    return graph.read(handle)[..., 3] > 0, stage.bodies[0].render_mesh


def octahedron(radius=20.0):
    """Between its vertices, interpolated normals are as short as 0.58."""
    positions = radius * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float32)
    faces = [(x, y, z) if sign else (x, z, y) for x in (0, 1) for y in (2, 3) for z in (4, 5)
             for sign in [(x + (y - 2) + (z - 4)) % 2 == 0]]  # fmt: skip
    return Mesh(positions, np.array(faces, np.int32), name="octahedron")


@pytest.mark.parametrize("camera", [FRONT, OrthographicCamera((60, 80, 200), (0, 0, 0), height=60)])
def test_texels_beyond_105_degrees_are_dark(gpu, camera):
    """By the angle of the normalised normal at points all over the surface."""
    scene = lit(SIDE, mesh=octahedron(), material=SKIN, camera=camera)
    size = 256
    lit_, surface = lit_texels(gpu, scene, size, least_cosines=LIMIT)
    random = np.random.default_rng(5)
    weights = random.dirichlet(np.ones(3), 4000)
    corners = surface.faces[random.integers(0, len(surface.faces), 4000)]
    uv, n, x = (
        np.einsum("nk,nkd->nd", weights, a[corners].astype(float))
        for a in (surface.atlas, surface.normals, scene.objects[0].mesh.positions[surface.vertex])
    )
    eye = np.asarray(camera.eye, float)
    to_eye = eye - x if isinstance(camera, PerspectiveCamera) else np.tile(eye, (4000, 1))
    angle = np.degrees(np.arccos((n * to_eye).sum(1) / np.linalg.norm(n, axis=1) / np.linalg.norm(to_eye, axis=1)))
    column, row = (uv * size).astype(int).T
    found = lit_[row, column]
    inside = weights.min(axis=1) > 0.05  # a texel's centre away from the edges
    assert found[inside & (angle < 105)].mean() > 0.999
    assert not found[inside & (angle > 109)].any()  # a texel is a degree or two wide
    assert 0.2 < found.mean() < 0.8


def test_a_face_is_dark_as_a_whole(gpu):
    """A box has one normal to a face."""
    box = Object(slab(size=(20, 20, 20)), SKIN)
    for angle, faces in ((104.0, 3), (106.0, 2)):  # of the face below, seen from above; those at the sides are at 90
        a = math.radians(angle - 90)
        camera = OrthographicCamera((0, 100 * math.sin(a), 100 * math.cos(a)), (0, 0, 0), height=40)
        scene = replace(lit(DOWN, camera=camera), objects=(box,))
        some, _ = lit_texels(gpu, scene, 256, least_cosines=LIMIT)
        every, _ = lit_texels(gpu, scene, 256)
        assert some.sum() / every.sum() == pytest.approx((faces + 2) / 6, abs=0.02), angle


@pytest.mark.parametrize("switch", ["culled", "clipped"])
@pytest.mark.parametrize("shape", ["ball", "box", "ear"])
def test_texels_that_are_left_out_do_not_change_the_picture(gpu, shape, switch):
    """An object partly outside of the image, lit from behind, differs by at most one step of 255."""
    mesh = {"ball": sphere(40.0, 3000), "box": slab(size=(30, 30, 12)), "ear": ear(1000)}[shape]
    camera = PerspectiveCamera((0, 60, 120), (25, 12, 0), fov=30)
    behind = DirectionalLight((-0.3, 0.1, 0.9), (2, 2, 2))
    scene = lit(SIDE, behind, mesh=mesh, material=SKIN, camera=camera)
    whole = picture(gpu, scene, TextureSpace(map_size=256))
    some = picture(gpu, scene, VisibleTextureSpace(map_size=256, **only(switch)))
    off = np.abs(some.display.astype(int) - whole.display)
    assert off.max() <= 1
    assert len(np.unique(some.display)) > 50


def test_on_surfaces_with_little_curvature_the_limit_is_105_degrees(gpu):
    """On a ball the angle that light spreads over is that of a chord of three standard deviations."""
    for radius in (40.0, 20.0, 10.0):
        angle = max(105.0, 90 + math.degrees(2 * math.asin(3 * math.sqrt(7.41) / (2 * radius))))
        stage = Stage(gpu, lit(SIDE, mesh=sphere(radius, 2000), material=SKIN, camera=FRONT))
        buffer = VisibleTextureSpace().least_cosines(stage.bodies[0])
        cosines = np.frombuffer(gpu.queue.read_buffer(buffer), np.float32)
        np.testing.assert_allclose(np.degrees(np.arccos(cosines)), angle, atol=0.01 if angle == 105 else 2)


def test_light_spreads_from_outside_of_the_image(gpu):
    """The edge of a shadow is 1 mm to the left of the image, and light spreads over several."""
    camera = OrthographicCamera((4, 60, 0), (4, 0, 0), up=(0, 0, -1), height=4)
    shade = Object(Mesh(plane(side=60.0).positions + np.float32([-30, 10, 0]), plane().faces), MATTE)
    scene = lit(DOWN, mesh=plane(cells=4), material=SKIN, camera=camera, extra=(shade,))
    whole = picture(gpu, scene, TextureSpace(map_size=512), (64, 64))
    some = picture(gpu, scene, VisibleTextureSpace(map_size=512, **only("clipped")), (64, 64))
    assert np.ptp(whole.aovs["M_front"][32, :, 0]) > 0.02
    np.testing.assert_allclose(some.aovs["M_front"], whole.aovs["M_front"], atol=2e-3)


def test_texels_far_from_the_image_are_dark(gpu):
    camera = OrthographicCamera((4, 60, 0), (4, 0, 0), up=(0, 0, -1), height=4)
    scene = lit(DOWN, mesh=plane(cells=4), material=SKIN, camera=camera)
    stage = Stage(gpu, scene)
    frame = shared.begin(Graph(gpu), stage, (96, 64))
    method = VisibleTextureSpace(map_size=512)
    lit_, _ = lit_texels(gpu, scene, 512, planes=method.planes(frame, stage.bodies[0]))
    texel = 40 / (0.98 * 512)
    margin = 3 * math.sqrt(SKIN_GAUSSIANS.variances[-1]) + 4 * texel
    assert np.ptp(np.flatnonzero(lit_.any(axis=0))) * texel == pytest.approx(4 * 96 / 64 + 2 * margin, abs=3 * texel)
    assert np.ptp(np.flatnonzero(lit_.any(axis=1))) * texel == pytest.approx(4 + 2 * margin, abs=3 * texel)


@pytest.mark.parametrize("place", [(300, 0, 0), (-300, 0, 0), (0, 300, 0), (0, -300, 0), (0, 0, 500)])
def test_an_object_outside_of_the_image_or_behind_the_camera_has_no_passes(gpu, place):
    scene = lit(SIDE, mesh=sphere(20.0, 500), material=SKIN, camera=FRONT)
    away = replace(scene.objects[0], translate=place)
    method = VisibleTextureSpace(map_size=128)
    image = picture(gpu, replace(scene, objects=(scene.objects[0], away)), method)
    assert len(drawn(image, "texture_space/dilate")) == len(drawn(image, "texture_space/gather")) == 1
    nothing = picture(gpu, replace(scene, objects=(away,)), method)
    assert not drawn(nothing, "texture_space/blur") and not nothing.pixels.any()


def test_with_all_switches_off_it_equals_deon07_bit_by_bit(gpu):
    scene = lit(SIDE, mesh=ear(1000), material=SKIN, camera=PerspectiveCamera((0, 0, 250), (0, 30, 0), fov=30))
    whole, same = (
        picture(gpu, scene, m) for m in (TextureSpace(map_size=128), VisibleTextureSpace(map_size=128, **OFF))
    )
    assert whole.pixels.tobytes() == same.pixels.tobytes()


@pytest.mark.parametrize("distance", [0.9, 1.01, 1.4, 2.0, 3.0, 7.9, 100.0])
def test_the_size_of_maps_follows_from_the_distance(gpu, distance):
    """Eq. 3 and 4, with d_ref where the map has TEXELS_PER_PIXEL, for a plane that faces the camera."""
    T_max, fov, height = 512, 30.0, 64
    texels_per_mm = 0.98 * T_max / 40
    d_ref = TEXELS_PER_PIXEL * height / (2 * math.tan(math.radians(fov) / 2)) / texels_per_mm
    camera = PerspectiveCamera((0, distance * d_ref, 0), (0, 0, 0), up=(0, 0, -1), fov=fov)
    image = picture(
        gpu, lit(DOWN, material=SKIN, camera=camera), VisibleTextureSpace(map_size=T_max, **only("depth_based"))
    )
    (size,) = drawn(image, "texture_space/dilate")
    exact = min(1.0, 1.0 / distance) * T_max
    assert max(exact - 1e-3, 64) <= size <= max(1.5 * exact, 64)
    assert size in (512, 384, 256, 192, 128, 96, 64)


def test_the_nearest_corner_counts_and_without_perspective_the_distance_does_not(gpu):
    method = VisibleTextureSpace(map_size=1024)
    scene = lit(SIDE, mesh=slab(size=(40, 40, 40)), material=SKIN)
    stage = Stage(gpu, scene)
    density = method.texels_per_mm(stage.bodies[0])

    def size(camera):
        stage.scene = replace(scene, camera=camera)
        return method.size_seen(shared.begin(Graph(gpu), stage, (96, 64)), stage.bodies[0])

    for nearest in (15, 30, 60):
        exact = TEXELS_PER_PIXEL * 64 / (2 * math.tan(math.radians(30)) * nearest) / density * 1024
        assert exact <= size(PerspectiveCamera((0, 0, 20 + nearest), (0, 0, 0), fov=60)) <= 1.5 * exact
    exact = TEXELS_PER_PIXEL * 64 / 200 / density * 1024
    near, far = (size(OrthographicCamera((0, 0, d), (0, 0, 0), height=200)) for d in (100, 1000))
    assert exact <= near == far <= 1.5 * exact


def test_no_frame_of_a_zoom_waits_for_a_bake_and_memory_stays(gpu, monkeypatch):
    def pull(distance):
        renderer.stage.scene = replace(scene, camera=PerspectiveCamera((0, 0, distance), (0, 0, 0), fov=30))
        return drawn(renderer.frame(timed=False), "texture_space/dilate")[0]

    scene = lit(SIDE, mesh=sphere(20.0, 500), material=SKIN, camera=FRONT)
    renderer = Renderer(scene, VisibleTextureSpace(map_size=256), (64, 64), gpu)
    monkeypatch.setattr(texture_space, "make_charts", lambda *_: pytest.fail("a frame baked"))
    distances = np.geomspace(40, 2000, 12)
    assert len({pull(d) for d in distances}) == 5  # 256, 192, 128, 96, 64
    known = len(gpu._views)
    for d in distances:
        pull(d)
    assert len(gpu._views) == known


def test_smaller_maps_are_no_less_accurate(gpu):
    """Compared with means over the pixels: with many texels per pixel, the full map aliases."""
    size, by = (48, 48), 4
    camera = PerspectiveCamera((60, 30, 550), (0, 31, 0), fov=30)
    scene = lit(SIDE, mesh=ear(2000), material=SKIN, camera=camera)
    fine = picture(gpu, scene, TextureSpace(map_size=512), (size[0] * by, size[1] * by))
    cells = (size[1], by, size[0], by)
    inside = fine.pixels[..., 3].reshape(cells).min(axis=(1, 3)) > 0
    mean = fine.aovs["M_front"].reshape(*cells, 3).mean(axis=(1, 3))
    whole = picture(gpu, scene, TextureSpace(map_size=512), size)
    small = picture(gpu, scene, VisibleTextureSpace(map_size=512), size)
    assert drawn(small, "texture_space/dilate")[0] <= 256
    errors = [np.sqrt(((image.aovs["M_front"] - mean)[inside] ** 2).mean()) for image in (small, whole)]
    assert errors[0] <= 1.05 * errors[1]


def test_maps_have_values_where_the_irradiance_has_down_to_a_quarter_of_its_size(gpu):
    scene = lit(SIDE, mesh=sphere(6.0, 1000), material=SKIN, camera=FRONT)
    stage = Stage(gpu, scene)
    method = TextureSpace(map_size=320)
    method.bake(stage)
    body = stage.bodies[0]
    assert method.sizes(body)[-1] == 80
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (8, 8))
    irradiance = shared.irradiance_texels(frame, body, 320, least_cosines=np.array([0.6], np.float32))
    maps = method.blur(frame, body, irradiance)
    graph.run(irradiance, *maps)
    lit_ = graph.read(irradiance)[..., 3] > 0
    assert 0.05 < lit_.mean() < 0.3
    for size, blurred in zip(method.sizes(body), maps, strict=True):
        inside = gpu.read_texture(texture_space.atlas(body, size).ids)[..., 0] >= 1 << 31
        deep = minimum_filter(inside, 5)  # where filters meet no gutter
        n = 320 // size
        has_value = graph.read(blurred)[..., 3] > 0
        blocks = lit_.reshape(size, n, size, n)
        middle = blocks[:, (n - 1) // 2 : n // 2 + 1, :, (n - 1) // 2 : n // 2 + 1]  # what is read at a texel's centre
        assert has_value[inside & middle.any(axis=(1, 3))].all()
        assert not has_value[deep & ~blocks.any(axis=(1, 3))].any()


def test_pixels_do_not_count_texels_without_a_value(gpu):
    """Maps of one value, with holes."""
    scene = lit(DOWN, material=SKIN, camera=OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=10))
    stage = Stage(gpu, scene)
    method = TextureSpace(map_size=64)
    method.bake(stage)
    holes = np.random.default_rng(2).random((64, 64, 1)) < 0.3
    value = np.where(holes, 0.0, [0.5, 0.25, 2.0, 1.0])
    graph = Graph(gpu)
    frame = shared.begin(graph, stage, (48, 48))
    M_front = method._gather(frame, stage.bodies[0], [gpu.texture(value, "rgba16float")], None)
    graph.run(M_front)
    expected = SKIN_GAUSSIANS.weights[0] * frame.lighting.unit * [0.5, 0.25, 2.0]
    np.testing.assert_allclose(graph.read(M_front)[..., :3].reshape(-1, 3), np.tile(expected, (48 * 48, 1)), rtol=2e-3)


def test_nothing_is_culled_where_a_back_may_be_visible(gpu):
    """A sheet from behind, and a ball from inside."""
    below = PerspectiveCamera((5, -60, 5), (0, 0, 0), up=(0, 0, -1), fov=30)
    inside = PerspectiveCamera((2, 0, 3), (20, 0, 0), fov=60)
    for mesh, camera in ((plane(), below), (sphere(20.0, 500), inside)):
        scene = lit(DirectionalLight((0, -1, 0.1), (1, 1, 1)), mesh=mesh, material=SKIN, camera=camera)
        whole, some = (
            picture(gpu, scene, m)
            for m in (TextureSpace(map_size=128), VisibleTextureSpace(map_size=128, **only("culled")))
        )
        assert whole.aovs["M_front"].max() > 0.1 and some.pixels.tobytes() == whole.pixels.tobytes()


def test_switches_are_on_or_off():
    assert make_method("jimenez08") == VisibleTextureSpace(culled=True, depth_based=True, clipped=True)
    for word in ("off", "Off", "false", "no", "0", False, 0):
        assert make_method("jimenez08", {"culled": word}).culled is False, word
    for word in ("on", "TRUE", "yes", "1", True, 1):
        assert make_method("jimenez08", {"culled": word}).culled is True, word
    for word in ("", "maybe", "2", None):
        with pytest.raises(InputError, match=f"jimenez08: culled must be on or off, not {word!r}"):
            make_method("jimenez08", {"culled": word})
