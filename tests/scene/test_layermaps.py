"""Maps of the layers of a material: their files, their checks, and the profile of their means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from wgsss.errors import InputError
from wgsss.optics import Layer, Layers
from wgsss.scene import Maps, Material, Object, load_material, load_scene, shapes
from wgsss.scene.builtin import SCENES
from wgsss.scene.geometry import is_closed
from wgsss.scene.images import read_levels
from wgsss.scene.layermaps import LayerMaps, mean_stack
from wgsss.scene.layerscenes import organ_material, skin_material

TOP = "thickness = 2.0\nsigma_a = [0.1, 0.1, 0.1]\nsigma_s_prime = [2, 3, 4]\neta = 1.4\n"
BELOW = "sigma_a = [0.2, 0.2, 0.2]\nsigma_s_prime = [1, 1, 1]\neta = 1.4\n"
RAMP = np.arange(64, dtype=np.uint16).reshape(8, 8) * 1001  # not multiples of 257


def layers(*thickness: float, eta: float = 1.4) -> tuple[Layer, ...]:
    return tuple(Layer(np.full(3, 0.1), np.full(3, 2.0), eta, thickness=t) for t in thickness)


def write(folder: Path, top: str = TOP, below: str = BELOW, *, more: str = "") -> Path:
    Picture.fromarray(RAMP).save(folder / "ramp.png")
    Picture.fromarray(np.full((2, 2, 3), (255, 188, 0), np.uint8)).save(folder / "color.png")
    path = folder / "m.toml"
    path.write_text(f"[[layers]]\n{top}{more}\n[[layers]]\n{below}")
    return path


def refused(path: Path) -> str:
    with pytest.raises(InputError) as error:
        load_material(path)
    assert "\n" not in str(error.value)
    return str(error.value)


# --- files -----------------------------------------------------------------------------------------------------------


def test_a_material_file_brings_maps_and_keeps_16_bits(tmp_path: Path) -> None:
    keys = 'thickness_map = "ramp.png"\ncolor_map = "color.png"\nopacity_map = "ramp.png"\n'
    top, below = load_material(write(tmp_path, more=keys)).maps.layers
    assert top.thickness is not None and top.opacity is not None and top.color is not None
    assert top.thickness.dtype == np.uint16 and np.array_equal(top.thickness, RAMP)
    assert np.array_equal(top.opacity, RAMP)
    assert top.color.shape == (2, 2, 3) and top.color[0, 0].tolist() == [255, 188, 0]
    assert below.empty


def test_layers_without_maps_have_none(tmp_path: Path) -> None:
    assert load_material(write(tmp_path)).maps.layers == ()


def test_grey_levels_keep_the_depth_of_the_file(tmp_path: Path) -> None:
    Picture.fromarray(RAMP.astype(np.uint8)).save(tmp_path / "8.png")
    assert read_levels(tmp_path / "8.png").dtype == np.uint8
    Picture.fromarray(np.linspace(0, 1, 16, dtype=np.float32).reshape(4, 4)).save(tmp_path / "f.tif")
    assert read_levels(tmp_path / "f.tif").ravel()[[0, 5, -1]].tolist() == [0, 21845, 65535]


def test_the_maps_stay_with_the_material_on_a_mesh_with_textures(tmp_path: Path) -> None:
    path = write(tmp_path, more='thickness_map = "ramp.png"\n')
    (plate,) = load_scene("slab", vertices=100, material=path).objects
    assert np.array_equal(plate.material.maps.layers[0].thickness, RAMP)
    (other,) = load_scene("skin-patch", vertices=100, material="marble").objects
    assert other.material.maps.layers == ()


# --- checks ----------------------------------------------------------------------------------------------------------


def test_a_missing_map_names_file_table_and_key(tmp_path: Path) -> None:
    text = refused(write(tmp_path, more='thickness_map = "none.png"\n'))
    assert "m.toml: [[layers]] 1: thickness_map" in text and "none.png" in text


@pytest.mark.parametrize(
    ("top", "below", "expected"),
    [
        (TOP.replace("2.0", "-1.0"), BELOW, "[[layers]] 1: thickness must be"),
        (TOP.replace("2.0", "nan"), BELOW, "[[layers]] 1: thickness must be"),
        (TOP.replace("thickness = 2.0\n", ""), BELOW, "layer 1 is infinitely thick"),
        (TOP, BELOW + 'thickness_map = "ramp.png"\n', "thickness_map of layer 2: the last layer is infinitely thick"),
        (TOP + 'color_map = "color.png"\n', BELOW + "thickness = 3\n", "thickness of layer 2: the last"),
        (TOP + 'thickness_map = "ramp.png"\n', BELOW.replace("1.4", "1.3"), "thickness_map of layer 1: eta of layer 2"),
        (TOP + 'color_mop = "color.png"\n', BELOW, "did you mean 'color_map'"),
        (TOP + "color_map = 3\n", BELOW, "[[layers]] 1: color_map must be the path of a file"),
    ],
)
def test_bad_layers_are_refused_in_one_line(tmp_path: Path, top: str, below: str, expected: str) -> None:
    text = refused(write(tmp_path, top, below))
    assert "m.toml" in text and expected in text


def test_five_layers_with_maps_are_refused() -> None:
    five = layers(1, 1, 1, 1, np.inf)
    with pytest.raises(InputError, match="layers with maps can be 4 at most, not 5"):
        Material("m", layers=five, maps=Maps(layers=(LayerMaps(),) * 5))
    assert Material("m", layers=five).layers == five


def test_layers_of_different_eta_can_have_maps_of_colour() -> None:
    color = LayerMaps(color=np.full((1, 1, 3), 255, np.uint8))
    both = layers(2.0) + layers(np.inf, eta=1.3)
    assert Material("m", layers=both, maps=Maps(layers=(color, LayerMaps()))).eta == 1.4


def test_a_mesh_without_texture_coordinates_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, more='thickness_map = "ramp.png"\n')
    with pytest.raises(InputError, match=r"sphere: the mesh has no texture coordinates.* layers of material 'm'"):
        Object(shapes.sphere(vertices=200), load_material(path))
    scene = tmp_path / "scene.toml"
    scene.write_text('[[object]]\nshape = "sphere"\nmaterial = "m.toml"\n')
    with pytest.raises(InputError, match=r"scene.toml: \[\[object\]\] 1: sphere: the mesh has no texture"):
        load_scene(scene)


# --- means -----------------------------------------------------------------------------------------------------------


def test_means_of_thickness_colour_and_opacity() -> None:
    half = np.array([[0, 255]], np.uint8)
    maps = LayerMaps(half, np.full((1, 1, 3), (255, 188, 0), np.uint8), np.full((2, 2), 13107, np.uint16))
    top, below = mean_stack(layers(3.0, np.inf), (maps, LayerMaps()))
    assert top.thickness == 1.5
    assert top.sigma_a == pytest.approx([0.02] * 3)
    assert top.sigma_s_prime == pytest.approx([0.4, 0.4 * 0.5029, 1e-6], rel=1e-3)  # sRGB 188 is 0.5029 linear
    assert below.sigma_s_prime == pytest.approx([2.0] * 3)


def test_a_layer_that_is_absent_everywhere_is_left_out() -> None:
    nothing = LayerMaps(np.zeros((4, 4), np.uint8))
    stack = layers(3.0, np.inf)
    (left,) = mean_stack(stack, (nothing, LayerMaps()))
    assert left.thickness == np.inf and np.array_equal(left.sigma_a, stack[1].sigma_a)


def test_the_profile_of_thick_layers_is_that_of_their_means() -> None:
    maps = Maps(layers=(LayerMaps(np.array([[0, 65535]], np.uint16)), LayerMaps()))
    mapped = Material("m", layers=layers(4.0, np.inf), maps=maps).profile
    assert isinstance(mapped, Layers)
    assert np.array_equal(mapped.total, Layers(layers(2.0, np.inf)).total)


def test_layers_without_maps_have_the_profile_that_they_had() -> None:
    stack = layers(2.0, np.inf)
    assert Material("m", layers=stack).mean_layers == stack


# --- scenes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["skin-patch", "organ"])
def test_scenes_with_layers_are_closed_and_have_texture_coordinates(name: str) -> None:
    (thing,) = SCENES[name](300).objects
    assert is_closed(thing.mesh) and thing.mesh.corner_uvs is not None
    a, b, c = np.moveaxis(thing.mesh.corner_uvs.astype(np.float64), 1, 0)
    assert np.abs(np.stack([b - a, c - a])).max() < 0.3, "no face runs across the seam"


def test_the_front_of_the_patch_keeps_its_lengths() -> None:
    mesh = shapes.patch(vertices=2000)
    assert mesh.corner_uvs is not None and mesh.corner_normals is not None
    front = mesh.corner_uvs[:, :, 0].max(axis=1) < 0.5
    front &= (mesh.corner_uvs[:, :, 1].max(axis=1) < 0.5) & (mesh.corner_normals[:, :, 2].min(axis=1) > 0.5)
    uv, corners = mesh.corner_uvs[front], mesh.positions[mesh.faces[front]].astype(np.float64)
    lengths = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1) / np.linalg.norm(uv[:, 1] - uv[:, 0], axis=1)
    assert lengths.max() / lengths.min() < 1.002


def test_veins_of_the_patch_lie_at_two_depths() -> None:
    material = skin_material()
    assert material.layers is not None
    skin, cover, vein = (
        maps.thickness / 65535.0 * layer.thickness
        for maps, layer in zip(material.maps.layers[:3], material.layers, strict=False)
        if maps.thickness is not None
    )
    middle = (skin + cover + 0.5 * vein)[vein > 0.1]
    assert np.abs(middle[:, None] - [0.75, 2.3]).min(axis=1).max() < 0.001
    assert ((np.abs(middle - 0.75) < 0.01).mean(), (np.abs(middle - 2.3) < 0.01).mean()) > (0.2, 0.2)


@pytest.mark.parametrize("material", [skin_material(), organ_material()], ids=lambda m: m.name)
def test_mean_free_paths_of_the_scenes_are_some_mm_and_their_maps_reach_white(material: Material) -> None:
    assert material.layers is not None and len(material.layers) == 4
    for layer in (material.layers[0], material.layers[-1]):
        assert 1.0 < layer.mean_free_path.min() and layer.mean_free_path.max() < 10.0
    for maps in material.maps.layers[:3]:
        assert maps.thickness is not None and maps.thickness.dtype == np.uint16 and maps.thickness.max() > 65000


def test_replacing_the_layers_of_a_material_needs_its_maps_to_fit() -> None:
    with pytest.raises(InputError, match="maps of 4 layers need as many layers, not 0"):
        replace(skin_material(), layers=None, sigma_a=(0.1,) * 3, sigma_s_prime=(1.0,) * 3)
