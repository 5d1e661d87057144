"""The medium of a glTF material: coefficients from extensions, and extensions from coefficients."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltfs import File, png

from wgsss.scene import MATERIALS
from wgsss.scene.files.contents import Contents, Medium
from wgsss.scene.files.gltf import read_gltf
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.media import read_medium, written
from wgsss.scene.files.gltf.notes import Notes

VOLUME, SCATTER, OLD = "KHR_materials_volume", "KHR_materials_scatter", "KHR_materials_volume_scatter"
DIFFUSE = "KHR_materials_diffuse_transmission"
WAX = {"attenuationDistance": 0.01, "attenuationColor": [0.9, 0.5, 0.3], "thicknessFactor": 0.1}
COLOR = [0.9, 0.6, 0.4]


def medium(extensions: dict[str, Any], notes: Notes | None = None) -> Medium | None:
    return read_medium(Item({"extensions": extensions}, "material 0"), notes or Notes())


def read(path: Path, file: File | None = None, **extensions: Any) -> Contents:
    file = (file or File()).with_tetrahedron(
        pbrMetallicRoughness={"baseColorFactor": [0.2, 0.4, 0.8, 1]},
        extensions={VOLUME: WAX, OLD: {"multiscatterColor": COLOR}, **extensions},
    )
    return read_gltf(file.save(path / "wax.glb"))


def test_coefficients_follow_kulla_and_conty() -> None:
    result = medium({VOLUME: WAX, OLD: {"multiscatterColor": COLOR}})
    assert result is not None
    for channel in range(3):
        r, sigma_t = COLOR[channel], -math.log(WAX["attenuationColor"][channel]) / 0.01  # type: ignore[index]
        albedo = 1 - (4.09712 + 4.20863 * r - math.sqrt(9.59217 + 41.6808 * r + 17.7126 * r * r)) ** 2
        assert result.sigma_s_prime[channel] == pytest.approx(sigma_t * albedo)
        assert result.sigma_a[channel] == pytest.approx(sigma_t * (1 - albedo))


def test_all_spellings_of_the_drafts_are_equivalent() -> None:
    expected = medium({VOLUME: WAX, OLD: {"multiscatterColor": COLOR}})
    for extension in (
        {OLD: {"multiscatterColorFactor": COLOR}},
        {SCATTER: {"multiscatterColorFactor": COLOR, "scatterStrengthFactor": 1}},
        {SCATTER: {"multiscatterColor": COLOR, "scatterFactor": 1}},
        {SCATTER: {"multiscatterColorFactor": COLOR, "scatterStrengthFactor": 1}, OLD: {}},
    ):
        assert medium({VOLUME: WAX, **extension}) == expected
    half = medium({VOLUME: WAX, SCATTER: {"multiscatterColorFactor": COLOR, "scatterStrengthFactor": 0.5}})
    assert half == medium({VOLUME: WAX, OLD: {"multiscatterColor": [value / 2 for value in COLOR]}})
    white = medium({VOLUME: WAX, SCATTER: {"scatterStrengthFactor": 1}})
    assert white is not None and white.sigma_a == (0, 0, 0)


def test_anisotropy_reduces_scattering_and_keeps_the_colour() -> None:
    """The reduced albedo sigma_s' / (sigma_s' + sigma_a) determines the colour after many scattering events."""
    plain = medium({VOLUME: WAX, OLD: {"multiscatterColor": COLOR}})
    forward = medium({VOLUME: WAX, OLD: {"multiscatterColor": COLOR, "scatterAnisotropy": 0.8}})
    assert plain is not None and forward is not None
    for result in (plain, forward):
        share = np.array(result.sigma_s_prime) / (np.array(result.sigma_s_prime) + result.sigma_a)
        s = (
            4.09712
            + 4.20863 * np.array(COLOR)
            - np.sqrt(9.59217 + 41.6808 * np.array(COLOR) + 17.7126 * np.square(COLOR))
        )
        assert share == pytest.approx(1 - s**2)
    assert all(a < b for a, b in zip(forward.sigma_s_prime, plain.sigma_s_prime, strict=True))


@pytest.mark.parametrize(
    ("extensions", "note"),
    [
        ({VOLUME: WAX}, f"{VOLUME} left out because nothing scatters in it: used by 1 material"),
        ({OLD: {}}, f"{OLD} left out because it needs {VOLUME}: used by 1 material"),
        ({VOLUME: WAX, OLD: {}}, f"{OLD} left out because nothing scatters in it: used by 1 material"),
        ({VOLUME: WAX, SCATTER: {}}, f"{SCATTER} left out because nothing scatters in it: used by 1 material"),
        (
            {VOLUME: {**WAX, "thicknessFactor": 0}, SCATTER: {"scatterStrengthFactor": 1}},
            f"{SCATTER} left out because its walls are thin (thicknessFactor 0): used by 1 material",
        ),
        *(
            ({VOLUME: {**WAX, **change}, OLD: {"multiscatterColor": COLOR}}, f"{OLD} left out because nothing scatters")
            for change in ({"attenuationDistance": 0}, {"attenuationDistance": None}, {"attenuationColor": [1, 1, 1]})
        ),
    ],
)
def test_a_medium_without_scattering_is_none_with_a_note(extensions: dict[str, Any], note: str) -> None:
    notes = Notes()
    assert medium(extensions, notes) is None
    assert len(notes.lines()) == 1 and notes.lines()[0].startswith(note)


@pytest.mark.parametrize("distance", [1e-320, 1e-9, 1.0, 1e300])
@pytest.mark.parametrize("color", [[0, 0, 0], [0, 0.5, 1], [1e-300, 1 - 1e-16, 0.5]])
@pytest.mark.parametrize("scatter", [[0, 0, 1], [1e-300, 1, 0.5], [2, -1, 1]])
@pytest.mark.parametrize("g", [-1, 0, 1, 7])
def test_coefficients_are_always_finite(distance: float, color: Any, scatter: Any, g: float) -> None:
    volume = {"attenuationDistance": distance, "attenuationColor": color}
    result = medium({VOLUME: volume, OLD: {"multiscatterColor": scatter, "scatterAnisotropy": g}})
    assert result is not None
    assert all(0 <= value <= 1e9 for value in result.sigma_a) and all(
        1e-3 <= value <= 1e9 for value in result.sigma_s_prime
    )


def test_textures_of_a_medium_are_noted() -> None:
    notes = Notes()
    scatter = {"multiscatterColor": COLOR, "multiscatterColorTexture": {"index": 0}}
    assert medium({VOLUME: WAX, OLD: scatter}, notes) is not None
    assert notes.lines() == (f"multiscatterColorTexture of {OLD} left out: used by 1 material",)


@pytest.mark.parametrize("name", [name for name, material in MATERIALS.items() if material.sigma_a is not None])
def test_written_coefficients_are_read_again(name: str) -> None:
    material = MATERIALS[name]
    sigma_a, sigma_s = np.array(material.sigma_a) * 1000, np.array(material.sigma_s_prime) * 1000
    volume, scatter = written(sigma_a, sigma_s)
    result = medium({VOLUME: volume, OLD: scatter})
    assert result is not None
    assert result.sigma_a == pytest.approx(sigma_a, rel=1e-9)
    assert result.sigma_s_prime == pytest.approx(sigma_s, rel=1e-9)


# --- the boundary ----------------------------------------------------------------------------------------------------


def test_a_material_with_a_medium_has_the_default_eta_of_gltf(tmp_path: Path) -> None:
    assert read(tmp_path).parts[0].look.eta == 1.5
    assert read(tmp_path, KHR_materials_ior={"ior": 1.4}).parts[0].look.eta == 1.4


@pytest.mark.parametrize(
    ("diffuse", "color"),
    [
        (None, (0.2, 0.4, 0.8)),
        ({}, (0.2, 0.4, 0.8)),
        ({"diffuseTransmissionFactor": 1}, (1, 1, 1)),
        ({"diffuseTransmissionFactor": 1, "diffuseTransmissionColorFactor": [1, 0.5, 0]}, (1, 0.5, 0)),
        ({"diffuseTransmissionFactor": 0.25}, (0.4, 0.55, 0.85)),
    ],
)
def test_diffuse_transmission_colours_the_surface(
    tmp_path: Path, diffuse: dict[str, Any] | None, color: tuple[float, ...]
) -> None:
    contents = read(tmp_path, **({} if diffuse is None else {DIFFUSE: diffuse}))
    assert contents.parts[0].look.base_color == pytest.approx(color) and contents.notes == ()


@pytest.mark.parametrize(("share", "name"), [(1.0, "image 0"), (0.7, "image 0"), (0.3, None)])
def test_the_map_with_the_larger_share_is_used(tmp_path: Path, share: float, name: str | None) -> None:
    file = File()
    file.add("textures", source=file.add("images", bufferView=file.view(png())))
    diffuse = {"diffuseTransmissionFactor": share, "diffuseTransmissionColorTexture": {"index": 0}}
    contents = read(tmp_path, file, **{DIFFUSE: diffuse})
    texture = contents.parts[0].look.base_color_map
    assert (texture and texture.name) == name
    rounded = f"diffuseTransmissionFactor of {DIFFUSE} rounded to {round(share)}: used by 1 material"
    assert contents.notes == (() if share == 1 else (rounded,))


def test_diffuse_transmission_without_a_medium_is_noted(tmp_path: Path) -> None:
    file = File().with_tetrahedron(extensions={DIFFUSE: {"diffuseTransmissionFactor": 1}})
    assert read_gltf(file.save(tmp_path / "leaf.glb")).notes == (f"{DIFFUSE} left out: used by 1 material",)
