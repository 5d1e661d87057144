"""Scenes by name, from scene files and from meshes, and errors that name the file, the table and the key."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from wgsss.errors import InputError
from wgsss.optics import SKIN_GAUSSIANS, SumOfGaussians
from wgsss.scene import (
    MATERIALS,
    DirectionalLight,
    EnvironmentLight,
    OrthographicCamera,
    PerspectiveCamera,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
    load_material,
    load_scene,
)
from wgsss.scene.builtin import SCENES

SCENE = """
name = "bust"
exposure = 0.5
tone_map = "reinhard"

[camera]
kind = "orthographic"
eye = [0, 0, 100]
target = [0, 1, 0]
height = 20
turn = 30

[[light]]
kind = "directional"
direction = [0, -1, 0]
irradiance = [1, 2, 3]

[[light]]
kind = "point"
position = [0, 50, 0]
intensity = [0.5, 0.5, 0.5]

[[light]]
kind = "rect"
position = [0, 50, 0]
direction = [0, -1, 0]
up = [0, 0, 1]
width = 10
height = 20
radiance = [4, 4, 4]
samples = 8

[[light]]
kind = "sphere"
position = [0, 50, 0]
radius = 5
radiance = [4, 4, 4]

[[light]]
kind = "environment"
file = "sky/dim.hdr"
rotation = 90

[[object]]
mesh = "box.ply"
size_mm = 40
material = "Whole Milk"
translate = [10, 0, 0]
rotate = [0, 0, 90]

[[object]]
shape = "sphere"
radius = 5
vertices = 500

[object.material]
preset = "marble"
sigma_a = [0.1, 0.2, 0.3]
roughness = 0.2
base_color_map = "color.png"
specular_map = "shine.png"

[[object]]
shape = "capsule"
motion = { kind = "bend_and_swell", bend = 30 }
[object.material]
gaussians = { variances = [0.1, 1], weights = [[0.5, 0.4, 0.3], [0.5, 0.4, 0.3]] }
"""

MINIMAL = '[[object]]\nmesh = "box.ply"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the files that SCENE names."""
    image = pytest.importorskip("PIL.Image")
    trimesh.creation.box((1, 2, 4)).export(tmp_path / "box.ply")
    (tmp_path / "sky").mkdir()
    (tmp_path / "sky" / "dim.hdr").write_bytes(b"#?RADIANCE\n\n-Y 1 +X 2\n" + bytes([128, 128, 128, 128] * 2))
    image.fromarray(np.full((2, 2, 3), 90, np.uint8)).save(tmp_path / "color.png")
    image.fromarray(np.full((2, 2), 70, np.uint8)).save(tmp_path / "shine.png")
    return tmp_path


def write(folder: Path, text: str, name: str = "scene.toml") -> Path:
    (folder / name).write_text(text)
    return folder / name


def refused(path: Any, **options: Any) -> str:
    with pytest.raises(InputError) as raised:
        load_scene(path, **options)
    assert "\n" not in str(raised.value)
    return str(raised.value).removeprefix(f"{path}: ")


# --- scene files -----------------------------------------------------------------------------------------------------


def test_a_scene_file_corresponds_to_the_dataclasses(folder: Path) -> None:
    scene = load_scene(write(folder, SCENE))
    assert (scene.name, scene.exposure, scene.tone_map) == ("bust", 0.5, "reinhard")
    assert scene.camera == OrthographicCamera((0, 0, 100), (0, 1, 0), height=20, turn=30)
    assert scene.lights == (
        DirectionalLight((0, -1, 0), (1, 2, 3)),
        PointLight((0, 50, 0), (0.5, 0.5, 0.5)),
        RectLight((0, 50, 0), (0, -1, 0), (0, 0, 1), 10, 20, (4, 4, 4), samples=8),
        SphereLight((0, 50, 0), 5, (4, 4, 4)),
        EnvironmentLight(file=str(folder / "sky" / "dim.hdr"), rotation=90),
    )
    np.testing.assert_allclose(scene.lights[4].pixels(), 0.5)

    box, ball, body = scene.objects
    assert box.material is not None and box.material.name == "wholemilk"
    assert np.ptp(box.mesh.bounds, axis=0).tolist() == [10, 20, 40]
    np.testing.assert_allclose(box.matrix @ [1, 0, 0, 1], [10, 1, 0, 1], atol=1e-12)

    np.testing.assert_allclose(ball.mesh.bounds, [[-5] * 3, [5] * 3], atol=0.05)
    assert 400 < len(ball.mesh.positions) < 600
    marble = MATERIALS["marble"]
    assert (ball.material.name, ball.material.eta, ball.material.roughness) == ("marble", 1.5, 0.2)
    assert ball.material.sigma_a == (0.1, 0.2, 0.3) and ball.material.sigma_s_prime == marble.sigma_s_prime
    assert ball.material.maps.base_color is not None and ball.material.maps.base_color[0, 0].tolist() == [90, 90, 90]
    assert ball.material.maps.specular is not None and ball.material.maps.specular[0, 0] == 70

    assert isinstance(body.material.profile, SumOfGaussians)
    np.testing.assert_allclose(body.material.profile.total, [1, 0.8, 0.6])
    assert body.motion is not None and body.motion.bend == 30


def test_defaults_of_a_scene_file_are_those_of_a_mesh(folder: Path) -> None:
    scene, mesh = load_scene(write(folder, MINIMAL, "small.toml")), load_scene(folder / "box.ply")
    assert scene.name == "small" and mesh.name == "box"
    assert scene.lights == mesh.lights and scene.camera == mesh.camera
    assert scene.objects[0].material.name == mesh.objects[0].material.name == "marble"
    assert (scene.exposure, scene.tone_map) == (0, "aces")


def test_a_camera_may_be_given_by_its_orbit(folder: Path) -> None:
    camera = 'kind = "perspective"\ntarget = [1, 2, 3]\ndistance = 10\nazimuth = 90\nelevation = 0\nfov = 40'
    scene = load_scene(write(folder, f"[camera]\n{camera}\n{MINIMAL}"))
    assert isinstance(scene.camera, PerspectiveCamera) and scene.camera.fov == 40
    np.testing.assert_allclose(scene.camera.eye, [11, 2, 3], atol=1e-12)
    text = f"[camera]\n{camera.replace('azimuth', 'azimut')}\n{MINIMAL}"
    assert "[camera]: unknown key 'azimut'; did you mean 'azimuth'?" in refused(write(folder, text))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "bust"', 'name = "bust', "not a TOML file: Illegal character"),
        ('name = "bust"', "name = 3", "name must be text, not 3"),
        ("exposure", "exposur", "unknown key 'exposur'; did you mean 'exposure'?"),
        ('"reinhard"', '"reinhart"', "unknown tone_map 'reinhart'; did you mean 'reinhard'?"),
        ('"orthographic"', '"ortographic"', "[camera]: unknown kind 'ortographic'; did you mean 'orthographic'?"),
        ("turn = 30", "fov = 30", "[camera]: unknown key 'fov'"),
        ("target = [0, 1, 0]", "", "[camera]: key 'target' is missing"),
        ("eye = [0, 0, 100]", "eye = [0, 1, 0]", "[camera]: eye and target must not be the same point"),
        ("irradiance = [1, 2, 3]", "itensity = [1, 2, 3]", "[[light]] 1: unknown key 'itensity'"),
        ("intensity = [0.5", "itensity = [0.5", "[[light]] 2: unknown key 'itensity'; did you mean 'intensity'?"),
        ("intensity = [0.5, 0.5, 0.5]", "", "[[light]] 2: key 'intensity' is missing"),
        ('kind = "point"', "", "[[light]] 2: key 'kind' is missing (one of directional, point, rect, sphere, env"),
        ('kind = "point"', 'kind = "pint"', "[[light]] 2: unknown kind 'pint'; did you mean 'point'?"),
        ("samples = 8", "samples = 8.5", "[[light]] 3: samples must be a whole number from 1 to 256, not 8.5"),
        ("radius = 5\nradiance", "radius = -5\nradiance", "[[light]] 4: radius must be from 1e-06 to 1e+13 (mm)"),
        ("sky/dim.hdr", "sky/dark.hdr", "[[light]] 5: file: "),
        ('file = "sky/dim.hdr"', "file = 7", "[[light]] 5: file must be the path of a file, not 7"),
        ('"box.ply"', '"fox.ply"', "[[object]] 1: mesh: "),
        ('"box.ply"', '"color.png"', "[[object]] 1: "),
        ('mesh = "box.ply"', "", "[[object]] 1: give either mesh, a file, or shape, a name"),
        ("size_mm = 40", "size_mm = 0", "size_mm must be a number above 0, not 0"),
        ("size_mm = 40", "radius = 40", "[[object]] 1: unknown key 'radius'"),
        ("size_mm = 40", "siz_mm = 40", "[[object]] 1: unknown key 'siz_mm'; did you mean 'size_mm'?"),
        ('"Whole Milk"', '"Hole Milk"', "[[object]] 1: unknown material 'Hole Milk'; did you mean 'wholemilk'?"),
        ('"Whole Milk"', "5", "[[object]] 1: material must be a name, a file or a table, not 5"),
        ("translate = [10, 0, 0]", "translate = [10, 0]", "[[object]] 1: translate must be three numbers"),
        ('"sphere"\nradius', '"spere"\nradius', "[[object]] 2: unknown shape 'spere'; did you mean 'sphere'?"),
        ("translate = [10, 0, 0]", "translate = [1e16, 0, 0]", "numbers, each from -1e+15 to 1e+15 (mm)"),
        ("irradiance = [1, 2, 3]", "irradiance = [1e39, 2, 3]", "each from 0 to 1e+12 (W/m^2), not [1e+39"),
        ("irradiance = [1, 2, 3]", f"irradiance = [1{400 * '0'}, 2, 3]", "irradiance must be three numbers"),
        ("eye = [0, 0, 100]", "eye = [0, 1, 1e-300]", "[camera]: eye and target must not be the same point"),
        ("radius = 5\nvertices", "radius = 'wide'\nvertices", "[[object]] 2: radius must be a number, not 'wide'"),
        ("radius = 5\nvertices", "radius = 1e-7\nvertices", "[[object]] 2: sphere: a size of 1.99"),
        ("vertices = 500", "vertices = -1", "[[object]] 2: sphere: "),
        ("vertices = 500", 'vertices = "many"', "[[object]] 2: "),
        ('preset = "marble"', 'preset = "marbel"', "[[object]] 2: [object.material]: preset: unknown material"),
        ("roughness = 0.2", "roughnes = 0.2", "[object.material]: unknown key 'roughnes'; did you mean 'roughness'?"),
        ("roughness = 0.2", "roughness = 2", "[[object]] 2: [object.material]: roughness must be from 0.02 to 1"),
        ("roughness = 0.2", "maps = 3", "[[object]] 2: [object.material]: unknown key 'maps'"),
        ('"shine.png"', '"box.ply"', "[[object]] 2: [object.material]: specular_map: "),
        ('"shine.png"', '"no.png"', "[[object]] 2: [object.material]: specular_map: "),
        ("weights", "weight", "[[object]] 3: [object.material]: gaussians: unknown key 'weight'"),
        ("[0.1, 1]", "[1, 0.1]", "[[object]] 3: [object.material]: gaussians: variances must be positive and asc"),
        ('"bend_and_swell"', '"bend"', "[[object]] 3: [object.motion]: unknown kind 'bend'"),
        ("bend = 30", "bent = 30", "[[object]] 3: [object.motion]: unknown key 'bent'; did you mean 'bend'?"),
        ("{ kind =", '"swell" # { kind =', "[[object]] 3: [object.motion] must be a table, not 'swell'"),
        ("[[light]]\nkind = \"directional\"", "[light]\nkind = \"directional\"", "not a TOML file"),
    ],
)  # fmt: skip
def test_errors_name_file_table_and_key(folder: Path, old: str, new: str, message: str) -> None:
    assert old in SCENE
    assert message in refused(write(folder, SCENE.replace(old, new)))


def test_tables_of_the_wrong_form_are_errors(folder: Path) -> None:
    assert refused(write(folder, "name = 'x'")) == "there is no [[object]] to render"
    assert refused(write(folder, "[object]\nmesh = 'box.ply'")) == "object must be a list of tables: [[object]]"
    assert refused(write(folder, f"camera = 3\n{MINIMAL}")) == "[camera] must be a table, not 3"
    (folder / "scene.toml").write_bytes(b"name = '\xff'")
    assert refused(folder / "scene.toml") == "not a TOML file: it is not UTF-8 text"
    assert refused(write(folder, f"name = {'[' * 5000}")) == "not a TOML file: it is nested too deep"
    assert refused(write(folder, f"name = {'9' * 5000}")).startswith("not a TOML file: it holds a number")
    (folder / "scene.toml").write_bytes(b"")
    assert refused(folder / "scene.toml") == "the file is empty"


def test_errors_name_the_file_once(folder: Path) -> None:
    path = write(folder, MINIMAL.replace("box", "fox"))
    assert refused(path) == f"[[object]] 1: mesh: {folder / 'fox.ply'}: no such file"


# --- materials -------------------------------------------------------------------------------------------------------


def test_a_material_file_is_read_on_its_own(folder: Path) -> None:
    (folder / "materials").mkdir()
    wax = "sigma_a = [0.01, 0.02, 0.03]\nsigma_s_prime = [1, 1, 1]\neta = 1.4\nbase_color_map = '../color.png'\n"
    path = write(folder, wax, "materials/wax.toml")
    material = load_material(path)
    assert (material.name, material.eta, material.sigma_a) == ("wax", 1.4, (0.01, 0.02, 0.03))
    assert material.maps.base_color is not None
    scene = load_scene(write(folder, MINIMAL + 'material = "materials/wax.toml"'))
    assert scene.objects[0].material.name == "wax"
    assert load_scene(folder / "box.ply", material=str(path)).objects[0].material.name == "wax"

    path.write_text(wax + "sigma_t = [1, 1, 1]")
    with pytest.raises(InputError, match=r"wax\.toml: unknown key 'sigma_t'; did you mean 'sigma_a'"):
        load_material(path)
    assert refused(folder / "scene.toml").startswith(f"[[object]] 1: {path}: unknown key 'sigma_t'")
    with pytest.raises(InputError, match=r"no\.toml: no such file"):
        load_material(folder / "no.toml")
    with pytest.raises(InputError, match=r"wax\.json: the file extension of a material file must be \.toml"):
        load_material("wax.json")


@pytest.mark.parametrize(
    ("table", "gaussian"),
    [
        ('preset = "skin"', True),
        ('preset = "skin"\nsigma_a = [0.1, 0.1, 0.1]\nsigma_s_prime = [1, 1, 1]', False),
        ('preset = "marble"\ngaussians = { variances = [1], weights = [[1, 1, 1]] }', True),
    ],
)
def test_a_profile_in_the_file_replaces_that_of_the_preset(folder: Path, table: str, gaussian: bool) -> None:
    material = load_material(write(folder, table, "m.toml"))
    assert isinstance(material.profile, SumOfGaussians) == gaussian
    assert material.name in ("skin", "marble")


def test_a_base_colour_map_replaces_the_colour_of_a_preset_but_not_a_given_colour(folder: Path) -> None:
    skin = 'preset = "skin"\nbase_color_map = "color.png"\n'
    assert load_material(write(folder, skin, "m.toml")).base_color == (1, 1, 1)
    assert load_material(write(folder, skin + "base_color = [0.5, 1, 1]", "m.toml")).base_color == (0.5, 1, 1)
    assert load_material(write(folder, 'preset = "skin"', "m.toml")).base_color == MATERIALS["skin"].base_color


def test_textures_of_a_mesh_are_kept_with_any_material(folder: Path) -> None:
    from PIL import Image

    box = trimesh.creation.box()
    look = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.open(folder / "color.png"))
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=look)
    box.export(folder / "box.glb")
    worn = load_scene(folder / "box.glb", material="skin").objects[0].material
    assert worn.gaussians is SKIN_GAUSSIANS and worn.base_color == (1, 1, 1)
    assert worn.maps.base_color is not None and worn.maps.base_color[0, 0].tolist() == [90, 90, 90]
    assert MATERIALS["skin"].maps.base_color is None, "the preset itself is unchanged"
    scene = load_scene(write(folder, MINIMAL.replace("ply", "glb")), material="ketchup")
    assert scene.objects[0].material.name == "ketchup" and scene.objects[0].material.maps.base_color is not None


# --- names and meshes ------------------------------------------------------------------------------------------------


def test_a_built_in_scene() -> None:
    scene = load_scene("sphere", vertices=1000)
    assert isinstance(scene, Scene) and scene.name == "sphere"
    assert 800 < len(scene.objects[0].mesh.positions) < 1200
    milky = load_scene("sphere", vertices=1000, material="Skim Milk")
    assert milky.objects[0].material.name == "skimmilk" and milky.lights == scene.lights


def test_an_unknown_name_is_an_error() -> None:
    assert refused("spere").startswith("unknown scene 'spere'; did you mean 'sphere'? (known: ")
    assert all(name in refused("nothing like it") for name in SCENES)
    assert refused("sphere.toml") == "no such file"
    assert refused("some/sphere") == "not a mesh format that can be read (.ply .obj .stl .off .glb .gltf)"
    assert refused("no.ply") == "no such file"
    assert refused("box.ply", material="marbel").startswith("unknown material 'marbel'")


def test_options_that_do_not_apply_are_errors(folder: Path) -> None:
    assert refused("sphere", size_mm=10) == "size_mm is for mesh files, and this is a scene"
    assert "size_mm is for mesh files" in refused(write(folder, MINIMAL), size_mm=10)
    assert refused(folder / "box.ply", vertices=10) == "vertices is for built-in scenes; a file has those it has"


@pytest.mark.parametrize("size_mm", [None, 0.5, 3000])
def test_a_mesh_is_framed_and_lit_from_both_sides(folder: Path, size_mm: float | None) -> None:
    scene = load_scene(folder / "box.ply", size_mm=size_mm)
    assert scene.objects[0].material.name == "marble"
    assert np.ptp(scene.bounds, axis=0).max() == pytest.approx(size_mm or 4)
    clip = np.c_[scene.objects[0].placed, np.ones(8)] @ (scene.camera.projection(1, 1e-3, 1e6) @ scene.camera.view()).T
    reach = np.abs(clip[:, :2] / clip[:, 3:]).max()
    assert 0.9 < reach < 0.95, "the mesh fills the image, with a margin"
    assert (clip[:, 3] > 0).all()

    towards_camera = np.subtract(scene.camera.eye, scene.camera.target)
    directions = [np.dot(d.direction, towards_camera) for d in scene.lights if isinstance(d, DirectionalLight)]
    assert min(directions) < 0 < max(directions), "one from the front, one from behind"
    assert any(isinstance(light, EnvironmentLight) for light in scene.lights)


def test_camera_lights_and_material_are_given_in_the_syntax_of_scene_files(folder: Path) -> None:
    box = folder / "box.ply"
    sun = {"kind": "directional", "direction": [0, -1, 0], "irradiance": [1, 2, 3]}
    lamp = PointLight((1.0, 2.0, 3.0), (1.0, 1.0, 1.0))
    camera = {"kind": "orthographic", "distance": 10.0, "azimuth": 90.0, "elevation": 0.0, "target": [0, 0, 0]}
    scene = load_scene(box, camera=camera, lights=[sun, lamp], material={"preset": "ketchup", "roughness": 0.5})
    assert scene.lights == (DirectionalLight((0, -1, 0), (1, 2, 3)), lamp)
    np.testing.assert_allclose(scene.camera.eye, [10.0, 0.0, 0.0], atol=1e-12)
    assert isinstance(scene.camera, OrthographicCamera)
    assert (scene.objects[0].material.roughness, scene.objects[0].material.eta) == (0.5, MATERIALS["ketchup"].eta)
    assert load_scene(box).lights == load_scene(box, lights=[]).lights != ()
    assert "light: unknown key 'intensity'" in refused(box, lights=[{**sun, "intensity": 1}])


def test_a_scene_at_a_time_does_not_move(folder: Path) -> None:
    scene = load_scene(write(folder, SCENE))
    still = scene.at(1.0)
    assert not np.allclose(still.objects[2].mesh.positions, scene.objects[2].mesh.positions)
    assert still.objects[2].motion is None and still.camera.turn == 0
    assert still.objects[0] is scene.objects[0], "objects that do not move are reused"
    np.testing.assert_allclose(still.camera.eye, OrthographicCamera((0, 0, 100), (0, 1, 0), turn=30).at(1).eye)


def test_bounds_follow_the_placement(folder: Path) -> None:
    scene = load_scene(write(folder, MINIMAL + "translate = [10, 0, 0]\nrotate = [0, 0, 90]"))
    np.testing.assert_allclose(scene.bounds, [[9, -0.5, -2], [11, 0.5, 2]], atol=1e-6)


def test_rotations_are_about_x_then_y_then_z(folder: Path) -> None:
    scene = load_scene(write(folder, MINIMAL + "rotate = [90, 90, 0]"))
    # The rotation about x takes y to z; the rotation about y takes z to x.
    np.testing.assert_allclose(scene.objects[0].matrix @ [0, 1, 0, 0], [1, 0, 0, 0], atol=1e-12)


def test_importing_scenes_loads_no_heavy_packages() -> None:
    heavy = "trimesh scipy skimage imageio OpenEXR PIL wgpu xatlas"
    code = f"import sys, wgsss.scene; print([m for m in '{heavy}'.split() if m in sys.modules])"
    root = Path(__file__).parents[2]
    run = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_real_meshes_become_scenes(data: Path) -> None:
    scene = load_scene(data / "lee_perry_smith" / "LeePerrySmith.obj", material="skin", size_mm=430.6)
    assert scene.objects[0].material.base_color == MATERIALS["skin"].base_color
    assert scene.objects[0].mesh.corner_uvs is not None
    with pytest.warns(UserWarning, match="5 holes"):
        load_scene(data / "bunny_stanford.ply", size_mm=150)
