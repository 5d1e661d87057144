"""Depth parallax against closed forms, Snell's law and measurements of layers with all scattering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import ABOVE, lit

from wgsss.errors import InputError
from wgsss.methods.depth_parallax import TAPS, TURN, DepthParallax, disc
from wgsss.optics import Layer, Layers
from wgsss.rendering import Renderer
from wgsss.scene import MATERIALS, DirectionalLight, Material, OrthographicCamera
from wgsss.scene.material import LayerMaps, Maps

DOWN = DirectionalLight((0, -1, 0), (1, 1, 1))
PERIOD, SIDE = 8.0, 40.0
PIXELS = 64
DEPTHS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)
SHIFTS = (0.14, 0.23, 0.44, 0.61, 0.73, 0.85)
"""Shift in mean free paths beyond that at depth 0, by paths of light through a half space with stripes: index-matched,
isotropic, albedo 0.99 over 0.5 and 0.99, period of 8 mean free paths, light at 0 degrees, view at 45."""
CONTRASTS = {1.5: 0.157, 2.0: 0.093, 3.0: 0.033}
"""Contrast of the same stripes seen at 0 degrees."""


def medium(thickness: float = np.inf, eta: float = 1.0, sigma: float = 1.0, albedo: float = 0.99) -> Layer:
    return Layer(np.full(3, sigma * (1.0 - albedo)), np.full(3, sigma * albedo), eta, thickness)


def stripes(low: float = 0.01 / 0.99, soft: bool = False) -> np.ndarray:
    """Return a colour map over SIDE mm with stripes across x, of linear values `low` and 1, or a wave between them."""
    x = ((np.arange(1024) + 0.5) / 1024 - 0.01) / 0.98 * SIDE
    values = np.where(x % PERIOD < PERIOD / 2, low, 1.0)
    if soft:
        values = low + (1.0 - low) * (0.5 + 0.5 * np.sin(2 * np.pi * x / PERIOD))
    srgb = np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)
    return np.broadcast_to((255 * srgb).round().astype(np.uint8)[None, :, None], (8, 1024, 3)).copy()


def stack(*layers: Layer, maps: tuple[LayerMaps, ...] = (), **options) -> Material:
    return Material("stack", layers=layers, specular=0.0, maps=Maps(layers=maps, **options))


def striped(cover: Layer, eta: float = 1.0, soft: bool = False, **options) -> Material:
    return stack(cover, medium(eta=eta), maps=(LayerMaps(), LayerMaps(color=stripes(soft=soft))), **options)


def view(degrees: float, height: float = 16.0) -> OrthographicCamera:
    """Return a camera tilted by `degrees` towards +x."""
    a = np.radians(degrees)
    return OrthographicCamera((50 * np.sin(a), 50 * np.cos(a), 0), (0, 0, 0), up=(0, 0, -1), height=height)


def render(gpu, material: Material, degrees: float = 0.0, height: int = PIXELS, **knobs) -> np.ndarray:
    """Return M_front (height, PIXELS, 3) of a square lit from above; a picture is 16 mm wide."""
    scene = lit(DOWN, material=material, camera=view(degrees, 16.0 * height / PIXELS))
    method = DepthParallax(**{"map_size": 256, **knobs})
    return Renderer(scene, method, (PIXELS, height), gpu).frame(aovs=["M_front"]).aovs["M_front"]


def phase(gpu, material: Material, degrees: float = 0.0, **knobs) -> float:
    """Return the place, mm along x, of the first harmonic of the stripes in a strip of a picture."""
    scene = lit(DOWN, material=material, camera=view(degrees, 0.25))
    method = DepthParallax(**{"map_size": 256, **knobs})
    M = Renderer(scene, method, (512, 8), gpu).frame(aovs=["M_front"]).aovs["M_front"]
    x = ((np.arange(512) + 0.5) / 512 - 0.5) * 16 / np.cos(np.radians(degrees))
    inside = np.abs(x) < 8.0  # two periods
    rows = M[4, inside, 0]
    wave = np.exp(2j * np.pi * x[inside] / PERIOD)
    basis = np.stack([np.ones(inside.sum()), wave.real, wave.imag], axis=-1)
    _, cosine, sine = np.linalg.lstsq(basis, rows, rcond=None)[0]
    return float(np.arctan2(sine, cosine) / (2 * np.pi) * PERIOD)


def shift(gpu, material: Material, degrees: float, **knobs) -> float:
    """Return by how much the stripes move towards +x, away from a place in the picture, when the view tilts."""
    moved = phase(gpu, material, degrees, **knobs) - phase(gpu, material, **knobs)
    return (moved + PERIOD / 2) % PERIOD - PERIOD / 2


@pytest.mark.parametrize(
    "layers",
    [(medium(2.5, 1.4), medium(eta=1.4)), (medium(2.5, 1.4), medium(3.0, 1.4, albedo=0.9), medium(eta=1.4))],
    ids=["two", "three"],
)
def test_even_layers_under_even_light_have_the_total_of_the_stack(gpu, layers) -> None:
    M = render(gpu, stack(*layers))
    np.testing.assert_allclose(M[16:48, 16:48].mean(axis=(0, 1)), Layers(layers).total, rtol=5e-3)


def test_a_layer_is_absent_where_its_thickness_map_is_black(gpu) -> None:
    half = np.zeros((1, 256), np.uint16)
    half[:, 128:] = 65535
    layers = (medium(2.5, albedo=0.8), medium())
    M = render(gpu, stack(*layers, maps=(LayerMaps(thickness=half), LayerMaps())))
    alone = render(gpu, stack(medium()))
    covered = render(gpu, stack(*layers))
    np.testing.assert_allclose(M[32, 2], alone[32, 2], rtol=0.02)
    np.testing.assert_allclose(M[32, -3], covered[32, -3], rtol=0.05)


def test_an_opacity_map_of_zero_removes_a_layer(gpu) -> None:
    clear = LayerMaps(opacity=np.zeros((1, 1), np.uint8))
    M = render(gpu, stack(medium(2.5, albedo=0.8), medium(), maps=(clear, LayerMaps())))
    np.testing.assert_allclose(M, render(gpu, stack(medium())), rtol=5e-3)


@pytest.mark.parametrize("tilt", [-15.0, 0.0, 15.0])
def test_a_thin_layer_shifts_what_is_below_by_snells_law(gpu, tilt: float) -> None:
    eta, d, degrees = 1.4, 0.5, 40.0  # a hundredth of a mean free path
    a = np.radians(tilt)
    normal = np.array([[[128 + 127 * np.sin(a), 128, 128 + 127 * np.cos(a)]]]).round().astype(np.uint8)
    m = (normal[0, 0] - 128.0) / 127.0
    tilt = np.degrees(np.arctan2(m[0], m[2]))
    cover = medium(d, eta, sigma=0.02)
    inside = np.arcsin(np.sin(np.radians(degrees - tilt)) / eta) + np.radians(tilt)
    none = striped(medium(1e-4, eta, sigma=0.02), eta, soft=True, normal=normal)
    moved = phase(gpu, striped(cover, eta, soft=True, normal=normal), degrees) - phase(gpu, none, degrees)
    assert moved == pytest.approx(d * np.tan(inside), rel=0.01)


def test_no_ray_is_shifted_beyond_that_of_grazing_light(gpu) -> None:
    eta, d = 1.4, 0.5
    moved = shift(gpu, striped(medium(d, eta, sigma=0.02), eta, soft=True), 85.0)
    assert 0.95 * d / np.sqrt(eta**2 - 1) < moved < d / np.sqrt(eta**2 - 1)


@pytest.mark.parametrize(("depth", "measured"), list(zip(DEPTHS, SHIFTS, strict=True)))
def test_a_scattering_cover_shifts_stripes_as_measured(gpu, depth: float, measured: float) -> None:
    assert abs(shift(gpu, striped(medium(depth)), 45.0) - measured) <= 0.15


@pytest.mark.parametrize(("depth", "measured"), list(CONTRASTS.items()))
def test_contrast_of_stripes_below_a_cover(gpu, depth: float, measured: float) -> None:
    M = render(gpu, striped(medium(depth)))[24:40, :, 0]
    contrast = (M.max() - M.min()) / (M.max() + M.min())
    assert 1 / 1.6 <= contrast / measured <= 1.6


def test_the_papers_model_shows_the_outer_layer_alone_at_depth_0_and_transparency_0(gpu) -> None:
    cover = medium(1e-6, albedo=0.8)
    M = render(gpu, striped(cover), 30.0, model="paper", transparency=0.0)
    outer = render(gpu, stack(replace(cover, thickness=np.inf)), 30.0, model="paper")
    np.testing.assert_array_equal(M, outer)


def test_the_papers_model_shifts_along_the_straight_ray(gpu) -> None:
    assert shift(gpu, striped(medium(1.0)), 45.0, model="paper", transparency=1.0) == pytest.approx(1.0, rel=0.03)


def test_the_papers_outer_layer_is_absent_where_its_thickness_map_is_black(gpu) -> None:
    none = LayerMaps(thickness=np.zeros((1, 1), np.uint8))
    material = stack(medium(1.0, albedo=0.8), medium(), maps=(none, LayerMaps()))
    M = render(gpu, material, model="paper", transparency=0.0, map_scale=1.0)
    np.testing.assert_allclose(M, render(gpu, stack(medium()), model="paper"), rtol=2e-3)


def test_the_papers_outer_layer_hides_the_inner_one_where_its_opacity_map_is_white(gpu) -> None:
    opaque = LayerMaps(opacity=np.full((1, 1), 255, np.uint8))
    material = stack(medium(1.0, albedo=0.8), medium(), maps=(opaque, LayerMaps(color=stripes())))
    outer = render(gpu, stack(medium(albedo=0.8)), model="paper")
    np.testing.assert_array_equal(render(gpu, material, model="paper", transparency=1.0), outer)


def ghosts(passes: int, radius: float, sigma: float = 2.0) -> float:
    """Return the largest difference of a blurred spot of `sigma` texels from the Gaussian of equal variance.

    It is relative to the peak of the Gaussian. Blurs multiply the transform of the spot.
    """
    size = 2 ** int(np.ceil(np.log2(4 * radius + 24)))
    kx, ky = np.meshgrid(*2 * [2 * np.pi * np.fft.fftfreq(size)])
    spot = np.exp(-0.5 * sigma**2 * (kx**2 + ky**2))
    gaussian = np.fft.ifft2(spot * np.exp(-(radius**2) / 8 * (kx**2 + ky**2))).real
    for i in range(passes):
        c, s = np.cos(i * TURN), np.sin(i * TURN)
        turned = disc(TAPS) @ np.array([[c, s], [-s, c]]) * radius / np.sqrt(passes)
        spot = spot * np.mean([np.exp(-1j * (kx * x + ky * y)) for x, y in turned], axis=0)
    return float(np.abs(np.fft.ifft2(spot).real - gaussian).max() / gaussian.max())


@pytest.mark.parametrize("radius", [8.0, 16.0, 32.0, 48.0])
def test_four_passes_of_the_disc_are_nearly_a_gaussian_and_one_pass_has_ghosts(radius: float) -> None:
    assert ghosts(4, radius) <= 0.10
    assert 0.3 <= ghosts(1, radius) <= 9.0


def test_the_disc_is_centred_and_has_the_variance_of_a_disc() -> None:
    points = disc(16)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(points.T @ points / 16, np.eye(2) / 4, atol=1e-12)


def test_a_material_of_which_only_the_profile_is_known_is_refused(gpu) -> None:
    skin = replace(MATERIALS["skin"], specular=0.0)
    with pytest.raises(InputError, match="oat06 needs coefficients or layers, but material 'skin' has only a profile"):
        Renderer(lit(DOWN, material=skin, camera=ABOVE), DepthParallax(), (8, 8), gpu)
