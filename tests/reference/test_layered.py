"""The reference `layers` against closed forms and against Mitsuba."""

from __future__ import annotations

import importlib.util
import math
import warnings
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from wgsss.errors import InputError, Note
from wgsss.optics import Layer
from wgsss.reference.layered import LayeredSingleScattering
from wgsss.reference.layered_medium import LayeredMedium, sample_image
from wgsss.reference.mitsuba_scene import write_media
from wgsss.reference.mitsuba_xml import scene_xml
from wgsss.reference.refracted_light import henyey_greenstein
from wgsss.reference.single_scattering import logarithmic_mean, shares_of_layers
from wgsss.reference.volume import Volume
from wgsss.reference.world_surface import WorldSurface
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
    PointLight,
    RectLight,
    Scene,
    material,
    shapes,
)
from wgsss.scene.material import LayerMaps
from wgsss.stage import Stage
from wgsss.study.measurement import default_reference

needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="Mitsuba is not installed: pip install mitsuba"
)

SIGMA_A, SIGMA_S = np.array([0.2, 0.4, 0.1]), np.array([0.6, 0.3, 0.9])
FLUX = np.array([1.0, 2.0, 4.0])


def direction(angle: float) -> np.ndarray:
    """Return the direction at an angle (degrees) from +z in the plane of x and z."""
    return np.array([math.sin(math.radians(angle)), 0.0, math.cos(math.radians(angle))])


def box() -> Mesh:
    """Return a box whose top is at z = 0 and whose texture coordinates are x / 10 and -y / 10."""
    mesh = shapes.slab((400, 400, 200), 200)
    corners = mesh.positions[mesh.faces].reshape(-1, 3)
    uvs = (corners[:, :2] * (0.1, -0.1)).reshape(-1, 3, 2)
    return replace(mesh, positions=mesh.positions - (0, 0, 100), corner_uvs=uvs.astype(np.float32))


def flat(medium: Material, light, view: float, height: float = 4.0) -> Scene:
    """Return a scene that shows the top of the box at an angle."""
    camera = OrthographicCamera(tuple(300 * direction(view)), (0, 0, 0), up=(0, 1, 0), height=height)
    return Scene("flat", (Object(box(), medium),), (light,), camera)


def sun(angle: float) -> DirectionalLight:
    return DirectionalLight(tuple(-direction(angle)), tuple(FLUX))


def inside(angle: float, eta: float) -> np.ndarray:
    return direction(math.degrees(math.asin(math.sin(math.radians(angle)) / eta)))


def exact(layers, light: float, view: float, eta: float, rho_dt: float = 1.0) -> np.ndarray:
    """Return M of flat layers (thickness, sigma_s, sigma_t, g), by the exact integral of each layer."""
    w_i, w_o = inside(light, eta), inside(view, eta)
    slant = 1 / w_i[2] + 1 / w_o[2]
    radiance, carried = np.zeros(3), np.ones(3)
    for thickness, sigma_s, sigma_t, g in layers:
        through = np.exp(-sigma_t * thickness * slant)
        radiance += carried * sigma_s * henyey_greenstein(-w_i @ w_o, g) / (sigma_t * slant) * (1 - through) / w_o[2]
        carried = carried * through
    L_d = FLUX * math.cos(math.radians(light)) * rho_dt
    return math.pi / eta**2 * L_d / w_i[2] * radiance


def rho_dt(gpu, medium: Material, angle: float) -> float:
    """Return rho_dt of the product: what it lets through of a light at an angle."""
    scene = flat(replace(material("skin1"), eta=medium.eta), sun(angle), 0.0)
    L_d = Renderer(scene, make_method("lambert"), (2, 2), gpu).frame(aovs=["irradiance"]).aovs["irradiance"][0, 0, 0]
    return float(L_d) / (FLUX[0] * math.cos(math.radians(angle)))


# Parts.


def test_shares_of_layers():
    above = np.array([[[1.0, 3.0], [-1.0, 1.0], [-3.0, -1.0]]])  # two interfaces, which a ray crosses
    assert shares_of_layers(above) == pytest.approx(np.array([[[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]]))
    absent = np.array([[[0.0, 0.0], [-1.0, -1.0]]])
    assert shares_of_layers(absent)[0, 0].tolist() == [0.0, 0.0, 1.0]


def test_the_logarithmic_mean_is_that_of_an_exponential():
    a, b = np.array([1.0, 2.0, 1.0, 3.0]), np.array([math.exp(-2), 2.0, 0.0, 3.0 * (1 - 1e-9)])
    assert logarithmic_mean(a, b) == pytest.approx([(1 - math.exp(-2)) / 2, 2.0, 0.5, 3.0])


def test_images_are_sampled_between_the_centres_of_texels():
    image = np.array([[0.0, 1.0], [2.0, 3.0]])
    at = np.array([[0.25, 0.25], [0.5, 0.25], [0.0, 0.25], [0.25, 0.75]])
    assert sample_image(image, at, ("repeat", "repeat"), False) == pytest.approx([0.0, 0.5, 0.5, 2.0])
    assert sample_image(image, at, ("clamp", "clamp"), False) == pytest.approx([0.0, 0.5, 0.0, 2.0])
    assert sample_image(image, at + 1, ("repeat", "mirror"), False) == pytest.approx([2.0, 2.5, 2.5, 0.0])
    assert sample_image(image, at, ("clamp", "clamp"), True) == pytest.approx([0.0, 1.0, 0.0, 2.0])


def test_maps_scale_thickness_and_coefficients():
    gray = np.full((2, 2), 51, np.uint8)
    color = np.full((2, 2, 3), 188, np.uint8)
    maps = Maps(layers=(LayerMaps(gray, color, gray), LayerMaps()))
    layers = (Layer(SIGMA_A, SIGMA_S, 1.3, 5.0, 0.5), Layer(SIGMA_A, SIGMA_S, 1.3))
    medium = LayeredMedium(Material("two", layers=layers, maps=maps))
    assert medium.interfaces(np.zeros((1, 2))) == pytest.approx(1.0)
    at, linear = medium.coefficients(np.zeros((1, 2))), ((188 / 255 + 0.055) / 1.055) ** 2.4
    assert at.sigma_s[0, 0] == pytest.approx(0.2 * 2 * SIGMA_S * linear)
    assert at.sigma_t[0, 0] == pytest.approx(0.2 * (2 * SIGMA_S * linear + SIGMA_A))
    assert at.sigma_t[0, 1] == pytest.approx(SIGMA_S + SIGMA_A)


def test_closest_points_of_a_ball():
    surface = WorldSurface(Object(shapes.sphere(10.0, 4000), material("skin1")))
    points = np.random.default_rng(1).normal(size=(500, 3))
    points *= np.linspace(1.0, 9.9, 500)[:, None] / np.linalg.norm(points, axis=1, keepdims=True)
    distance, _ = surface.closest(points)
    assert distance == pytest.approx(10.0 - np.linalg.norm(points, axis=1), abs=0.02)


def test_a_profile_is_an_error(gpu):
    with pytest.raises(InputError, match="'skin': single scattering needs coefficients or layers, not a profile"):
        LayeredSingleScattering().estimate(Stage(gpu, flat(material("skin"), sun(0), 0)), (2, 2))


# Closed forms.


@pytest.mark.parametrize("eta", [1.0, 1.4])
@pytest.mark.parametrize(("light", "view"), [(0, 0), (45, 30), (75, 30), (75, -60)])
def test_homogeneous_half_space(gpu, light, view, eta):
    medium = Material("even", sigma_a=tuple(SIGMA_A), sigma_s_prime=tuple(SIGMA_S), eta=eta)
    estimate = LayeredSingleScattering().estimate(Stage(gpu, flat(medium, sun(light), view)), (3, 3))
    share = rho_dt(gpu, medium, light) if eta > 1 else 1.0
    truth = exact([(math.inf, SIGMA_S, SIGMA_S + SIGMA_A, 0.0)], light, view, eta, share)
    assert estimate.M_back is None
    assert estimate.M == pytest.approx(np.broadcast_to(truth, (3, 3, 3)), rel=0.002)
    assert (estimate.error < 0.001 * estimate.M).all()


def three_layers(eta: float, maps: Maps | None = None) -> Material:
    """Return three layers of 1, 2 mm and the rest, which differ tenfold."""
    layers = (
        Layer(0.1 * SIGMA_A, 0.1 * SIGMA_S, eta, 1.0, 0.3),
        Layer(2 * SIGMA_A, 0.5 * SIGMA_S, eta, 2.0, 0.6),
        Layer(0.5 * SIGMA_A, 2 * SIGMA_S, eta, math.inf, -0.2),
    )
    return Material("three", layers=layers, maps=maps or Maps())


def stack_of(medium: Material):
    return [(layer.thickness, layer.sigma_s, layer.sigma_s + layer.sigma_a, layer.g) for layer in medium.layers]


@pytest.mark.parametrize("eta", [1.0, 1.4])
@pytest.mark.parametrize(("light", "view"), [(0, 0), (45, 30), (75, 30)])
def test_flat_layers(gpu, light, view, eta):
    """Doubling both samplings moves it by less than 0.1 %."""
    medium = three_layers(eta)
    stage = Stage(gpu, flat(medium, sun(light), view))
    once, twice = (LayeredSingleScattering(48 * n, 24 * n).estimate(stage, (2, 2)) for n in (1, 2))
    truth = exact(stack_of(medium), light, view, eta, rho_dt(gpu, medium, light) if eta > 1 else 1.0)
    assert once.M == pytest.approx(np.broadcast_to(truth, (2, 2, 3)), rel=0.002)
    assert np.abs(twice.M / once.M - 1).max() < 0.001


def even(eta: float = 1.0) -> Material:
    return Material("even", sigma_a=tuple(SIGMA_A), sigma_s_prime=tuple(SIGMA_S), eta=eta)


@pytest.mark.parametrize("kind", ["point", "rect"])
def test_a_distant_lamp_is_like_a_directional_light(gpu, kind):
    """At 2 km, a point of 4e6 W/sr gives 1 W/m^2, and so does a rectangle of 4 m^2 and 1e6 W/(m^2 sr)."""
    place = tuple(2e6 * direction(45))
    if kind == "point":
        light = PointLight(place, tuple(4e6 * FLUX))
    else:
        light = RectLight(place, tuple(-direction(45)), (0, 1, 0), 2000, 2000, tuple(1e6 * FLUX), samples=4)
    one, other = (
        LayeredSingleScattering().estimate(Stage(gpu, flat(even(1.4), lamp, 30)), (2, 2)).M for lamp in (light, sun(45))
    )
    assert one == pytest.approx(other, rel=2e-3)


def test_the_sky_is_many_directional_lights(gpu):
    """M under a uniform sky of radiance 1 is the integral over the directions of the light."""
    stage = Stage(gpu, flat(even(), EnvironmentLight((1.0, 1.0, 1.0)), 0))
    cosines = (np.arange(200) + 0.5) / 200
    lit = [exact([(math.inf, SIGMA_S, SIGMA_S + SIGMA_A, 0.0)], math.degrees(math.acos(c)), 0, 1.0) for c in cosines]
    truth = 2 * math.pi * np.mean(lit, axis=0) / FLUX
    assert LayeredSingleScattering(sky=64).estimate(stage, (2, 2)).M[0, 0] == pytest.approx(truth, rel=0.02)
    assert not LayeredSingleScattering(sky=0).estimate(stage, (2, 2)).M.any()


def test_a_body_in_the_shadow_of_another_is_dark(gpu):
    scene = flat(even(), sun(0), 30)
    roof = Object(shapes.slab((40, 40, 2), 200), even(), translate=(0, 0, 60))
    stage = Stage(gpu, replace(scene, objects=(*scene.objects, roof)))
    assert not LayeredSingleScattering().estimate(stage, (2, 2)).M.any()


def test_the_default_reference_of_scenes_with_maps_of_layers():
    layers = three_layers(1.0)
    mapped = replace(layers, maps=Maps(layers=(LayerMaps(),) * 3))
    once, more, other = (SimpleNamespace(multiple=value) for value in (False, True, "off"))
    lambert = make_method("lambert")
    assert default_reference(flat(layers, sun(0), 0), [once]) == "integral"
    assert default_reference(flat(mapped, sun(0), 0), [once, other]) == "layers"
    assert default_reference(flat(mapped, sun(0), 0), [once, more]) == "volume"
    assert default_reference(flat(mapped, sun(0), 0), [lambert]) == "volume"


# Against Mitsuba.


def height_map(kind: str) -> Material:
    """Return layers over a square of 8 mm: flat, with gentle heights, or with veins of radius 0.35 mm."""
    y, x = (np.mgrid[0:256, 0:256] + 0.5) / 256 * 8.0
    upper, lower = np.full_like(x, 1.0), np.full_like(x, 0.8)
    if kind == "heights":
        upper += 0.4 * np.sin(2 * math.pi * x / 4) * np.cos(2 * math.pi * y / 4)
    if kind == "veins":
        half = np.sqrt(np.maximum(0.35**2 - (np.abs(x - 4) - 1.0 + 0.3 * np.sin(math.pi * y / 4)) ** 2, 0))
        upper, lower = 1.0 - half, 2 * half
    upper, lower = ((65535 * values / 2).round().astype(np.uint16) for values in (upper, lower))
    layers = (
        Layer(0.1 * SIGMA_A, 0.3 * SIGMA_S, 1.0, 2.0, 0.5),
        Layer(4 * SIGMA_A, 0.6 * SIGMA_S, 1.0, 2.0, 0.0),
        Layer(0.5 * SIGMA_A, 1.2 * SIGMA_S, 1.0, math.inf, -0.3),
    )
    maps = Maps(layers=(LayerMaps(upper), LayerMaps(lower), LayerMaps()), wrap=("clamp", "clamp"))
    return Material(kind, layers=layers, maps=maps)


def tile(medium: Material, light, view: float) -> Scene:
    """Return a scene that shows the top of a box of 8 x 8 x 5 mm."""
    mesh = shapes.slab((8, 8, 5), 200)
    corners = mesh.positions[mesh.faces].reshape(-1, 3)
    uvs = (0.5 + corners[:, :2] / (8.0, -8.0)).reshape(-1, 3, 2).astype(np.float32)
    camera = OrthographicCamera(tuple(30 * direction(view)), (0, 0, 2.5), up=(0, 1, 0), height=3.5)
    return Scene("tile", (Object(replace(mesh, corner_uvs=uvs), medium),), (light,), camera)


def test_the_export_of_layers(tmp_path):
    """There is one phase function for each g, nested, and the grids have the coefficients of the layers."""
    scene = tile(height_map("flat"), sun(45), 30)
    write_media(scene, tmp_path, None, 8000)
    medium = ElementTree.fromstring(scene_xml(scene, (8, 8))).find("shape/medium")
    blends = medium.findall(".//phase[@type='blendphase']")
    assert medium.attrib["type"] == "heterogeneous"
    assert [phase.find("float").attrib["value"] for phase in medium.iter("phase") if phase.attrib["type"] == "hg"] == [
        "-0.3", "0", "0.5",
    ]  # fmt: skip
    assert len(blends) == 2 and blends[1] in list(blends[0])
    for name in ("sigma_t", "albedo", "weight.1", "weight.2"):
        assert (tmp_path / f"1.{name}.vol").read_bytes().startswith(b"VOL\x03")
    data = (tmp_path / "1.sigma_t.vol").read_bytes()
    width, height, depth, channels = np.frombuffer(data[8:24], "<i4")
    sigma_t = np.frombuffer(data[48:], "<f4").reshape(depth, height, width, channels)
    layers = scene.objects[0].material.layers
    middle = [layer.sigma_s + layer.sigma_a for layer in layers]
    assert channels == 3
    assert sigma_t[-1, height // 2, width // 2] == pytest.approx(middle[0], rel=1e-5)
    assert sigma_t[depth // 2, height // 2, width // 2] == pytest.approx(middle[2], rel=1e-5)


@needs_mitsuba
def test_bounces_need_a_boundary_that_does_not_refract(gpu):
    with pytest.raises(InputError, match="bounces needs materials of eta 1"):
        Volume(bounces=1).estimate(Stage(gpu, tile(even(1.3), sun(0), 0)), (2, 2))


@needs_mitsuba
@pytest.mark.parametrize("kind", ["flat", "heights", "veins"])
def test_one_bounce_of_mitsuba(gpu, kind):
    """Both agree within the noise of Mitsuba plus 1 %."""
    stage, size = Stage(gpu, tile(height_map(kind), sun(45), 30)), (4, 4)
    layers = LayeredSingleScattering().estimate(stage, size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Note)  # Mitsuba without LLVM
        volume = Volume(samples=300, bounces=1, voxels=1 << 17).estimate(stage, size)
    difference, noise, total = (
        math.sqrt(np.square(values).mean()) for values in (layers.M - volume.M, volume.error, volume.M)
    )
    assert difference < 1.2 * noise + 0.01 * total
    assert layers.M.mean() == pytest.approx(volume.M.mean(), rel=0.04)
