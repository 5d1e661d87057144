"""Export of scenes as glTF: written files are read again."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from wgsss.cli import main
from wgsss.errors import InputError
from wgsss.output_gltf import export
from wgsss.scene import (
    MATERIALS,
    DirectionalLight,
    Maps,
    Material,
    Mesh,
    Object,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    Scene,
    SphereLight,
)
from wgsss.scene.files.contents import Contents, Texture
from wgsss.scene.files.gltf import read_gltf

POSITIONS = np.array([(0, 0, 0), (30, 0, 0), (0, 20, 0), (0, 0, 10)], np.float32)
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
UVS = np.linspace(0, 1, 24, dtype=np.float32).reshape(4, 3, 2)
CAMERA = PerspectiveCamera((10, 20, 300), (0, 5, 0), (0, 1, 0.5), fov=25)


def scene(**fields: Any) -> Scene:
    """Return a scene with a rotated and moved tetrahedron of marble."""
    mesh = fields.pop("mesh", Mesh(POSITIONS, FACES, name="block"))
    thing = Object(mesh, fields.pop("material", MATERIALS["marble"]), (5, 6, 7), (30, 40, 50))
    return Scene("test", **{"objects": (thing,), "lights": (), "camera": CAMERA, **fields})


def round_trip(given: Scene, path: Path) -> Contents:
    return read_gltf(export(given, path / "scene.glb"))


def placed(contents: Contents) -> Any:
    """Return the corners (F, 3, 3) of the only part, mm."""
    (part,) = contents.parts
    assert contents.mm_per_unit == 1000
    return 1000 * (part.positions @ part.matrix[:3, :3].T + part.matrix[:3, 3])[part.faces]


def pixels(texture: Texture | None) -> Any:
    assert texture is not None and isinstance(texture.source, bytes)
    return np.array(Image.open(io.BytesIO(texture.source)))


def test_a_mesh_keeps_its_position(tmp_path: Path) -> None:
    given = scene()
    contents = round_trip(given, tmp_path)
    assert placed(contents) == pytest.approx(given.objects[0].placed[FACES], rel=1e-6)
    (part,) = contents.parts
    assert len(part.positions) == 4 and part.uvs == {} and part.normals is not None
    assert part.normals[part.faces] == pytest.approx(given.objects[0].mesh.normals[FACES])
    assert contents.notes == ()


def test_seams_hard_edges_and_vertex_colours_are_preserved(tmp_path: Path) -> None:
    normals = Mesh(POSITIONS, FACES).face_normals
    normals = np.repeat(normals[:, None] / np.linalg.norm(normals, axis=1)[:, None, None], 3, axis=1)
    mesh = Mesh(POSITIONS, FACES, normals, UVS, corner_colors=1 - UVS[..., [0, 0, 1]])
    contents = round_trip(scene(mesh=mesh), tmp_path)
    (part,) = contents.parts
    assert placed(contents) == pytest.approx(scene(mesh=mesh).objects[0].placed[FACES], rel=1e-6)
    assert part.uvs[0][part.faces] == pytest.approx(UVS)
    assert part.normals is not None and part.normals[part.faces] == pytest.approx(normals, abs=1e-6)
    assert part.colors is not None and part.colors[part.faces] == pytest.approx(1 - UVS[..., [0, 0, 1]])


@pytest.mark.parametrize("name", [name for name, material in MATERIALS.items() if material.sigma_a is not None])
def test_a_medium_is_preserved(tmp_path: Path, name: str) -> None:
    material = replace(MATERIALS[name], base_color=(0.9, 0.8, 0.7), roughness=0.25, specular=0.75)
    look = round_trip(scene(material=material), tmp_path).parts[0].look
    assert look.medium is not None
    assert np.array(look.medium.sigma_a) / 1000 == pytest.approx(material.sigma_a, rel=1e-4)
    assert np.array(look.medium.sigma_s_prime) / 1000 == pytest.approx(material.sigma_s_prime, rel=1e-4)
    assert (look.name, look.eta, look.roughness, look.specular) == (name, material.eta, 0.25, 0.75)
    assert look.base_color == pytest.approx((0.9, 0.8, 0.7))


def test_textures_are_preserved(tmp_path: Path) -> None:
    color = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    maps = Maps(color, 255 - color, color[..., 0] * 10, ("clamp", "mirror"), nearest=True, normal_scale=0.5)
    given = scene(mesh=Mesh(POSITIONS, FACES, corner_uvs=UVS), material=replace(MATERIALS["skin1"], maps=maps))
    contents = round_trip(given, tmp_path)
    look = contents.parts[0].look
    assert np.array_equal(pixels(look.base_color_map), color)
    assert np.array_equal(pixels(look.normal_map), 255 - color) and look.normal_scale == 0.5
    assert look.base_color_map is not None
    assert (look.base_color_map.wrap, look.base_color_map.nearest) == (("clamp", "mirror"), True)
    assert look.specular_map is not None and look.specular_map.channels == "A"
    assert np.array_equal(pixels(look.specular_map)[..., 3], color[..., 0] * 10)
    assert contents.notes == ()


def test_lights_are_preserved_and_unsupported_ones_are_named(tmp_path: Path) -> None:
    lights = (
        DirectionalLight((0, -3, 0), (1, 2, 0)),
        DirectionalLight((1, 2, 3), (0, 0, 0)),
        PointLight((10, 20, 30), (4, 5, 6)),
        SphereLight((0, 0, 0), 1, (1, 1, 1)),
    )
    with pytest.warns(UserWarning, match=r"^test: the glTF file differs from the scene: SphereLight is left out$"):
        found = round_trip(scene(lights=lights), tmp_path).lights
    assert [light.kind for light in found] == ["directional", "directional", "point"]
    assert found[0].direction == pytest.approx((0, -1, 0)) and found[0].power == pytest.approx((1, 2, 0))
    assert found[1].direction == pytest.approx(np.array((1, 2, 3)) / np.sqrt(14)) and found[1].power == (0, 0, 0)
    assert found[2].position == pytest.approx((0.01, 0.02, 0.03)) and found[2].power == pytest.approx((4, 5, 6))


@pytest.mark.parametrize("camera", [CAMERA, OrthographicCamera((0, 0, 300), (0, 0, 0), height=80)])
def test_the_camera_is_preserved(tmp_path: Path, camera: Any) -> None:
    (found,) = round_trip(scene(camera=camera), tmp_path).cameras
    assert np.array(found.eye) * 1000 == pytest.approx(camera.eye, abs=1e-9)
    gaze = np.subtract(camera.target, camera.eye)
    assert found.forward == pytest.approx(gaze / np.linalg.norm(gaze))
    assert found.up == pytest.approx(camera.view()[1, :3])
    if isinstance(camera, OrthographicCamera):
        assert found.fov is None and found.height == pytest.approx(0.08)
    else:
        assert found.height is None and found.fov == pytest.approx(25)


def test_a_material_without_coefficients_is_written_without_a_medium(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="'skin' has no coefficients, so that it has no medium"):
        look = round_trip(scene(material=MATERIALS["skin"]), tmp_path).parts[0].look
    assert look.medium is None and look.base_color == pytest.approx((0.63, 0.44, 0.34)) and look.eta == 1.4


def test_a_mesh_without_size_is_left_out(tmp_path: Path) -> None:
    gone = Object(Mesh(POSITIONS * 0, FACES, name="gone", shrunk=True), MATERIALS["marble"])
    with pytest.warns(UserWarning, match="gone is left out, because it has no size at this time"):
        assert len(round_trip(scene(objects=(gone, *scene().objects)), tmp_path).parts) == 1


def test_a_warning_names_what_gltf_cannot_represent(tmp_path: Path) -> None:
    material = Material("odd", sigma_a=(1, 1, 1), sigma_s_prime=(1, 1, 1), color_after=0.5)
    with pytest.warns(UserWarning, match="color_after and transport are left out; exposure and bloom are left out"):
        round_trip(scene(material=material, exposure=1), tmp_path)


def test_a_path_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    for path, message in ((tmp_path / "a.gltf", "extension must be .glb"), (tmp_path / "none" / "a.glb", "no folder")):
        with pytest.raises(InputError, match=message):
            export(scene(), path)
    assert list(tmp_path.iterdir()) == []


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_either_or_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, folder = tmp_path / "ball.glb", tmp_path / "ball"
    assert main(["export", "sphere", "--vertices", "100", "--gltf", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}: sphere, glTF\n"
    assert main(["export", "sphere", "--gltf", str(path), "--mitsuba", str(folder), "--size", "30x20", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["files"] == [str(folder / "scene.xml"), str(folder / "1.ply"), str(path)]
    assert len(read_gltf(path).parts) == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["export", "sphere"], "give --mitsuba DIR, --gltf FILE.glb, or both"),
        (["export", "sphere", "--gltf", "ball.obj", "--mitsuba", "ball"], "ball.obj: the file extension must be .glb"),
        (
            ["export", "sphere", "--gltf", "ball.glb", "--size", "0x0"],
            "the image size must be 1 to 8192 pixels a side, not 0x0",
        ),
        (["export", "ear", "--gltf", "ear.glb", "--mitsuba", "ear"], "needs coefficients or layers, not gaussians"),
    ],
)
def test_the_command_writes_all_or_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
