"""The export of scenes to Mitsuba, and the reference `volume` against known solutions. Tests that need Mitsuba may
be skipped."""

from __future__ import annotations

import importlib.util
import math
import subprocess
import warnings
from contextlib import nullcontext
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from tqdm import tqdm

from wgsss.bake.photons import trace
from wgsss.errors import InputError, RenderError
from wgsss.optics import Layer
from wgsss.reference import mitsuba_paths
from wgsss.reference.integral import integral
from wgsss.reference.mitsuba_paths import Paths, newest_llvm
from wgsss.reference.mitsuba_scene import export
from wgsss.reference.mitsuba_xml import scene_xml
from wgsss.reference.volume import Volume, _rays
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Maps,
    Material,
    Mesh,
    Object,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
    load_mesh,
    material,
    shapes,
)
from wgsss.scene.builtin import SCENES
from wgsss.stage import Stage

needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="Mitsuba is not installed: pip install mitsuba"
)

MATCHED = Material("matched", sigma_a=(0.0, 0.0, 0.0), sigma_s_prime=(0.5, 0.5, 0.5), eta=1.0)
BALL = shapes.sphere(10.0, 2500)
SKY = EnvironmentLight((1.0, 2.0, 4.0))
CAMERA = OrthographicCamera((0, 0, 90), (0, 0, 0), height=22.0)


def ball(*lights, medium: Material = MATCHED, camera=CAMERA, mesh: Mesh = BALL) -> Scene:
    return Scene("ball", (Object(mesh, medium),), lights, camera)


def xml(scene: Scene, **rest) -> ElementTree.Element:
    return ElementTree.fromstring(scene_xml(scene, (64, 48), **rest))


def value(element: ElementTree.Element, name: str) -> list[float]:
    found = element.find(f".//*[@name='{name}']")
    assert found is not None, name
    return [float(v) for v in found.attrib["value"].split(",")]


# The files.


def test_meshes_are_written_in_world_space(tmp_path):
    """The written mesh has the positions in world space and its own normals, also at hard edges."""
    plate = Object(shapes.slab((8, 6, 2), 200), MATCHED, translate=(1, 2, 3), rotate=(20, 30, 40))
    with pytest.warns(UserWarning, match="through the air"):
        files = export(Scene("two", (Object(BALL, MATCHED), plate), (SKY,), CAMERA), tmp_path, (8, 8))
    assert [file.name for file in files] == ["scene.xml", "1.ply", "2.ply"]
    smooth, hard = (load_mesh(file).mesh for file in files[1:])
    assert np.allclose(smooth.positions[smooth.faces], BALL.positions[BALL.faces], atol=1e-5)
    assert np.allclose(hard.positions[hard.faces], plate.placed[plate.mesh.faces], atol=1e-5)
    turned = plate.mesh.shading_normals @ plate.matrix[:3, :3].T
    assert np.allclose(hard.shading_normals, turned, atol=1e-5)


def test_a_medium_scatters_by_its_reduced_coefficients():
    """Skin1 of Jensen et al. 2001: sigma_t' = 0.772, 1.05, 1.49 per mm."""
    medium = xml(ball(SKY, medium=material("skin1"))).find("shape/medium")
    assert np.allclose(np.multiply(value(medium, "sigma_t"), value(medium, "scale")), (0.772, 1.05, 1.49))
    assert np.allclose(value(medium, "albedo"), (0.74 / 0.772, 0.88 / 1.05, 1.01 / 1.49))
    assert medium.find("phase").attrib["type"] == "isotropic"


def test_a_scene_of_one_channel_is_grey():
    scene = ball(SKY, PointLight((0, 90, 0), (1, 2, 3)), medium=material("skin1"))
    root = xml(scene, channel=2)
    medium = root.find("shape/medium")
    assert np.multiply(value(medium, "sigma_t"), value(medium, "scale")) == pytest.approx([1.49] * 3)
    assert value(root, "radiance") == [4.0] * 3
    assert value(root, "intensity") == [3e6] * 3
    assert value(xml(scene, channel=2, scatters=False), "albedo") == [0.0] * 3


@pytest.mark.parametrize(
    ("eta", "roughness", "kind"), [(1.0, 0.3, "null"), (1.3, 0.3, "roughdielectric"), (1.3, 0.02, "dielectric")]
)
def test_boundary(eta, roughness, kind):
    bsdf = xml(ball(SKY, medium=replace(MATCHED, eta=eta, roughness=roughness))).find("shape/bsdf")
    assert bsdf.attrib["type"] == kind
    if kind != "null":
        assert value(bsdf, "int_ior") == [eta]
    if kind == "roughdielectric":
        assert value(bsdf, "alpha") == [pytest.approx(0.09)]


def test_no_path_ends_by_chance_while_it_carries_light():
    """After n events, a hundredth of the light is left: albedo^n = 0.01."""
    integrator = xml(ball(SKY, medium=material("skin1"))).find("integrator")
    assert value(integrator, "rr_depth") == [math.ceil(math.log(0.01) / math.log(0.74 / 0.772))]
    assert value(xml(ball(SKY)).find("integrator"), "rr_depth") == [4096]


@pytest.mark.parametrize(("channel", "integrator", "bsdf"), [(None, "volpathmis", "diffuse"), (1, "volpath", "null")])
def test_lights_let_other_light_through_if_the_integrator_supports_it(channel, integrator, bsdf):
    """With Mitsuba 3.9, volpathmis counts the sky behind a light without a boundary twice."""
    root = xml(ball(SKY, LIGHTS["sphere"]), channel=channel)
    assert root.find("integrator").attrib["type"] == integrator
    lamp = root.find("shape[@type='sphere']")
    assert lamp.find("bsdf").attrib["type"] == bsdf
    assert value(lamp, "radiance") == ([1, 2, 4] if channel is None else [2, 2, 2])
    if bsdf == "diffuse":
        assert value(lamp, "reflectance") == [0, 0, 0]


def test_environments_are_summed(tmp_path):
    """Mitsuba supports one environment: constants are summed, and added to the image if there is one."""
    import OpenEXR

    two = ball(SKY, EnvironmentLight((1, 1, 1)))
    assert value(xml(two), "radiance") == [2, 3, 5]
    sky = EnvironmentLight((1, 2, 4), file=towards_plus_x(tmp_path / "sky.exr"))
    export(replace(two, lights=(*two.lights, sky)), tmp_path, (8, 8))
    found = OpenEXR.File(str(tmp_path / "environment.exr")).channels()["RGB"].pixels
    assert np.allclose(found - sky.pixels(), (2, 3, 5), rtol=1e-5)


# Errors and warnings.

OPEN = Mesh(BALL.positions, BALL.faces[1:])
SUN, LAMP = DirectionalLight((0, 0, -1), (1, 1, 1)), PointLight((0, 0, 50), (1, 1, 1))


@pytest.mark.parametrize(
    ("scene", "why"),
    [
        (ball(SKY, medium=material("skin")), "not gaussians"),
        (ball(SKY, mesh=OPEN), "the mesh has holes"),
        (
            ball(SUN, medium=replace(MATCHED, eta=1.3, roughness=0.02)),
            "smooth boundary of 'matched'.*light with a size",
        ),
        (ball(LAMP, medium=replace(MATCHED, eta=1.3, roughness=0.02)), "smooth boundary"),
        (ball(EnvironmentLight(file="a.exr"), EnvironmentLight(file="b.exr")), "one environment image"),
    ],
)
def test_scenes_that_mitsuba_cannot_represent_are_errors(scene, why, tmp_path):
    with pytest.raises(InputError, match=why) as caught:
        export(scene, tmp_path / "new", (8, 8))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "new").exists()


def test_smooth_boundary_under_finite_lights_is_fine(tmp_path):
    export(ball(SKY, medium=replace(MATCHED, eta=1.3, roughness=0.02)), tmp_path, (8, 8))
    export(ball(SUN), tmp_path, (8, 8))


def warning_of(scene: Scene, folder) -> str:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        export(scene, folder, (8, 8))
    assert len(caught) <= 1
    return str(caught[0].message) if caught else ""


def test_one_warning_names_all_differences(tmp_path):
    texture = np.zeros((2, 2, 3), np.uint8)
    wears = replace(MATCHED, eta=1.3, base_color=(0.5, 1, 1), specular=0.5, maps=Maps(texture, texture))
    message = warning_of(ball(SKY, medium=wears), tmp_path)
    for word in ("base colours", "base colour textures", "normal maps", "specular", "facets"):
        assert word in message
    assert "through the air" not in message  # a ball is convex
    assert "through the air" in warning_of(SCENES["gyroid"](None), tmp_path)
    assert warning_of(ball(SKY), tmp_path) == warning_of(ball(LIGHTS["rect"]), tmp_path) == ""
    assert "lights hide" in warning_of(ball(SKY, LIGHTS["rect"]), tmp_path)


def test_a_folder_that_cannot_be_created_is_an_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="this is not a folder"):
        export(ball(SKY), tmp_path / "file" / "folder", (8, 8))


# Paths.


@pytest.mark.parametrize("kind", [PerspectiveCamera, OrthographicCamera])
def test_rays_go_through_the_centres_of_pixels(kind):
    """The centre of pixel (3, 0) of 4 x 2 is 3/4 to the right of the image centre and 1/2 above it."""
    more = {"fov": 2 * math.degrees(math.atan(0.5))} if kind is PerspectiveCamera else {"height": 10.0}
    camera = kind((0, 0, 10), (0, 0, 0), **more)  # both views are 10 mm high at the target
    rays = _rays(np.linalg.inv(camera.projection(2.0, 5.0, 15.0) @ camera.view()), (4, 2))
    assert rays.shape == (2, 4, 6)
    origin, direction = rays[0, 3, :3], rays[0, 3, 3:]
    assert np.allclose(origin - direction * origin[2] / direction[2], (7.5, 2.5, 0))
    assert np.linalg.norm(direction) == pytest.approx(1)
    assert origin[2] == pytest.approx(5)


def test_batches_sum_to_the_samples_and_begin_alike(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: True)
    monkeypatch.setattr("importlib.metadata.version", lambda name: "3")
    with Paths(ball(SKY), (8, 8), np.zeros((10_000, 6))) as paths:
        few, many = paths.batches(150), paths.batches(500)
    assert (sum(few), sum(many)) == (150, 500)
    assert few[:-1] == many[: len(few) - 1]
    assert not paths._folder.exists()


def test_newest_llvm(monkeypatch, tmp_path):
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(mitsuba_paths, "_LLVM_PATTERNS", (f"{tmp_path}/libLLVM*",))
    (tmp_path / "libLLVM-15.so.1").touch()
    assert newest_llvm() is None
    for name in ("libLLVM-17.so", "libLLVM.so.19.1", "libLLVM-C.so"):
        (tmp_path / name).touch()
    assert newest_llvm() == str(tmp_path / "libLLVM.so.19.1")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/mine")
    assert newest_llvm() == "/mine"


def test_without_mitsuba(monkeypatch, gpu):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"volume needs Mitsuba 3: pip install mitsuba"):
        Volume().estimate(Stage(gpu, ball(SKY)), (8, 8))


# With Mitsuba.


@pytest.fixture
def mi():
    mitsuba = pytest.importorskip("mitsuba", reason="Mitsuba is not installed: pip install mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


@needs_mitsuba
@pytest.mark.parametrize(
    "camera",
    [
        PerspectiveCamera((30, 20, 40), (1, 2, 0), fov=25.0),
        OrthographicCamera((30, 20, 40), (1, 2, 0), height=25.0),
        OrthographicCamera((3, 2, 4), (0, 0, 0), up=(1, 0, 0), height=25.0),  # within the ball
    ],
)
def test_camera(mi, gpu, camera, tmp_path):
    """Mitsuba's ray through the centre of a pixel meets the ball where our frame shows it."""
    scene, size = ball(SKY, camera=camera), (24, 16)
    exported = mi.load_file(str(export(scene, tmp_path, size)[0]))
    shown = Renderer(scene, make_method("lambert"), size, gpu).frame(aovs=["depth"]).aovs["depth"][..., 0]
    eye, forward = np.asarray(camera.eye), -camera.view()[2, :3]
    found = np.full(size[::-1], np.inf)
    for y in range(size[1]):
        for x in range(size[0]):
            at = mi.Point2f((x + 0.5) / size[0], (y + 0.5) / size[1])
            ray, _ = exported.sensors()[0].sample_ray(0.0, 0.5, at, mi.Point2f(0.5, 0.5))
            hit = exported.ray_intersect(ray)
            if hit.is_valid():
                found[y, x] = (np.array(hit.p) - eye) @ forward
    assert 40 < np.isfinite(shown).sum() < 384
    both = np.isfinite(shown) & np.isfinite(found)
    assert (np.isfinite(shown) != np.isfinite(found)).sum() <= 2  # at the edge of the ball
    assert np.abs(found[both] - shown[both]).max() < 0.01


def radiance(mi, file, rays, paths):
    """Return the mean radiance (N, 3) along rays (N, 6), from `paths` paths each."""
    scene, sampler = mi.load_file(str(file)), mi.load_dict({"type": "independent"})
    sampler.seed(0)
    found = np.zeros((len(rays), 3))
    for at, ray in zip(found, rays, strict=True):
        along = mi.RayDifferential3f(mi.Point3f(*ray[:3]), mi.Vector3f(*ray[3:]))
        for _ in range(paths):
            at += np.array(scene.integrator().sample(scene, sampler, along)[0]) / paths
    return found


def towards_plus_x(path):
    """Write an environment of radiance 1 + 0.5 x + 0.3 y + 0.2 z in the direction x, y, z, by the convention of
    `EnvironmentLight`. Its irradiance is E = pi (1 + 2/3 (0.5, 0.3, 0.2) n)."""
    import OpenEXR

    u, v = np.meshgrid((np.arange(128) + 0.5) / 128, (np.arange(64) + 0.5) / 64)
    around, below = 2 * np.pi * (u - 0.5), np.pi * v
    x, y, z = np.sin(around) * np.sin(below), np.cos(below), -np.cos(around) * np.sin(below)
    grey = (1 + 0.5 * x + 0.3 * y + 0.2 * z).astype(np.float32)
    OpenEXR.File({}, {"RGB": np.repeat(grey[..., None], 3, axis=2)}).write(str(path))
    return str(path)


LIGHTS = {
    "directional": DirectionalLight((-1, -2, -3), (1, 2, 4)),
    "point": PointLight((30, 20, 25), (0.001, 0.002, 0.004)),
    "rect": RectLight((20, 10, 30), (-2, -1, -3), (0, 1, 1), 10, 24, (1, 2, 4), samples=64),
    "sphere": SphereLight((20, 10, 25), 6, (1, 2, 4), samples=64),
    "image": EnvironmentLight((1, 2, 4), file="", rotation=40),
}


@needs_mitsuba
@pytest.mark.parametrize("name", LIGHTS)
def test_lights(mi, gpu, name, tmp_path):
    """A white ball that scatters at its surface has the radiance E / pi, where E is our irradiance."""
    light = LIGHTS[name]
    if name == "image":
        light = replace(light, file=towards_plus_x(tmp_path / "sky.exr"))
    camera = OrthographicCamera((30, 20, 40), (0, 0, 0), height=16.0)
    scene, size = ball(light, camera=camera, mesh=shapes.sphere(10.0, 6000)), (6, 6)
    file, *_ = export(scene, tmp_path, size)
    tree = ElementTree.parse(file)
    shape = tree.find("shape")
    for part in ("bsdf", "medium"):
        shape.remove(shape.find(part))
    ElementTree.SubElement(ElementTree.SubElement(shape, "bsdf", type="diffuse"), "rgb", name="reflectance", value="1")
    integrator = tree.find("integrator")
    integrator.attrib["type"] = "path"
    integrator.find("integer[@name='max_depth']").attrib["value"] = "2"
    tree.write(file)

    irradiance = Renderer(scene, make_method("lambert"), size, gpu).frame(aovs=["irradiance"]).aovs["irradiance"]
    rays = _rays(np.linalg.inv(camera.projection(1.0, 1.0, 100.0) @ camera.view()), size).reshape(-1, 6)
    found = math.pi * radiance(mi, file, rays, 1 if name in ("directional", "point") else 80)
    wanted = irradiance.reshape(-1, 3)
    bright = wanted[:, 0] > 0.2 * wanted[:, 0].max()
    assert bright.sum() > 12
    ratio = found[bright] / wanted[bright]
    assert ratio.mean(axis=0) == pytest.approx(1.0, abs=0.015)
    assert np.abs(ratio - 1).max() < 0.15
    if name == "image":
        n = rays[:, :3] + rays[:, 3:] * _to_ball(rays)[:, None]
        turned = n / 10 @ _about_y(-40).T
        exact = math.pi * (1 + 2 / 3 * turned @ (0.5, 0.3, 0.2))
        assert found[:, 1] / 2 == pytest.approx(exact, rel=0.12)


def _to_ball(rays, radius=10.0):
    """Return the distance to a ball at the origin along rays that meet it."""
    along = np.einsum("ij,ij->i", rays[:, :3], rays[:, 3:])
    return -along - np.sqrt(along**2 - np.square(rays[:, :3]).sum(axis=1) + radius**2)


def _about_y(degrees):
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])


@needs_mitsuba
@pytest.mark.parametrize("by", ["llvm", "scalar"])
def test_a_ball_without_absorption(gpu, monkeypatch, by):
    """Under a uniform sky of radiance L, the light that enters leaves: M = pi L, minus the share exp(-sigma_t d)
    that passes straight through on a line of sight of length d inside. The standard error is also checked."""
    if by == "scalar":
        monkeypatch.setattr(mitsuba_paths, "newest_llvm", lambda: None)
    elif newest_llvm() is None:
        pytest.skip("there is no LLVM that Mitsuba can compile with")
    half, size = 4.5, (6, 6)
    scene = ball(SKY, camera=OrthographicCamera((0, 0, 90), (0, 0, 0), height=2 * half))
    stage, volume = Stage(gpu, scene), Volume(samples=400)
    with pytest.warns(UserWarning, match="no LLVM") if by == "scalar" else nullcontext():
        estimate = volume.estimate(stage, size)
    x = half * (2 * (np.arange(6) + 0.5) / 6 - 1)
    inside = 2 * np.sqrt(100 - x**2 - x[:, None] ** 2)
    exact = math.pi * (1 - np.exp(-0.5 * inside))[..., None] * (1.0, 2.0, 4.0)
    off = (estimate.M - exact) / estimate.error
    assert estimate.M_back is None
    assert (estimate.error < 0.05 * exact).all()
    assert abs(off.mean()) < 0.35
    assert 0.75 < np.sqrt(np.square(off).mean()) < 1.3
    assert (
        abs(np.corrcoef(off[..., 0].ravel(), off[..., 1].ravel())[0, 1]) < 0.6
    )  # each channel has its own random numbers

    def none(*_, **__):
        raise AssertionError("started again")

    monkeypatch.setattr(subprocess, "Popen", none)
    assert np.array_equal(volume.estimate(stage, size).M, estimate.M)  # from the cache


@needs_mitsuba
def test_a_smooth_ball_without_absorption(gpu):
    """Under a uniform sky, the ball has the radiance of the sky in every direction, and L_0 is the reflection: M = pi L
    times the base colour."""
    white = replace(MATCHED, eta=1.4, roughness=0.02, sigma_s_prime=(2.0, 2.0, 2.0), base_color=(1.0, 0.5, 0.25))
    scene = ball(SKY, medium=white, camera=OrthographicCamera((0, 0, 90), (0, 0, 0), height=19.0))
    estimate = Volume(samples=128).estimate(Stage(gpu, scene), (5, 5))
    seen = estimate.M[..., 0] > 0
    assert seen.sum() == 21
    assert estimate.M[seen] == pytest.approx(math.pi, abs=0.45)
    assert estimate.M[seen].mean() == pytest.approx(math.pi, rel=0.015)


@needs_mitsuba
def test_slab_of_photons(gpu):
    """The light that leaves both sides of a slab of skin without a boundary equals that of our photon tracer, which
    shares no code with Mitsuba."""
    thickness, light = 2.0, (1.0, 2.0, 4.0)
    skin = replace(material("skin1"), eta=1.0)
    assert skin.sigma_a is not None and skin.sigma_s_prime is not None
    plate = Object(shapes.slab((120, 120, thickness), 200), skin)
    scene = Scene("slab", (plate,), (DirectionalLight((0, 0, -1), light),), CAMERA)
    mu, weights = np.polynomial.legendre.leggauss(5)
    mu, weights = 0.5 * (mu + 1), 0.5 * weights
    along = [(math.sqrt(1 - c * c), 0, -side * c) for side in (1, -1) for c in mu]
    rays = np.hstack([np.array([(0, 0, np.sign(-d[2]) * thickness / 2) for d in along]) - along, along])
    samples = 3000 if newest_llvm() else 1000
    leaving, variance = np.zeros((2, 10, 3))
    with Paths(scene, (8, 8), rays) as paths, tqdm(disable=True) as bar:
        for channel in range(3):
            leaving[:, channel], variance[:, channel] = paths.trace(channel, True, samples, bar)
    share = 2 * math.pi * np.tile(weights * mu, 2)[:, None] / light
    found = (share * leaving).reshape(2, 5, 3).sum(axis=1)
    error = np.sqrt((share**2 * variance).reshape(2, 5, 3).sum(axis=1))

    photons = trace([Layer(skin.sigma_a, skin.sigma_s_prime, 1.0, thickness=thickness)], 100_000, gpu=gpu)
    straight = np.exp(-thickness * (np.array(skin.sigma_a) + skin.sigma_s_prime))
    wanted = np.stack([photons.total, photons.total_transmittance - straight])
    error = np.hypot(error, [photons.total_error, photons.total_transmittance_error])
    assert (error < 0.06 * wanted).all()
    assert np.abs(found - wanted).max() < 4 * error.max()
    assert (np.abs(found - wanted) < 3.5 * error).all()


@needs_mitsuba
@pytest.mark.parametrize(
    ("light", "most"), [(EnvironmentLight((1, 1, 1)), 0.1), (DirectionalLight((-1, 0, 0), (1, 1, 1)), 0.2)]
)
def test_ball_by_the_profile_of_photons(gpu, light, most):
    """For a ball of milk with a radius of ten mean free paths, the profile of a half space has an RMS error of 8 %
    under a sky and 18 % under a beam from the side, plus noise."""
    milk = replace(material("wholemilk"), eta=1.0)
    radius = 10 / (3.21 + 0.0024)
    camera = OrthographicCamera((0, 0, 9 * radius), (0, 0, 0), height=2.05 * radius)
    stage = Stage(gpu, ball(light, medium=milk, camera=camera, mesh=shapes.sphere(radius, 2000)))
    photons = trace(milk.stack, 30_000, sky=True, gpu=gpu)
    truth = Volume(samples=256).estimate(stage, (12, 12))
    profile = integral(stage, (12, 12), profiles={0: photons})
    seen = truth.M.max(axis=2) > 0
    square, noise = (np.square(part[seen]).mean() for part in (profile.M - truth.M, truth.error))
    errs = math.sqrt(max(square - noise, 0.0) / np.square(truth.M[seen]).mean())
    assert 0.03 < errs < most
    assert 0.7 < profile.M[seen].mean() / truth.M[seen].mean() < 1.0  # a half space absorbs light that leaves the ball


@needs_mitsuba
def test_mitsuba_renders_an_exported_scene(mi, tmp_path):
    """With all channels at once, it is as bright as the white ball above where nothing absorbs, and darker
    elsewhere."""
    medium = replace(MATCHED, sigma_s_prime=(0.3, 0.5, 0.7), sigma_a=(0.0, 0.0, 0.7))
    camera = OrthographicCamera((0, 0, 90), (0, 0, 0), height=4.0)
    file, *_ = export(ball(SKY, medium=medium, camera=camera), tmp_path, (4, 4))
    image = np.array(mi.render(mi.load_file(str(file)), spp=300, seed=1))
    assert image.shape == (4, 4, 4)
    red, green, blue = image[..., :3].mean(axis=(0, 1))
    assert red == pytest.approx(1 - math.exp(-0.3 * 20), rel=0.05)
    assert green == pytest.approx(2, rel=0.05)
    assert blue < 0.6 * 4


@needs_mitsuba
def test_an_error_of_mitsuba_is_reported(gpu, monkeypatch):
    monkeypatch.setattr(mitsuba_paths, "newest_llvm", lambda: None)
    scene = ball(SKY)
    with Paths(scene, (8, 8), np.zeros((1, 6))) as paths, tqdm(disable=True) as bar:
        paths._variant = "nonsense"
        with (
            pytest.raises(RenderError, match=r"Mitsuba: the process ended: .*nonsense") as caught,
            pytest.warns(UserWarning),
        ):
            paths.trace(0, True, 2, bar)
    assert "\n" not in str(caught.value)
