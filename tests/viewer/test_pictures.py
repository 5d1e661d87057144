"""Pictures are those of the offscreen command, bit for bit, whatever was shown before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wgsss.bake.thickness import local_thickness
from wgsss.gpu import Gpu
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import DirectionalLight, EnvironmentLight, PerspectiveCamera, Scene, load_scene
from wgsss.stage import Stage
from wgsss.viewer import layers
from wgsss.viewer.layers import SCENE_LAYERS
from wgsss.viewer.pictures import LAYERS, Easel

SIZE = (40, 24)
METHODS = [make_method("sam", {"samples": 2, "select": "top", "surface": "screen"}), make_method("lambert")]
SCENE = load_scene("wave", vertices=600)
SUN = DirectionalLight((0.3, -1.0, 0.2), (1.0, 2.0, 3.0))
CHANGES = {
    "as it is": SCENE,
    "camera": replace(SCENE, camera=PerspectiveCamera((60.0, 40.0, 200.0), (0.0, 0.0, 0.0))),
    "sun": replace(SCENE, lights=(SUN, *[x for x in SCENE.lights if isinstance(x, EnvironmentLight)])),
    "sky": replace(SCENE, lights=(EnvironmentLight((3.0, 1.0, 0.5)),)),
    "exposure": replace(SCENE, exposure=1.0),
}


@pytest.fixture(scope="module")
def easel(gpu: Gpu) -> Easel:
    return Easel(gpu)


@pytest.mark.parametrize("change", CHANGES)
def test_pictures_are_those_of_the_offscreen_command(gpu: Gpu, easel: Easel, change: str) -> None:
    scene = CHANGES[change]
    drawing = easel.draw(scene, METHODS, SIZE, 0.5)
    for method, picture in zip(METHODS, drawing.pictures, strict=True):
        assert picture.display is not None
        wanted = Renderer(scene, method, SIZE, gpu).frame(0.5).display
        assert drawing.graph.read(picture.display).tobytes() == wanted.tobytes()


def test_what_two_methods_share_is_drawn_once(easel: Easel) -> None:
    drawing = easel.draw(SCENE, METHODS, SIZE)
    sam, lambert = drawing.pictures
    names = [item.module.name for item in drawing.graph.ran]
    assert [names.count(f"frame/{name}") for name in ("gbuffer", "irradiance_pixels", "specular")] == [1, 1, 1]
    assert {"frame/gbuffer", "frame/specular"} <= {*sam.passes} & {*lambert.passes}
    assert "sam/gather" in sam.passes and "sam/gather" not in lambert.passes


def test_a_layer_is_shown_as_if_it_were_light(easel: Easel) -> None:
    scene = replace(SCENE, tone_map="none")
    for layer in set(LAYERS[1:]) - set(SCENE_LAYERS):
        drawing = easel.draw(scene, METHODS, SIZE, layer=layer)
        sam, lambert = drawing.pictures
        aov = Renderer(scene, METHODS[0], SIZE, easel.gpu).frame(aovs=[layer]).aovs[layer]
        assert sam.display is not None
        linear = np.clip(aov, 0.0, 1.0)
        encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(drawing.graph.read(sam.display)[..., :3] / 255.0, encoded, atol=1.01 / 255.0)
        assert (lambert.display is None) == (layer == "M_back")


def test_layers_of_the_scene_are_the_same_for_all_methods_and_as_coloured(
    gpu: Gpu, monkeypatch: pytest.MonkeyPatch
) -> None:
    colour = np.array([0.2, 0.5, 0.8])
    monkeypatch.setitem(layers._PAINTED, "thickness", lambda body: np.tile(colour, (len(body.render_mesh.vertex), 1)))
    drawing = Easel(gpu).draw(load_scene("sphere", vertices=500), METHODS, SIZE, layer="thickness")
    first, second = drawing.pictures
    assert first.display is second.display and first.display is not None
    shown = drawing.graph.read(first.display)
    assert (shown[..., 3] > 0).sum() == drawing.seen.sum()
    encoded = 255.0 * (1.055 * colour ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(shown[drawing.seen][:, :3], np.tile(encoded, (drawing.seen.sum(), 1)), atol=0.6)


def test_thickness_is_that_of_the_render_vertices(gpu: Gpu) -> None:
    stage = Stage(gpu, load_scene("ear", vertices=1000))
    (body,) = stage.bodies
    wanted = local_thickness(body.rest.mesh, body.material.profile)
    assert wanted.max() > 0.1
    np.testing.assert_array_equal(layers._thickness(body), wanted[body.render_mesh.vertex])


def test_a_shadow_map_shows_what_the_light_sees(gpu: Gpu) -> None:
    easel = Easel(gpu)
    scene = replace(load_scene("sphere", vertices=500), lights=(SUN,))
    drawing = easel.draw(scene, METHODS[1:], SIZE, layer="shadow map")
    display = drawing.pictures[0].display
    assert display is not None
    shown = drawing.graph.read(display)
    lit = shown[..., 3] > 0
    # The view goes from half a radius to three and a half; the ball is met from one radius on.
    assert shown[..., 0].max() == pytest.approx(255.0 * (1.055 * (5 / 6) ** (1 / 2.4) - 0.055), abs=1.5)
    assert shown[lit, 0].min() < 255.0 * (1.055 * 0.53 ** (1 / 2.4) - 0.055), "at the rim, one radius deeper"
    assert lit.mean() == pytest.approx(np.pi / 4 / 1.02**2, rel=0.03), "a disc that fits"
    dark = easel.draw(replace(scene, lights=(EnvironmentLight(),)), METHODS[1:], SIZE, layer="shadow map")
    assert dark.pictures[0].display is None


def test_the_stretch_of_a_plane_is_even(gpu: Gpu) -> None:
    drawing = Easel(gpu).draw(load_scene("slab", vertices=300), METHODS[1:], SIZE, layer="UV stretch")
    display = drawing.pictures[0].display
    assert display is not None
    colours = drawing.graph.read(display)[drawing.seen][:, :3]
    middle = np.round(255 * np.array([0.865, 0.865, 0.865]))
    assert np.abs(colours - middle).max() < 12, "the middle of the map's colours, as 0.865 of each channel"


def test_shadows_are_drawn_again_only_where_lights_or_meshes_moved(gpu: Gpu) -> None:
    easel = Easel(gpu)
    lit = replace(SCENE, lights=(SUN,))

    def shadows(scene: Scene, time_s: float = 0.0, layer: str = "image") -> int:
        drawing = easel.draw(scene, METHODS[1:], SIZE, time_s, layer)
        return sum(item.module.name == "frame/shadow" for item in drawing.graph.ran)

    assert shadows(lit) == 1
    assert shadows(replace(lit, camera=CHANGES["camera"].camera)) == 0
    assert shadows(lit, layer="shadow map") == 0
    assert shadows(replace(lit, lights=(replace(SUN, direction=(0.0, -1.0, 0.0)),))) == 1
    assert shadows(lit) == 1
    assert shadows(lit, 0.5) == 1
