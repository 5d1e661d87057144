"""What the vertices of a spatial adjacency map receive, against sums, closed forms and the integral."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from maps import FRONT, MARBLE, PLAIN, SIDE, light_at_vertices, random_sender_map, rms, use_sender_map
from scenes import lit, plane

from wgsss import frame as shared
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.fans import fan_areas
from wgsss.errors import InputError
from wgsss.gpu import LIMITS
from wgsss.graph import Graph
from wgsss.methods.lambert import Lambert
from wgsss.methods.sam import method as sam
from wgsss.methods.screen_space import ScreenSpace
from wgsss.methods.texture_space import TextureSpace
from wgsss.reference.integral import at_vertices, pixel_receivers
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import (
    MATERIALS,
    DirectionalLight,
    EnvironmentLight,
    Object,
    PerspectiveCamera,
    load_scene,
)
from wgsss.scene.shapes import ear, slab, sphere
from wgsss.stage import Stage
from wgsss.study.light_types import light_types

WHITE_SKY = EnvironmentLight((1, 1, 1))


class Passes:
    """One frame's translucency passes, declared and run."""

    def __init__(self, stage, method=PLAIN, size=(24, 24)):
        graph = Graph(stage.gpu)
        frame = shared.begin(graph, stage, size)
        diffused = method.passes(frame)
        gathers = [p for p in graph.passes if p.module.name == "sam/gather"]
        # Of a map in parts the last pass has all.
        gathers = [p for p in gathers if p.writes["M_back"].version == p.writes["M_back"].resource.version]
        mixes = [p.writes["M_back"] for p in graph.passes if p.module.name == "sam/mix"]
        read = [h for p in gathers for h in (p.writes["M_back"], p.reads["irradiance"])]
        graph.run(*read, *mixes, diffused.M_front, *([diffused.M_back] if diffused.M_back else []))
        self.at_vertices = [graph.read(h)[:, :3] for h in read[::2]]
        self.mixed = graph.read(mixes[-1])[:, :3] if mixes else None
        self.irradiance = [graph.read(h) for h in read[1::2]]
        self.M_back = diffused.M_back and graph.read(diffused.M_back)
        self.ran = [p.module.name for p in graph.ran]


@pytest.mark.parametrize(("vertices", "few"), [(90, False), (300, True), (300, False), (20_000, False), (5000, True)])
def test_vertices_receive_what_their_entries_read(gpu, monkeypatch, vertices, few):
    """Means over nodes as they are defined, node by node; the root is over all of the surface."""
    mesh = sphere(9.0, vertices)
    entries, area = random_sender_map(mesh, few=few), fan_areas(mesh)
    use_sender_map(monkeypatch, lambda mesh: entries)
    stage = Stage(gpu, lit(SIDE, WHITE_SKY, mesh=mesh, material=MARBLE, camera=FRONT))
    found = Passes(stage)
    (M,), (read,) = found.at_vertices, found.irradiance
    L, over = light_at_vertices(stage), entries.tree
    assert L.std() > 0.3, "the light should vary"
    ranges = [over.order[a : a + n] for a, n in zip(over.first, over.count, strict=True)]
    means = np.array([np.average(L[r], axis=0, weights=area[r]) for r in ranges])
    expected = np.einsum("vnc,vnc->vc", entries.weight, np.concatenate([L, means])[entries.sender])
    np.testing.assert_allclose(M, expected, rtol=1e-5)
    assert len(read) - len(over.first) <= (60 if few else len(L)), "no light where nobody looks"


def test_fitted_entries_read_means_that_fade_into_their_neighbours(gpu):
    stage = Stage(gpu, lit(SIDE, mesh=ear(500), material=MARBLE, camera=FRONT))
    method, mesh = replace(PLAIN, select="fit"), stage.bodies[0].rest.mesh
    passes = Passes(stage, method)
    (M,) = passes.at_vertices
    entries, light, area = method.map(stage.bodies[0]), light_at_vertices(stage)[:, :3], fan_areas(mesh)
    assert (entries.sender >= entries.sender_count).mean() > 0.3
    means = entries.tree.sums(light * area[:, None]) / entries.tree.sums(area)[:, None]
    read = np.concatenate([light, entries.smoothed_means.apply(means)])
    gathered = np.einsum("vnc,vnc->vc", entries.weight, read[np.maximum(entries.sender, 0)])
    np.testing.assert_allclose(M, gathered, rtol=1e-4, atol=1e-5)
    second = entries.neighbour_mixture.row >= len(mesh.positions)
    assert (second & (entries.neighbour_mixture.weight > 0.0)).any(), "some have a second row"
    mixed = (
        np.einsum("vk,vkc->vc", entries.neighbour_mixture.weight.astype(float), gathered[entries.neighbour_mixture.row])
        * entries.neighbour_mixture.tint
    )
    assert mixed.max() > 0.1 and np.abs(mixed - gathered[: len(mixed)]).max() > 0.01
    np.testing.assert_allclose(passes.mixed, mixed, rtol=1e-4, atol=1e-5)


def test_in_even_light_they_receive_the_sum_of_their_weights(gpu):
    mesh = sphere(2.0, 300)
    stage = Stage(gpu, lit(WHITE_SKY, mesh=mesh, material=MARBLE, camera=FRONT))
    method = replace(PLAIN, samples=8)
    method.bake(stage)
    found = Passes(stage, method)
    (M,), (L,) = found.at_vertices, found.irradiance
    L = L[L[:, 0] > 0.0]  # not of what nobody reads
    assert np.ptp(L[:, :3], axis=0).max() < 1e-6
    sums = method.map(stage.bodies[0]).weight.sum(axis=1, dtype=np.float64)
    assert sums.min() > 1e-4
    np.testing.assert_allclose(M / L[0, :3], sums, rtol=1e-4)


@pytest.mark.parametrize("mesh", [sphere(9.0, 300), ear(500), slab((12, 12, 0.05), 300)], ids=["ball", "ear", "sheet"])
def test_pixels_show_what_lies_between_the_vertices(gpu, monkeypatch, mesh):
    """Of the side that is seen, also where what is behind it is near."""
    dyed = replace(MARBLE, base_color=(0.5, 0.25, 0.8), color_after=0.3)
    far = 1.5 * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    camera = PerspectiveCamera((0.2 * far, 0.1 * far, far), (1, 0, 0), fov=30)
    scene = lit(SIDE, mesh=mesh, material=dyed, camera=camera)
    turned = replace(scene, objects=(replace(scene.objects[0], rotate=(20, 30, 40), translate=(1, -1, 0)),))
    stage = Stage(gpu, turned)
    use_sender_map(monkeypatch, random_sender_map)
    found = Passes(stage, size=(40, 30))
    graph = Graph(gpu)
    seen = pixel_receivers(shared.begin(graph, stage, (40, 30)))
    graph.run(seen.place)
    place = graph.read(seen.place)
    here = place[..., 3] == 1
    b = np.concatenate([place[here][:, :2], 1.0 - place[here][:, :2].sum(axis=1, keepdims=True)], axis=1)
    corners = found.at_vertices[0][turned.objects[0].mesh.faces[place[here][:, 2].astype(int)]]
    expected = np.einsum("nk,nkc->nc", b, corners) * np.power(dyed.base_color, 0.3)
    np.testing.assert_allclose(found.M_back[here][:, :3], expected, rtol=1e-4, atol=1e-5)
    assert here.sum() > 150 and not found.M_back[~here].any()


def test_objects_hide_each_other_and_those_of_one_mesh_and_material_share_a_map(gpu, monkeypatch):
    calls = use_sender_map(monkeypatch, random_sender_map)
    mesh, curtain = sphere(5.0, 200), Object(plane(side=30.0), MARBLE, rotate=(90, 0, 0), translate=(-15, 0, 10))
    pair = [Object(mesh, MARBLE, translate=(x, 0, 0)) for x in (-6, 6)]
    scene = replace(lit(SIDE, camera=replace(FRONT, height=26)), objects=(*pair, curtain))
    nothing = SenderMap(np.full((81, 3), -1, np.int32), np.zeros((81, 3, 3), np.float32), 81, None, None)
    given_maps = {id(mesh): random_sender_map(mesh), id(curtain.mesh): nothing}
    calls = use_sender_map(monkeypatch, lambda mesh: given_maps[id(mesh)])
    stage = Stage(gpu, scene)
    PLAIN.bake(stage)
    found = Passes(stage)
    assert [id(call[0]) for call in calls] == [id(mesh), id(curtain.mesh)]
    assert found.ran.count("sam/gather") == 2, "the curtain has no back"
    assert not found.M_back[:, :12].any(), "the left ball is behind it"
    assert (found.M_back[12, 17, :3] > 0).all()


def test_a_scene_without_a_back_has_no_translucency_passes(gpu):
    stage = Stage(gpu, lit(SIDE, mesh=sphere(60.0, 200), material=MATERIALS["skin1"]))
    PLAIN.bake(stage)
    found = Passes(stage)
    assert found.M_back is None
    assert not [name for name in found.ran if name.startswith("sam/") or name == "frame/irradiance_points"]


def brightness(stage, times, dark_until):
    """M_back over time, of an object that light falls on after a time; 1 where it has arrived."""
    scene, found = stage.rest, []
    for time_s in times:
        stage.rest = scene if time_s > dark_until else replace(scene, lights=(replace(SIDE, irradiance=(0, 0, 0)),))
        stage.pose(time_s)
        found.append(Passes(stage).at_vertices[0])
    stage.rest = scene
    return np.array([rms(M) for M in found]) / rms(Passes(Stage(stage.gpu, scene)).at_vertices[0])


def test_a_step_arrives_over_time_at_any_frame_rate(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    scene = lit(SIDE, mesh=sphere(5.0, 90), material=MARBLE, camera=FRONT)
    for rate in (60, 24, 144):
        times = np.arange(1 + rate // 6) / rate
        got = brightness(Stage(gpu, scene), times, dark_until=0.0)
        np.testing.assert_allclose(got, 1.0 - np.exp2(-times / 0.030103), atol=1e-5)
        if rate == 60:
            assert got[1] == pytest.approx(0.32, abs=0.005)


def test_frames_that_are_not_after_the_last_start_anew(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    scene = lit(SIDE, mesh=sphere(5.0, 90), material=MARBLE, camera=FRONT)
    got = brightness(Stage(gpu, scene), [0.7], dark_until=0.0)
    np.testing.assert_allclose(got, 1.0, rtol=1e-6)
    for again in (0.01, 0.005):
        got = brightness(Stage(gpu, scene), [0.0, 0.01, again], dark_until=0.001)
        np.testing.assert_allclose(got, [0.0, 1.0 - 0.1**0.1, 1.0], rtol=1e-5)


def test_two_objects_of_one_map_keep_their_own_light(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    mesh = sphere(5.0, 90)
    objects = (Object(mesh, MARBLE), Object(mesh, MARBLE, rotate=(0, 180, 0), translate=(12, 0, 0)))
    stage = Stage(gpu, replace(lit(DirectionalLight((-1, 0, 0), (1, 1, 1))), objects=objects))
    for time_s in (0.0, 1e-6):
        stage.pose(time_s)
        found = Passes(stage).at_vertices
    apart = [Passes(Stage(gpu, replace(stage.rest, objects=(o,)))).at_vertices[0] for o in objects]
    # The left one is in the shadow of the right one.
    assert rms(found[0]) < 0.2 * rms(apart[0])
    np.testing.assert_allclose(found[1], apart[1], rtol=1e-5)


THIN = replace(MATERIALS["skin1"], specular=0.0)


def plate(light):
    return lit(light, mesh=slab((12, 12, 2), 600), material=THIN, camera=FRONT)


def test_more_samples_come_closer_to_the_integral_under_any_light(gpu):
    """Lit from behind and aside. What is left are the plate's edges, where normals are no plane's."""
    for name, scene in light_types(plate(WHITE_SKY)).items():
        stage = Stage(gpu, scene)
        _, back = at_vertices(stage, stage.bodies[0], tolerance=0.05)
        counts = (3, 32, 256) if name == "directional" else (256,)
        errors = [rms(Passes(stage, replace(PLAIN, samples=n)).at_vertices[0] - back) / rms(back) for n in counts]
        print(name, errors)
        assert errors[-1] < 0.12
        if len(errors) > 1:
            assert errors[1] < 0.6 * errors[0] and errors[2] < 0.3 * errors[1]


def test_knobs_are_words_that_are_known(gpu):
    method = make_method("sam", {"samples": "8", "surface": "screen"})
    assert (method.samples, method.surface) == (8, "screen")
    with pytest.raises(InputError, match=r"sam: surface must be one of texture, screen, none, not 'paper'"):
        make_method("sam", {"surface": "paper"})
    with pytest.raises(InputError, match=r"sam: select must be one of top.*, not 3"):
        make_method("sam", {"select": 3})
    with pytest.raises(InputError, match="sam: samples"):
        make_method("sam", {"samples": 0})


KINDS = {"texture": TextureSpace, "screen": ScreenSpace, "none": Lambert}


@pytest.mark.parametrize("surface", KINDS)
def test_the_near_side_is_that_of_another_method(gpu, monkeypatch, surface):
    monkeypatch.setitem(KINDS, "texture", partial(TextureSpace, map_size=64))
    monkeypatch.setitem(sam.SURFACES, "texture", KINDS["texture"])
    scene = load_scene("ear", vertices=500)
    got = Renderer(scene, replace(PLAIN, surface=surface), (16, 16), gpu).frame(aovs=("M_front", "M_back"))
    expected = Renderer(scene, KINDS[surface](), (16, 16), gpu).frame(aovs=("M_front",))
    np.testing.assert_array_equal(got.aovs["M_front"], expected.aovs["M_front"])
    assert got.aovs["M_back"].any()


def test_a_fitted_map_too_large_for_a_binding_is_mixed_in_parts(gpu, monkeypatch):
    """What one part gathers, the next one may mix."""
    scene = lit(SIDE, mesh=ear(500), material=MARBLE, camera=FRONT)
    method = replace(PLAIN, select="fit")
    whole = Passes(Stage(gpu, scene), method)
    monkeypatch.setitem(LIMITS, "max-storage-buffer-binding-size", 300 * 48 + 5)
    parts = Passes(Stage(gpu, scene), method)
    assert parts.ran.count("sam/mix") == parts.ran.count("sam/gather") == 2 and whole.ran.count("sam/mix") == 1
    np.testing.assert_array_equal(parts.mixed, whole.mixed)
