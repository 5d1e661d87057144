"""Single scattering in layers: closed forms of homogeneous media, and brute force in float64 for layers and balls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from layered_ball import ball, by_brute_force
from layered_cylinder import on_a_cylinder, rolled
from layered_patch import KINDS, brute_force, patch, relative_error
from scenes import lit, plane

from wgsss.errors import InputError
from wgsss.methods.layer_textures import interface_depths, layer_tints
from wgsss.methods.subsurface_texture_mapping import THESIS
from wgsss.optics import SKIN_GAUSSIANS, Layer
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight, EnvironmentLight, Material, OrthographicCamera, Scene
from wgsss.scene.material import LayerMaps, Maps

Array = npt.NDArray[Any]

SIGMA_A, SIGMA_S, G = np.array((0.1, 0.2, 0.4)), np.array((0.7, 0.6, 0.4)), 0.5
GREY = Material("grey", layers=(Layer((0.1,) * 3, (0.7,) * 3, 1.0),), specular=0.0)
SIZE = 16
PRINTED = {"rule": "printed", "light": "eq14", "distance": "tangent"}


def drawn(gpu: Any, scene: Scene, size: int = SIZE, **knobs: Any) -> Array:
    """Return M."""
    image = Renderer(scene, make_method("francois06", knobs), (size, size), gpu).frame(aovs=["M_front"], timed=False)
    return image.aovs["M_front"]


def level(material: Material, light: float, view: float = 30.0) -> Scene:
    """Make a plane, lit and seen at angles from its normal, degrees."""
    a, b = np.radians(light), np.radians(view)
    camera = OrthographicCamera((50 * np.sin(b), 50 * np.cos(b), 0), (0, 0, 0), up=(0, 0, -1), height=5)
    return lit(DirectionalLight((-np.sin(a), -np.cos(a), 0), (1, 1, 1)), mesh=plane(), material=material, camera=camera)


def closed_form(light: float, view: float, eta: float, sigma_s: Array, sigma_t: Array, g: float) -> Array:
    """Return M of a half space that scatters once: pi / eta^2 sigma_s / sigma_t p L_d / (mu_i + mu_o)."""
    sines = np.sin(np.radians([light, view])) / eta
    mu = np.sqrt(1 - sines**2)
    cosine = -(mu.prod() + sines.prod())
    phase = (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * cosine) ** 1.5)
    result: Array = np.pi / eta**2 * sigma_s / sigma_t * phase * np.cos(np.radians(light)) / mu.sum()
    return result


@pytest.mark.parametrize("eta", [1.0, 1.4])
@pytest.mark.parametrize("light", [0, 45, 75])
@pytest.mark.parametrize("knobs", [{}, {"light": "eq14"}, {"distance": "tangent"}], ids=str)
def test_a_homogeneous_half_space_is_exact_with_five_steps(gpu, eta, light, knobs):
    material = Material("one", layers=(Layer(SIGMA_A, SIGMA_S * (1 - G), eta, g=G),), specular=0.0)
    M = drawn(gpu, level(material, light), steps=5, **knobs)
    exact = closed_form(light, 30.0, eta, SIGMA_S, SIGMA_A + SIGMA_S, G)
    np.testing.assert_allclose(M, np.broadcast_to(exact, M.shape), rtol=1e-4)


@pytest.mark.parametrize(("steps", "excess"), [(5, 1.84), (15, 1.25), (100, 1.03)])
def test_the_sum_of_the_thesis_is_too_bright(gpu, steps, excess):
    M = drawn(gpu, level(GREY, 0.0), steps=steps, **PRINTED)
    np.testing.assert_allclose(M / closed_form(0.0, 30.0, 1.0, 0.7, 0.8, 0.0), excess, atol=0.02)


def test_the_middles_of_steps_are_more_accurate_than_their_near_ends(gpu):
    M = drawn(gpu, level(GREY, 0.0), **{**PRINTED, "rule": "midpoint", "steps": 15})
    np.testing.assert_allclose(M / closed_form(0.0, 30.0, 1.0, 0.7, 0.8, 0.0), 1.0, atol=0.02)


def test_without_refraction_the_picture_is_twice_as_bright(gpu):
    material = Material("smooth", layers=(Layer((0.1,) * 3, (0.7,) * 3, 1.4),), roughness=0.05)
    scene = level(material, 0.0, 0.0)
    straight, refracted = drawn(gpu, scene, refraction=False), drawn(gpu, scene)
    np.testing.assert_allclose(straight / refracted, 2.07, atol=0.02)


def test_schlick_is_darker_than_henyey_greenstein_towards_the_light(gpu):
    material = Material("forward", layers=(Layer(SIGMA_A, SIGMA_S * 0.2, 1.0, g=0.8),), specular=0.0)
    scene = level(material, 0.0, 0.0)
    np.testing.assert_allclose(drawn(gpu, scene, phase="schlick") / drawn(gpu, scene), 0.34, atol=0.01)


MOST_10 = {"flat": 0.02, "gentle": 0.02, "blobs": 0.03, "veins": 0.05}
MOST_15 = {"flat": 0.01, "gentle": 0.015, "blobs": 0.035, "veins": 0.035}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("light", [0, 45, 75])
def test_layers_on_a_level_patch(gpu, kind, light):
    scene = patch(kind, light)
    exact = brute_force(scene, SIZE)
    assert relative_error(drawn(gpu, scene), exact) <= MOST_10[kind]
    assert relative_error(drawn(gpu, scene, steps=15), exact) <= MOST_15[kind]
    assert relative_error(drawn(gpu, scene, steps=50, light_steps=16), exact) <= 0.005


@pytest.mark.parametrize("kind", ["flat", "gentle", "veins"])
@pytest.mark.parametrize("light", [0, 45, 75])
def test_five_segments_are_no_worse_than_a_hundred_printed_steps(gpu, kind, light):
    scene = patch(kind, light)
    exact = brute_force(scene, SIZE)
    printed = relative_error(drawn(gpu, scene, steps=100, **PRINTED), exact)
    assert relative_error(drawn(gpu, scene, steps=5, light="eq14"), exact) <= printed


@pytest.mark.parametrize("view", [60, 80])
def test_grazing_views(gpu, view):
    scene = patch("veins", 45, view)
    assert relative_error(drawn(gpu, scene), brute_force(scene, SIZE)) <= 0.05


def test_refraction_into_layers(gpu):
    scene = patch("veins", 45, 60, eta=1.4)
    assert relative_error(drawn(gpu, scene), brute_force(scene, SIZE)) <= 0.05


def test_equation_20_creates_light_and_equation_14_never(gpu):
    """Two layers only absorb. The two that scatter send back at most what one of them does alone."""
    clear = [Layer((1.5,) * 3, (1e-6,) * 3, 1.0, thickness=t) for t in (0.2, 1.0)]
    below = Layer((0.4,) * 3, (0.4,) * 3, 1.0)
    top = Layer((0.4,) * 3, (0.4,) * 3, 1.0, thickness=0.3)
    material = replace(GREY, layers=(top, *clear, below))
    scene = level(material, 75.0)
    limit = closed_form(75.0, 30.0, 1.0, 0.4, 0.8, 0.0)
    assert (drawn(gpu, scene, light="eq14") <= limit * 1.001).all()
    assert (drawn(gpu, scene, light="eq20") > 1.2 * limit).all()


@pytest.mark.parametrize("light", [0, 45, 75])
def test_layers_that_follow_a_ball_of_8_mm(gpu, light):
    scene = ball(8.0, light)
    exact, inside = by_brute_force(scene, 8.0, 32)
    shadow, tangent = (
        relative_error(drawn(gpu, scene, 32, distance=distance)[inside][None], exact[inside][None])
        for distance in ("shadow", "tangent")
    )
    assert shadow <= 0.05
    assert tangent >= 2.0 * shadow


@pytest.mark.parametrize("light", [0, 45, 75])
def test_veins_around_a_cylinder_of_8_mm(gpu, light):
    scene, exact = rolled("veins", light), on_a_cylinder("veins", light, 24)
    shadow, tangent = (relative_error(drawn(gpu, scene, 24, distance=kind), exact) for kind in ("shadow", "tangent"))
    assert shadow <= 0.05
    assert tangent >= 2.0 * shadow


def test_the_ray_ends_where_it_leaves_the_body(gpu):
    """Seen along its axis, a thin disc of a homogeneous medium is as bright as a slab of its thickness."""
    thick = 0.5
    top, bottom = plane(20.0), plane(20.0, y=-thick)
    faces = np.concatenate([top.faces, bottom.faces[:, ::-1] + len(top.positions)])
    mesh = replace(top, positions=np.concatenate([top.positions, bottom.positions]), faces=faces, corner_uvs=None)
    camera = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=5)
    scene = lit(DirectionalLight((0, -1, 0), (1, 1, 1)), mesh=mesh, material=GREY, camera=camera)
    exact = closed_form(0.0, 0.0, 1.0, 0.7, 0.8, 0.0) * (1 - np.exp(-2 * 0.8 * thick))
    np.testing.assert_allclose(drawn(gpu, scene), exact, rtol=2e-3)


def test_colours_and_opacities_multiply_the_coefficients(gpu):
    color, opacity = np.full((1, 1, 3), 188, np.uint8), np.full((1, 1), 51, np.uint8)  # linear 0.503, and 0.2
    layer = Layer(SIGMA_A, SIGMA_S, 1.0)
    maps = Maps(layers=(LayerMaps(color=color, opacity=opacity),))
    material = Material("tinted", layers=(layer,), specular=0.0, maps=maps)
    share = ((188 / 255 + 0.055) / 1.055) ** 2.4
    exact = closed_form(45.0, 30.0, 1.0, SIGMA_S * share, SIGMA_A + SIGMA_S * share, 0.0)
    M = drawn(gpu, level(material, 45.0))
    np.testing.assert_allclose(M, np.broadcast_to(exact, M.shape), rtol=2e-3)


def test_light_of_a_uniform_sky(gpu):
    sky = EnvironmentLight((1.0, 1.0, 1.0))
    scene = replace(level(GREY, 0.0), lights=(sky,))
    M = drawn(gpu, scene)
    exact = closed_form(0.0, 30.0, 1.0, 0.7, 0.8, 0.0) * np.pi  # as if it came along the normal
    np.testing.assert_allclose(M, exact, rtol=0.02)


@pytest.mark.parametrize("noise", ["white", "uv"])
def test_noise_differs_from_pixel_to_pixel_and_keeps_the_mean(gpu, noise):
    scene = patch("gentle", 45)
    even, noisy = (drawn(gpu, scene, 32, noise=which, **PRINTED) for which in ("none", noise))
    assert np.abs(noisy / even - 1).max() > 0.01
    np.testing.assert_allclose(noisy.mean(), even.mean(), rtol=0.05)


def test_the_preset_of_the_thesis_draws(gpu):
    assert (drawn(gpu, patch("veins", 45, eta=1.4), **THESIS) > 0).all()


def test_interfaces_are_sums_of_thicknesses_and_maps_of_two_sizes_are_joined():
    layers = tuple(Layer(SIGMA_A, SIGMA_S, thickness=t) for t in (2.0, 4.0, np.inf))
    first, second = np.array([[0, 65535]], np.uint16), np.array([[255], [0]], np.uint8)
    maps = Maps(layers=(LayerMaps(thickness=first), LayerMaps(thickness=second), LayerMaps()), nearest=True)
    np.testing.assert_allclose(interface_depths(layers, maps), [[[0, 4], [2, 6]], [[0, 0], [2, 2]]])
    assert layer_tints(layers, maps) is None


def test_a_material_known_by_its_profile_is_refused(gpu):
    scene = lit(material=Material("skin", gaussians=SKIN_GAUSSIANS))
    with pytest.raises(InputError, match="francois06 needs coefficients or layers, but material 'skin' has only a pro"):
        Renderer(scene, make_method("francois06"), (8, 8), gpu)


def test_more_than_four_layers_are_refused(gpu):
    layers = tuple(Layer(SIGMA_A, SIGMA_S, thickness=t) for t in (1, 1, 1, 1, np.inf))
    with pytest.raises(InputError, match="'many' has 5 layers, francois06 takes at most 4"):
        Renderer(lit(material=Material("many", layers=layers)), make_method("francois06"), (8, 8), gpu)


@dataclass(frozen=True)
class Growing:
    """A body that grows by a third in a second."""

    period_s: float = 10.0

    def apply(self, positions: Any, time_s: float) -> Any:
        return np.asarray(positions, np.float32) * np.float32(1 + time_s / 3)


def test_a_deforming_ball_is_as_accurate_as_one_at_rest(gpu):
    scene, small = ball(8.0, 75), ball(6.0, 75)
    growing = replace(small.objects[0], motion=Growing())
    renderer = Renderer(replace(scene, objects=(growing,)), make_method("francois06"), (32, 32), gpu)
    renderer.frame(timed=False)
    M = renderer.frame(1.0, aovs=["M_front"], timed=False).aovs["M_front"]
    exact, inside = by_brute_force(scene, 8.0, 32)
    assert relative_error(M[inside][None], exact[inside][None]) <= 0.05
