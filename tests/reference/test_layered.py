"""The reference `layers` against closed forms and against Mitsuba."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.optics import Layer
from wgsss.reference.layered import LayeredSingleScattering
from wgsss.reference.layered_medium import LayeredMedium, sample_image
from wgsss.reference.single_scattering import henyey_greenstein, logarithmic_mean, shares_of_layers
from wgsss.reference.world_surface import WorldSurface
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import (
    DirectionalLight,
    Maps,
    Material,
    Mesh,
    Object,
    OrthographicCamera,
    Scene,
    material,
    shapes,
)
from wgsss.scene.material import LayerMaps
from wgsss.stage import Stage

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


def test_closest_points_of_a_ball(gpu):
    ball = Object(shapes.sphere(10.0, 4000), material("skin1"))
    scene = Scene("ball", (ball,), (sun(0),), OrthographicCamera((0, 0, 90), (0, 0, 0), height=22.0))
    stage = Stage(gpu, scene)
    surface = WorldSurface(stage.bodies[0])
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
