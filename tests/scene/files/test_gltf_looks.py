"""Materials and textures of glTF files, and notes on properties that are not used."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import TETRAHEDRON, File, png

from wgsss.errors import InputError
from wgsss.scene.files.contents import Contents, Look, Texture
from wgsss.scene.files.gltf import read_gltf


def read(file: File, path: Path) -> Contents:
    return read_gltf(file.save(path / "box.glb"))


def look(path: Path, **material: Any) -> Look:
    return read(File().with_tetrahedron(**material), path).parts[0].look


def refused(file: File, path: Path) -> str:
    with pytest.raises(InputError) as raised:
        read(file, path)
    return str(raised.value).removeprefix(f"{path / 'box.glb'}: ")


def textured(count: int = 1, **texture: Any) -> File:
    """Make a file with a number of textures, each with its own image."""
    file = File()
    for number in range(count):
        image = file.add("images", bufferView=file.view(png(((number, 0, 0),))), mimeType="image/png")
        file.add("textures", source=image, **texture)
    return file


# --- values ----------------------------------------------------------------------------------------------------------


def test_an_empty_material_defines_nothing(tmp_path: Path) -> None:
    assert look(tmp_path) == Look()
    assert look(tmp_path, pbrMetallicRoughness={"metallicFactor": 0}) == Look()
    file = File()
    file.node(mesh=file.mesh())
    assert read(file, tmp_path).parts[0].look == Look()


def test_a_material_defines_its_look(tmp_path: Path) -> None:
    result = look(
        tmp_path,
        name="skin\n1",
        pbrMetallicRoughness={"baseColorFactor": [0.5, 0.25, 1, 0.75], "roughnessFactor": 0},
        extensions={"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_specular": {"specularFactor": 0.5}},
    )
    expected = Look("skin 1", (0.5, 0.25, 1.0), roughness=0.0, eta=1.4, specular=0.5)
    assert result == expected


def test_defaults_of_extensions(tmp_path: Path) -> None:
    result = look(tmp_path, extensions={"KHR_materials_ior": {}, "KHR_materials_specular": {}})
    assert (result.eta, result.specular) == (1.5, 1.0)


@pytest.mark.parametrize(
    ("material", "alpha", "cutoff"),
    [
        ({}, 1, None),
        ({"alphaMode": "OPAQUE", "alphaCutoff": 0.3}, 1, None),
        ({"alphaMode": "MASK"}, 0.8, 0.5),
        ({"alphaMode": "MASK", "alphaCutoff": 0}, 0.8, 0),
        ({"alphaMode": "BLEND"}, 1, None),
    ],
)
def test_alpha_is_used_in_mode_mask(
    tmp_path: Path, material: dict[str, Any], alpha: float, cutoff: float | None
) -> None:
    result = look(tmp_path, pbrMetallicRoughness={"baseColorFactor": [1, 1, 1, 0.8]}, **material)
    assert (result.alpha, result.cutoff) == (alpha, cutoff)


def test_each_loss_is_one_note_that_counts_materials(tmp_path: Path) -> None:
    file, lossy = File(), textured()
    shiny = {"metallicFactor": 1, "metallicRoughnessTexture": {"index": 0}, "baseColorFactor": [2, 0, 0, 1]}
    for _ in range(2):
        lossy.with_tetrahedron(
            pbrMetallicRoughness=shiny,
            emissiveFactor=[0, 0.1, 0],
            occlusionTexture={"index": 0},
            alphaMode="BLEND",
            doubleSided=True,
            extras={"any": "thing"},
            extensions={
                "KHR_materials_clearcoat": {"clearcoatFactor": 1},
                "KHR_materials_ior": {"ior": 0},
                "KHR_materials_specular": {"specularColorFactor": [1, 0, 0]},
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1},
                "VENDOR_thing": {},
            },
        )
    assert sorted(read(lossy, tmp_path).notes) == [
        "KHR_materials_clearcoat left out: used by 2 materials",
        "KHR_materials_transmission left out: used by 2 materials",
        "KHR_materials_volume left out because nothing scatters in it: used by 2 materials",
        "VENDOR_thing left out: used by 2 materials",
        "an index of refraction of 0 left out: used by 2 materials",
        "colours clipped to 0 to 1: used by 2 materials",
        "drawn opaque although alphaMode is BLEND: 2 materials",
        "emission left out: used by 2 materials",
        "metal left out: used by 2 materials",
        "metallic-roughness textures left out: used by 2 materials",
        "occlusion textures left out: used by 2 materials",
        "the colour of KHR_materials_specular left out: used by 2 materials",
    ]
    file.with_tetrahedron(emissiveTexture={"index": 0}, extensions={"KHR_materials_variants": {}})
    assert read(file, tmp_path).notes == (), "emission is black without its factor"


def test_unused_materials_are_not_noted(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.add("materials", alphaMode="BLEND", normalTexture={"index": 9})
    assert read(file, tmp_path).notes == ()


def test_specular_glossiness_gives_the_diffuse_colour(tmp_path: Path) -> None:
    file = textured()
    glossy = {"diffuseFactor": [0.5, 0.5, 0.25, 1], "diffuseTexture": {"index": 0}, "glossinessFactor": 0.5}
    contents = read(file.with_tetrahedron(extensions={"KHR_materials_pbrSpecularGlossiness": glossy}), tmp_path)
    result = contents.parts[0].look
    assert result.base_color == (0.5, 0.5, 0.25) and result.base_color_map is not None
    assert contents.notes == (
        "all but the diffuse colour of KHR_materials_pbrSpecularGlossiness left out: used by 1 material",
    )


# --- textures --------------------------------------------------------------------------------------------------------


def test_images_of_textures_are_not_decoded(tmp_path: Path) -> None:
    file = textured(3)
    file.tree["images"][1]["name"] = "bumps"
    contents = read(
        file.with_tetrahedron(
            pbrMetallicRoughness={"baseColorTexture": {"index": 0}},
            normalTexture={"index": 1, "scale": -0.5},
            extensions={"KHR_materials_specular": {"specularTexture": {"index": 2}}},
        ),
        tmp_path,
    )
    result = contents.parts[0].look
    assert result.base_color_map == Texture(png(((0, 0, 0),)), "image 0")
    assert result.normal_map == Texture(png(((1, 0, 0),)), "image 1 (bumps)") and result.normal_scale == -0.5
    assert result.specular_map == Texture(png(((2, 0, 0),)), "image 2", channels="A")
    assert contents.notes == ()


@pytest.mark.parametrize(
    ("sampler", "wrap", "nearest"),
    [
        ({}, ("repeat", "repeat"), False),
        ({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}, ("clamp", "mirror"), True),
        ({"wrapS": 10497, "magFilter": 9729, "minFilter": 9984}, ("repeat", "repeat"), False),
    ],
)
def test_samplers(tmp_path: Path, sampler: dict[str, int], wrap: tuple[str, str], nearest: bool) -> None:
    file = textured(sampler=0)
    file.add("samplers", **sampler)
    texture = read(file.with_tetrahedron(normalTexture={"index": 0}), tmp_path).parts[0].look.normal_map
    assert texture is not None and (texture.wrap, texture.nearest) == (wrap, nearest)


def test_a_texture_transform_scales_rotates_and_shifts(tmp_path: Path) -> None:
    """As the specification defines, coordinates rotate counter-clockwise if v points down."""
    transform = {"scale": [2, 3], "rotation": math.pi / 2, "offset": [10, 20], "texCoord": 0}
    info = {"index": 0, "texCoord": 7, "extensions": {"KHR_texture_transform": transform}}
    texture = read(textured().with_tetrahedron(normalTexture=info), tmp_path).parts[0].look.normal_map
    assert texture is not None and texture.transform is not None and texture.coordinates == 0
    matrix = np.array(texture.transform)
    assert matrix @ (0, 0, 1) == pytest.approx((10, 20))
    assert matrix @ (1, 0, 1) == pytest.approx((10, 18)), "u, to the right, becomes up"
    assert matrix @ (0, 1, 1) == pytest.approx((13, 20)), "v, down, becomes right"


def test_a_texture_without_its_coordinates_is_left_out(tmp_path: Path) -> None:
    file = textured()
    uvs = file.rows(TETRAHEDRON[:, :2], "VEC2")
    number = file.add("materials", pbrMetallicRoughness={"baseColorTexture": {"index": 0, "texCoord": 1}})
    for sets in ({"TEXCOORD_0": uvs}, {"TEXCOORD_1": uvs}):
        file.node(mesh=file.mesh(file.primitive(attributes=sets, material=number)))
    contents = read(file, tmp_path)
    without, textured_one = contents.parts
    assert without.look.base_color_map is None
    assert textured_one.look.base_color_map is not None and textured_one.look.base_color_map.coordinates == 1
    assert contents.notes == ("image 0 left out because there is no TEXCOORD_1: 1 primitive",)


def test_images_in_formats_of_extensions(tmp_path: Path) -> None:
    file = textured(2)
    for number, texture in enumerate(
        (
            {"extensions": {"EXT_texture_webp": {"source": 1}}},
            {"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}},
            {"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}},
            {"extensions": {"KHR_texture_basisu": {"source": 1}}},
            {},
        ),
        start=2,
    ):
        file.add("textures", **texture)
        file.with_tetrahedron(normalTexture={"index": number})
    contents = read(file, tmp_path)
    maps = [part.look.normal_map for part in contents.parts]
    assert [texture and texture.name for texture in maps] == ["image 1", "image 0", "image 0", None, None]
    assert contents.notes == (
        "texture 5 left out: it has no image that can be read (it uses KHR_texture_basisu)",
        "texture 6 left out: it has no image that can be read",
    )


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ({"normalTexture": {"index": 4}}, "material 0: normalTexture: there is no texture 4"),
        ({"normalTexture": {}}, "material 0: normalTexture: there is no texture null"),
        ({"normalTexture": 4}, "material 0: normalTexture must be an object, not 4"),
        ({"normalTexture": {"index": 0, "texCoord": -1}}, "material 0: normalTexture: texCoord must be a whole number"),
        (
            {"normalTexture": {"index": 0, "scale": "a"}},
            "material 0: normalTexture: scale must be a finite number, not",
        ),
        (
            {"normalTexture": {"index": 0, "scale": math.nan}},
            "material 0: normalTexture: scale must be a finite number",
        ),
        ({"normalTexture": {"index": 1}}, "texture 1: there is no image 9"),
        ({"normalTexture": {"index": 2}}, "texture 2: there is no sampler 9"),
        ({"normalTexture": {"index": 3}}, "sampler 0: there is no wrapS 5"),
        ({"alphaMode": "GLASS"}, "material 0: alphaMode must be one of OPAQUE, MASK, BLEND, not GLASS"),
        ({"alphaMode": "MASK", "alphaCutoff": -1}, "material 0: alphaCutoff must be at least 0, not -1"),
        ({"pbrMetallicRoughness": []}, "material 0: pbrMetallicRoughness must be an object, not a list"),
        (
            {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1]}},
            "material 0: pbrMetallicRoughness: baseColorFactor must be 4 finite numbers",
        ),
        (
            {"pbrMetallicRoughness": {"roughnessFactor": 2}},
            "material 0: pbrMetallicRoughness: roughnessFactor must be from 0 to 1, not 2",
        ),
        ({"emissiveFactor": "red"}, "material 0: emissiveFactor must be 3 finite numbers"),
        ({"extensions": {"KHR_materials_ior": 1.3}}, "material 0: extensions: KHR_materials_ior must be an object"),
        (
            {"extensions": {"KHR_materials_ior": {"ior": 10**400}}},
            "material 0: KHR_materials_ior: ior must be at least 0",
        ),
    ],
)
def test_a_bad_material_is_named(tmp_path: Path, material: dict[str, Any], message: str) -> None:
    file = textured()
    file.add("textures", source=9)
    file.add("textures", source=0, sampler=9)
    file.add("textures", source=0, sampler=0)
    file.add("samplers", wrapS=5)
    assert refused(file.with_tetrahedron(**material), tmp_path).startswith(message)


# --- extensions ------------------------------------------------------------------------------------------------------


def test_an_unknown_required_extension_is_refused_by_name(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.tree["extensionsRequired"] = ["KHR_texture_transform", "VENDOR_unknown", "KHR_materials_clearcoat"]
    message = "it requires VENDOR_unknown, KHR_materials_clearcoat, which cannot be read"
    assert refused(file, tmp_path) == message
    for value, message in (
        ([5], "extensionsRequired must be names, not 5"),
        ("KHR_texture_transform", "extensionsRequired must be a list, not 'KHR_texture_transform'"),
    ):
        file.tree["extensionsRequired"] = value
        assert refused(file, tmp_path) == message


def test_optional_extensions_in_use_are_noted(tmp_path: Path) -> None:
    file = File().with_tetrahedron()
    file.tree["extensionsUsed"] = ["VENDOR_a", "VENDOR_b", "VENDOR_c", "KHR_xmp_json_ld"]
    file.tree["extensions"] = {"VENDOR_a": {"extensions": {"VENDOR_b": {}}}, "KHR_xmp_json_ld": {}}
    file.tree["nodes"][0]["extensions"] = {"VENDOR_b": 1}
    file.tree["extras"] = {"extensions": {"VENDOR_c": {}}}
    assert read(file, tmp_path).notes == (
        "VENDOR_a left out: used in 1 place",
        "VENDOR_b left out: used in 2 places",
    )
