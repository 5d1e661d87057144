"""The pictures of a scene that changes are bit for bit those of the offscreen renderer."""

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
from wgsss.viewer.pictures import LAYERS, LiveRenderer, View

SIZE = (40, 24)
METHODS = make_method("sam", {"samples": 2, "select": "top", "surface": "screen"}), make_method("lambert")
SCENE = load_scene("wave", vertices=600)
SUN = DirectionalLight((0.3, -1.0, 0.2), (1.0, 2.0, 3.0))
CHANGES = {
    "none": SCENE,
    "camera": replace(SCENE, camera=PerspectiveCamera((60.0, 40.0, 200.0), (0.0, 0.0, 0.0))),
    "sun": replace(SCENE, lights=(SUN, *[x for x in SCENE.lights if isinstance(x, EnvironmentLight)])),
    "sky": replace(SCENE, lights=(EnvironmentLight((3.0, 1.0, 0.5)),)),
    "exposure": replace(SCENE, exposure=1.0),
}


@pytest.fixture(scope="module")
def renderer(gpu: Gpu) -> LiveRenderer:
    return LiveRenderer(gpu)


@pytest.mark.parametrize("change", CHANGES)
def test_pictures_equal_those_of_the_offscreen_renderer(gpu: Gpu, renderer: LiveRenderer, change: str) -> None:
    scene = CHANGES[change]
    drawing = renderer.draw(View(scene, METHODS, SIZE, 0.5))
    for method, picture in zip(METHODS, drawing.pictures, strict=True):
        assert picture.display is not None
        offscreen = Renderer(scene, method, SIZE, gpu).frame(0.5).display
        assert drawing.graph.read(picture.display).tobytes() == offscreen.tobytes()


def test_passes_that_two_methods_share_run_once(renderer: LiveRenderer) -> None:
    drawing = renderer.draw(View(SCENE, METHODS, SIZE))
    sam, lambert = drawing.pictures
    names = [item.module.name for item in drawing.graph.ran]
    assert [names.count(f"frame/{name}") for name in ("gbuffer", "irradiance_pixels", "specular")] == [1, 1, 1]
    assert {"frame/gbuffer", "frame/specular"} <= {*sam.passes} & {*lambert.passes}
    assert "sam/gather" in sam.passes and "sam/gather" not in lambert.passes


def test_layer_of_a_method_is_tone_mapped_like_radiance(renderer: LiveRenderer) -> None:
    scene = replace(SCENE, tone_map="none")
    for layer in set(LAYERS[1:]) - set(SCENE_LAYERS):
        drawing = renderer.draw(View(scene, METHODS, SIZE, layer=layer))
        sam, lambert = drawing.pictures
        aov = Renderer(scene, METHODS[0], SIZE, renderer.gpu).frame(aovs=[layer]).aovs[layer]
        assert sam.display is not None
        linear = np.clip(aov, 0.0, 1.0)
        encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(drawing.graph.read(sam.display)[..., :3] / 255.0, encoded, atol=1.01 / 255.0)
        assert (lambert.display is None) == (layer == "M_back")


def test_layer_of_the_scene_has_its_vertex_colours_for_all_methods(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    colour = np.array([0.2, 0.5, 0.8])
    monkeypatch.setitem(
        layers._VERTEX_COLOURS, "thickness", lambda body: np.tile(colour, (len(body.render_mesh.vertex), 1))
    )
    drawing = LiveRenderer(gpu).draw(View(load_scene("sphere", vertices=500), METHODS, SIZE, layer="thickness"))
    first, second = drawing.pictures
    assert first.display is second.display and first.display is not None
    pixels, mask = drawing.graph.read(first.display), drawing.object_mask
    assert (pixels[..., 3] > 0).sum() == mask.sum()
    encoded = 255.0 * (1.055 * colour ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(pixels[mask][:, :3], np.tile(encoded, (mask.sum(), 1)), atol=0.6)


def test_thickness_colours_are_those_of_the_render_vertices(gpu: Gpu) -> None:
    stage = Stage(gpu, load_scene("ear", vertices=1000))
    (body,) = stage.bodies
    colours = local_thickness(body.rest.mesh, body.material.profile)
    assert colours.max() > 0.1
    np.testing.assert_array_equal(layers._thickness_colours(body), colours[body.render_mesh.vertex])


def test_shadow_map_shows_the_depth_seen_from_the_light(renderer: LiveRenderer) -> None:
    scene = replace(load_scene("sphere", vertices=500), lights=(SUN,))
    drawing = renderer.draw(View(scene, METHODS[1:], SIZE, layer="shadow map"))
    display = drawing.pictures[0].display
    assert display is not None
    pixels = drawing.graph.read(display)
    lit = pixels[..., 3] > 0
    # The light's view reaches from 0.5 to 3.5 radii, and the sphere begins at 1 radius.
    assert pixels[..., 0].max() == pytest.approx(255.0 * (1.055 * (5 / 6) ** (1 / 2.4) - 0.055), abs=1.5)
    assert pixels[lit, 0].min() < 255.0 * (1.055 * 0.53 ** (1 / 2.4) - 0.055), "the rim is one radius deeper"
    assert lit.mean() == pytest.approx(np.pi / 4 / 1.02**2, rel=0.03), "the disc fills the map"
    scene = replace(scene, lights=(EnvironmentLight(),))
    dark = renderer.draw(View(scene, METHODS[1:], SIZE, layer="shadow map"))
    assert dark.pictures[0].display is None


def test_uv_stretch_of_a_plane_is_uniform(gpu: Gpu) -> None:
    drawing = LiveRenderer(gpu).draw(View(load_scene("slab", vertices=300), METHODS[1:], SIZE, layer="UV stretch"))
    display = drawing.pictures[0].display
    assert display is not None
    colours = drawing.graph.read(display)[drawing.object_mask][:, :3]
    middle = np.round(255 * np.array([0.865, 0.865, 0.865]))
    assert np.abs(colours - middle).max() < 12, "the middle of the colour map is 0.865 in each channel"


def test_shadow_maps_are_redrawn_only_when_lights_or_meshes_move(gpu: Gpu) -> None:
    renderer = LiveRenderer(gpu)
    lit = replace(SCENE, lights=(SUN,))

    def shadow_passes(scene: Scene, time_s: float = 0.0, layer: str = "image") -> int:
        drawing = renderer.draw(View(scene, METHODS[1:], SIZE, time_s, layer))
        return sum(item.module.name == "frame/shadow" for item in drawing.graph.ran)

    assert shadow_passes(lit) == 1
    assert shadow_passes(replace(lit, camera=CHANGES["camera"].camera)) == 0
    assert shadow_passes(lit, layer="shadow map") == 0
    assert shadow_passes(replace(lit, lights=(replace(SUN, direction=(0.0, -1.0, 0.0)),))) == 1
    assert shadow_passes(lit) == 1
    assert shadow_passes(lit, 0.5) == 1
