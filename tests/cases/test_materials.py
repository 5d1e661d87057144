"""Materials of glTF files: vertex colours, media, and reflection at the surface."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from balls import (
    ball,
    ball_primitive,
    checkered,
    colored,
    difference,
    encoded,
    loaded,
    picture,
    scene_and_notes,
    texture,
)
from gltfs import File

from wgsss.scene import MATERIALS, Scene

Array = np.ndarray[Any, Any]
TOPS = {"f4": 1.0, "u1": 255, "u2": 65535}

# --- colours of vertices ---------------------------------------------------------------------------------------------


def shades() -> Array:
    """Return linear colours of the vertices of the ball: red above, blue below, in multiples of 1 / 255."""
    share = ball()[1][:, 1]
    return np.round(np.stack([1 - share, np.full_like(share, 0.2), share, np.ones_like(share)], axis=1) * 255) / 255


def with_colors(kind: str, dtype: str, textured: bool = False) -> File:
    file = File()
    values = shades()[:, : int(kind[3])] * TOPS[dtype]
    colors = file.rows(np.round(values) if dtype != "f4" else values, kind, dtype, normalized=dtype != "f4")
    material = colored(file) if textured else None
    file.node(mesh=file.mesh(ball_primitive(file, material, attributes={"COLOR_0": colors})))
    return file


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("kind", ["VEC3", "VEC4"])
@pytest.mark.parametrize("dtype", ["u1", "u2"])
def test_vertex_colours_of_every_type_agree(tmp_path: Path, kind: str, dtype: str, textured: bool) -> None:
    """All types agree with floating point. Colours multiply the texture, or are the base colour without one."""
    expected = loaded(with_colors("VEC3", "f4", textured), tmp_path)
    assert difference(loaded(with_colors(kind, dtype, textured), tmp_path), expected) <= 1
    seen = picture(expected)
    if not textured:
        assert seen[14, 32, 0] > 1.2 * seen[14, 32, 2] and seen[50, 32, 2] > 1.2 * seen[50, 32, 0]
    assert difference(expected, loaded(checkered(), tmp_path)) > 50


def test_vertex_colours_may_be_on_one_of_two_parts(tmp_path: Path) -> None:
    """The part without colours is white. Parts with the same material form one body."""
    file = File()
    colors = file.rows(shades()[:, :3], "VEC3")
    file.node(
        mesh=file.mesh(ball_primitive(file, attributes={"COLOR_0": colors}), ball_primitive(file, None, (0.12, 0, 0)))
    )
    scene = loaded(file, tmp_path)
    mesh = scene.objects[0].mesh
    assert len(scene.objects) == 1 and mesh.corner_colors is not None
    right = mesh.positions[mesh.faces][..., 0].mean(axis=1) > 60
    assert (mesh.corner_colors[right] == 1).all() and mesh.corner_colors[~right].min() < 0.3
    seen = picture(scene)
    assert np.ptp(seen[26, 44, :3]) < 30 < np.ptp(seen[26, 16, :3])


def test_vertex_colours_replace_or_tint_the_colour_of_a_material(tmp_path: Path) -> None:
    """Vertex colours replace the colour of a measured material, and multiply a colour that the user sets."""
    path = with_colors("VEC4", "u1").save(tmp_path / "ball.glb")
    assert scene_and_notes(path, material="skin")[0].objects[0].material.base_color == (1, 1, 1)
    asked = scene_and_notes(path, material={"preset": "skin", "base_color": [0.5, 0.6, 0.7]})[0]
    assert asked.objects[0].material.base_color == (0.5, 0.6, 0.7)


def test_a_base_colour_factor_is_linear_and_multiplies_the_texture(tmp_path: Path) -> None:
    file = checkered()
    file.tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.25, 1.0, 1.0]
    tinted, plain = loaded(file, tmp_path), loaded(checkered(), tmp_path)
    assert tinted.objects[0].material.base_color == (0.5, 0.25, 1.0)
    by_hand = replace(plain.objects[0], material=replace(plain.objects[0].material, base_color=(0.5, 0.25, 1.0)))
    assert difference(tinted, replace(plain, objects=(by_hand,))) == 0


# --- media -----------------------------------------------------------------------------------------------------------

COLOR, ATTENUATION, DISTANCE = (0.9, 0.6, 0.4), (0.9, 0.5, 0.3), 0.0013
VOLUME = {"thicknessFactor": 0.1, "attenuationDistance": DISTANCE, "attenuationColor": list(ATTENUATION)}


def medium(color: Any = COLOR, g: float = 0.0, strength: float = 1.0) -> tuple[Array, Array]:
    """Compute the coefficients, 1/mm, from the text of the drafts.

    The single-scattering albedo follows from the colour after many events (Kulla & Conty 2017), and scattering is
    reduced by the anisotropy.
    """
    r = np.asarray(color) * strength
    s = 4.09712 + 4.20863 * r - np.sqrt(9.59217 + 41.6808 * r + 17.7126 * r * r)
    albedo = (1 - s * s) / (1 - g * s * s)
    sigma_t = -np.log(ATTENUATION) / (DISTANCE * 1000)
    return sigma_t * (1 - albedo), sigma_t * albedo * (1 - g)


def volumetric(scatter: dict[str, Any] | None, volume: dict[str, Any] | None = None, **more: Any) -> File:
    extensions = {"KHR_materials_volume": VOLUME if volume is None else volume, **more}
    if scatter is not None:
        name = "KHR_materials_scatter" if "strength" in scatter else "KHR_materials_volume_scatter"
        extensions[name] = {key: value for key, value in scatter.items() if key != "strength"}
    file = File()
    material = file.add("materials", name="wax", extensions=extensions)
    file.node(mesh=file.mesh(ball_primitive(file, material)))
    return file


@pytest.mark.parametrize(
    ("scatter", "g", "strength"),
    [
        ({"multiscatterColor": list(COLOR)}, 0.0, 1.0),
        ({"multiscatterColorFactor": list(COLOR)}, 0.0, 1.0),
        ({"multiscatterColor": list(COLOR), "scatterAnisotropy": 0.5}, 0.5, 1.0),
        ({"multiscatterColor": list(COLOR), "scatterAnisotropy": -0.3}, -0.3, 1.0),
        ({"strength": 1, "multiscatterColorFactor": list(COLOR), "scatterStrengthFactor": 1.0}, 0.0, 1.0),
        ({"strength": 1, "multiscatterColor": list(COLOR), "scatterStrengthFactor": 0.5}, 0.0, 0.5),
        (
            {"strength": 1, "multiscatterColorFactor": list(COLOR), "scatterFactor": 0.7, "scatterAnisotropy": 0.2},
            0.2,
            0.7,
        ),
    ],
)
def test_a_medium_of_the_file_is_used(tmp_path: Path, scatter: dict[str, Any], g: float, strength: float) -> None:
    """The names of the draft and those of its successor give the same medium."""
    scene, lines = scene_and_notes(volumetric(scatter, KHR_materials_ior={"ior": 1.4}), tmp_path)
    material = scene.objects[0].material
    sigma_a, sigma_s_prime = medium(COLOR, g, strength)
    assert (material.name, material.eta) == ("wax", 1.4)
    assert material.sigma_a == pytest.approx(sigma_a, rel=1e-4)
    assert material.sigma_s_prime == pytest.approx(sigma_s_prime, rel=1e-4)
    assert lines == []


def test_a_medium_is_drawn_like_a_material_with_its_coefficients(tmp_path: Path) -> None:
    path = volumetric({"multiscatterColor": list(COLOR)}).save(tmp_path / "ball.glb")
    sigma_a, sigma_s_prime = (tuple(float(x) for x in c) for c in medium())
    by_hand = {"sigma_a": list(sigma_a), "sigma_s_prime": list(sigma_s_prime), "eta": 1.5}
    own, table = scene_and_notes(path)[0], scene_and_notes(path, material=by_hand)[0]
    assert difference(own, table, "jimenez15") <= 1
    assert difference(own, scene_and_notes(path, material="marble")[0], "jimenez15") > 10


def test_a_chosen_material_replaces_the_medium(tmp_path: Path) -> None:
    scene, _ = scene_and_notes(volumetric({"multiscatterColor": list(COLOR)}), tmp_path, material="ketchup")
    assert scene.objects[0].material.name == "ketchup"
    assert scene.objects[0].material.sigma_a == MATERIALS["ketchup"].sigma_a


@pytest.mark.parametrize("size_mm", [10, 1000])
def test_a_medium_is_scaled_with_its_mesh(tmp_path: Path, size_mm: float) -> None:
    """A scale of the mesh does not change the picture, because it also scales the unit of the medium."""
    path = volumetric({"multiscatterColor": list(COLOR)}).save(tmp_path / "ball.glb")
    scaled, lines = scene_and_notes(path, size_mm=size_mm)
    ratio = size_mm / np.ptp(scene_and_notes(path)[0].bounds, axis=0).max()
    assert np.multiply(scaled.objects[0].material.sigma_a, ratio) == pytest.approx(medium()[0], rel=1e-4)
    assert lines == []


@pytest.mark.parametrize(
    ("scatter", "volume", "words"),
    [
        (None, None, "KHR_materials_volume left out because nothing scatters in it"),
        ({"multiscatterColor": list(COLOR)}, {"thicknessFactor": 0.1}, "nothing scatters in it"),
        ({"multiscatterColor": list(COLOR)}, {"attenuationColor": list(ATTENUATION)}, "nothing scatters in it"),
        ({}, None, "nothing scatters in it"),
        ({"strength": 1, "multiscatterColorFactor": list(COLOR)}, None, "nothing scatters in it"),
        ({"strength": 1, "scatterStrengthFactor": 1}, {**VOLUME, "thicknessFactor": 0}, "walls are thin"),
    ],
)
def test_a_medium_without_scattering_is_noted(
    tmp_path: Path, scatter: dict[str, Any] | None, volume: dict[str, Any] | None, words: str
) -> None:
    scene, lines = scene_and_notes(volumetric(scatter, volume), tmp_path)
    assert scene.objects[0].material.name == "marble"
    assert len(lines) == 1 and words in lines[0]


def test_scattering_without_a_volume_is_noted(tmp_path: Path) -> None:
    file = checkered()
    file.tree["materials"][0]["extensions"] = {"KHR_materials_volume_scatter": {"multiscatterColor": list(COLOR)}}
    _, lines = scene_and_notes(file, tmp_path)
    assert len(lines) == 1 and "KHR_materials_volume_scatter" in lines[0] and "KHR_materials_volume" in lines[0]


# --- the surface -----------------------------------------------------------------------------------------------------


def surfaced(tmp_path: Path, **extensions: Any) -> tuple[Scene, list[str]]:
    file = checkered()
    file.tree["materials"][0]["extensions"] = extensions
    return scene_and_notes(file, tmp_path)


@pytest.mark.parametrize(("ior", "eta"), [(1.0, 1.0), (1.33, 1.33), (2.42, 2.42)])
def test_the_index_of_refraction_of_the_file_is_used(tmp_path: Path, ior: float, eta: float) -> None:
    scene, lines = surfaced(tmp_path, KHR_materials_ior={"ior": ior})
    assert scene.objects[0].material.eta == eta and lines == []


@pytest.mark.parametrize("ior", [0, 0.9, 40])
def test_an_invalid_index_of_refraction_is_noted(tmp_path: Path, ior: float) -> None:
    """KHR_materials_ior defines 0 as infinity."""
    scene, lines = surfaced(tmp_path, KHR_materials_ior={"ior": ior})
    assert len(lines) == 1 and f"refraction of {ior:g}" in lines[0]
    assert scene.objects[0].material.eta == MATERIALS["marble"].eta


def test_an_index_of_refraction_of_one_reflects_nothing(tmp_path: Path) -> None:
    scene, _ = surfaced(tmp_path, KHR_materials_ior={"ior": 1})
    shiny, _ = surfaced(tmp_path)
    assert picture(scene)[..., :3].max() < picture(shiny)[..., :3].max()
    assert np.isfinite(picture(scene, "jimenez15")).all()


@pytest.mark.parametrize("factor", [0.0, 0.3, 1.0])
def test_the_specular_factor_of_the_file_is_used(tmp_path: Path, factor: float) -> None:
    scene, lines = surfaced(tmp_path, KHR_materials_specular={"specularFactor": factor})
    assert scene.objects[0].material.specular == factor and lines == []


@pytest.mark.parametrize(("roughness", "expected"), [(0.0, 0.02), (0.4, 0.4), (1, 1.0)])
def test_the_roughness_of_the_file_is_used(tmp_path: Path, roughness: float, expected: float) -> None:
    file = checkered()
    file.tree["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = roughness
    assert loaded(file, tmp_path).objects[0].material.roughness == pytest.approx(expected)


def test_a_specular_texture_uses_alpha(tmp_path: Path) -> None:
    file = checkered()
    image = np.zeros((2, 2, 4), np.uint8)
    image[..., 3] = 77
    number = texture(file, encoded(image))
    file.tree["materials"][0]["extensions"] = {"KHR_materials_specular": {"specularTexture": {"index": number}}}
    specular = loaded(file, tmp_path).objects[0].material.maps.specular
    assert specular is not None and (specular == 77).all()
