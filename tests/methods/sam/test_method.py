"""M_back at the vertices and in the pixels by a given sender map, against sums, closed forms and the integral."""

from __future__ import annotations

from dataclasses import replace

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
from wgsss.methods.sam.method import SamTranslucency
from wgsss.reference.integral import at_vertices, pixel_receivers
from wgsss.registry import make_method
from wgsss.scene import (
    MATERIALS,
    DirectionalLight,
    EnvironmentLight,
    Object,
    PerspectiveCamera,
)
from wgsss.scene.shapes import ear, slab, sphere
from wgsss.stage import Stage
from wgsss.study.light_types import light_types

WHITE_SKY = EnvironmentLight((1, 1, 1))


class Passes:
    """The passes of a frame that estimate M_back.

    Attributes:
        gathered: (R, 3) for each body that receives light, W/m^2, what its rows of entries gathered.
        irradiance: (N, 4) for each of them, W/m^2, what its entries read.
        mixed: (V, 3), W/m^2, the mixtures at the vertices of the last body; None: its map has none.
        M_back: (height, width, 4), W/m^2; None: no body receives light.
        modules: the names of the WGSL modules of all passes declared.
    """

    def __init__(self, stage, method=PLAIN, size=(24, 24)):
        graph = Graph(stage.gpu)
        M_back = method.M_back(shared.begin(graph, stage, size), Lambert())
        self.modules = [p.module.name for p in graph.passes]
        gathers = [p for p in graph.passes if p.module.name == "sam/gather"]
        # The last block of a map completes its buffer.
        gathers = [p for p in gathers if p.writes["M_back"].version == p.writes["M_back"].resource.version]
        mixtures = [p.writes["M_back"] for p in graph.passes if p.module.name == "sam/neighbour_mixture"]
        gathered = [p.writes["M_back"] for p in gathers]
        irradiance = [p.reads["irradiance"] for p in gathers]
        graph.run(*gathered, *irradiance, *mixtures, *([M_back] if M_back else []))
        self.gathered = [graph.read(handle)[:, :3] for handle in gathered]
        self.irradiance = [graph.read(handle) for handle in irradiance]
        self.mixed = graph.read(mixtures[-1])[:, :3] if mixtures else None
        self.M_back = M_back and graph.read(M_back)


@pytest.mark.parametrize(("vertices", "few"), [(90, False), (300, True), (300, False), (20_000, False), (5000, True)])
def test_vertices_receive_the_weighted_sum_of_what_their_entries_read(gpu, monkeypatch, vertices, few):
    """The means of nodes are compared with averages over their vertices, node by node."""
    mesh = sphere(9.0, vertices)
    sender_map, area = random_sender_map(mesh, few=few), fan_areas(mesh)
    use_sender_map(monkeypatch, lambda mesh: sender_map)
    stage = Stage(gpu, lit(SIDE, WHITE_SKY, mesh=mesh, material=MARBLE, camera=FRONT))
    passes = Passes(stage)
    (M,), (irradiance,) = passes.gathered, passes.irradiance
    L, tree = light_at_vertices(stage), sender_map.tree
    assert L.std() > 0.3, "the light should vary"
    ranges = [tree.order[a : a + n] for a, n in zip(tree.first, tree.count, strict=True)]
    means = np.array([np.average(L[r], axis=0, weights=area[r]) for r in ranges])
    expected = np.einsum("vnc,vnc->vc", sender_map.weight, np.concatenate([L, means])[sender_map.sender])
    np.testing.assert_allclose(M, expected, rtol=1e-5)
    assert len(irradiance) - len(tree.first) <= (60 if few else len(L)), "no light at vertices that no entry reads"


def test_fitted_entries_read_smoothed_means_and_neighbours_are_mixed(gpu):
    stage = Stage(gpu, lit(SIDE, mesh=ear(500), material=MARBLE, camera=FRONT))
    method, mesh = replace(PLAIN, select="fit"), stage.bodies[0].rest.mesh
    passes = Passes(stage, method)
    (M,) = passes.gathered
    sender_map, light, area = method.sender_map(stage.bodies[0]), light_at_vertices(stage)[:, :3], fan_areas(mesh)
    assert (sender_map.sender >= sender_map.sender_count).mean() > 0.3
    means = sender_map.tree.sums(light * area[:, None]) / sender_map.tree.sums(area)[:, None]
    irradiance = np.concatenate([light, sender_map.smoothed_means.apply(means)])
    gathered = np.einsum("vnc,vnc->vc", sender_map.weight, irradiance[np.maximum(sender_map.sender, 0)])
    np.testing.assert_allclose(M, gathered, rtol=1e-4, atol=1e-5)
    mixture = sender_map.neighbour_mixture
    assert ((mixture.row >= len(mesh.positions)) & (mixture.weight > 0.0)).any(), "some vertices have a second row"
    mixed = np.einsum("vk,vkc->vc", mixture.weight.astype(float), gathered[mixture.row]) * mixture.tint
    assert mixed.max() > 0.1 and np.abs(mixed - gathered[: len(mixed)]).max() > 0.01
    np.testing.assert_allclose(passes.mixed, mixed, rtol=1e-4, atol=1e-5)


def test_vertices_in_even_light_receive_the_sum_of_their_weights(gpu):
    mesh = sphere(2.0, 300)
    stage = Stage(gpu, lit(WHITE_SKY, mesh=mesh, material=MARBLE, camera=FRONT))
    method = replace(PLAIN, samples=8)
    method.bake(stage)
    passes = Passes(stage, method)
    (M,), (L,) = passes.gathered, passes.irradiance
    L = L[L[:, 0] > 0.0]  # without points that no vertex reads
    assert np.ptp(L[:, :3], axis=0).max() < 1e-6
    sums = method.sender_map(stage.bodies[0]).weight.sum(axis=1, dtype=np.float64)
    assert sums.min() > 1e-4
    np.testing.assert_allclose(M / L[0, :3], sums, rtol=1e-4)


@pytest.mark.parametrize("mesh", [sphere(9.0, 300), ear(500), slab((12, 12, 0.05), 300)], ids=["ball", "ear", "sheet"])
def test_pixels_show_M_back_interpolated_between_the_vertices(gpu, monkeypatch, mesh):
    """The pixels show the side that faces the camera, also if the other side is near, as in a thin sheet."""
    dyed = replace(MARBLE, base_color=(0.5, 0.25, 0.8), color_after=0.3)
    far = 1.5 * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    camera = PerspectiveCamera((0.2 * far, 0.1 * far, far), (1, 0, 0), fov=30)
    scene = lit(SIDE, mesh=mesh, material=dyed, camera=camera)
    turned = replace(scene, objects=(replace(scene.objects[0], rotate=(20, 30, 40), translate=(1, -1, 0)),))
    stage = Stage(gpu, turned)
    use_sender_map(monkeypatch, random_sender_map)
    passes = Passes(stage, size=(40, 30))
    graph = Graph(gpu)
    seen = pixel_receivers(shared.begin(graph, stage, (40, 30)))
    graph.run(seen.place)
    place = graph.read(seen.place)
    covered = place[..., 3] == 1
    b = np.concatenate([place[covered][:, :2], 1.0 - place[covered][:, :2].sum(axis=1, keepdims=True)], axis=1)
    corners = passes.gathered[0][turned.objects[0].mesh.faces[place[covered][:, 2].astype(int)]]
    expected = np.einsum("nk,nkc->nc", b, corners) * np.power(dyed.base_color, 0.3)
    np.testing.assert_allclose(passes.M_back[covered][:, :3], expected, rtol=1e-4, atol=1e-5)
    assert covered.sum() > 150 and not passes.M_back[~covered].any()


def test_objects_hide_each_other_and_share_a_map_if_mesh_and_material_are_the_same(gpu, monkeypatch):
    mesh, curtain = sphere(5.0, 200), Object(plane(side=30.0), MARBLE, rotate=(90, 0, 0), translate=(-15, 0, 10))
    pair = [Object(mesh, MARBLE, translate=(x, 0, 0)) for x in (-6, 6)]
    scene = replace(lit(SIDE, camera=replace(FRONT, height=26)), objects=(*pair, curtain))
    nothing = SenderMap(np.full((81, 3), -1, np.int32), np.zeros((81, 3, 3), np.float32), 81, None, None)
    sender_maps = {id(mesh): random_sender_map(mesh), id(curtain.mesh): nothing}
    calls = use_sender_map(monkeypatch, lambda mesh: sender_maps[id(mesh)])
    stage = Stage(gpu, scene)
    PLAIN.bake(stage)
    passes = Passes(stage)
    assert [id(call[0]) for call in calls] == [id(mesh), id(curtain.mesh)]
    assert passes.modules.count("sam/gather") == 2, "the curtain has no back"
    assert not passes.M_back[:, :12].any(), "the left ball is behind it"
    assert (passes.M_back[12, 17, :3] > 0).all()


def test_M_back_stays_the_same_once_another_method_gives_the_body_an_atlas(gpu):
    stage = Stage(gpu, lit(SIDE, mesh=ear(600), material=MARBLE, camera=replace(FRONT, eye=(0, 30, 250), height=80)))
    before = Passes(stage).M_back
    split = len(stage.bodies[0].render_mesh.vertex)
    stage.bodies[0].unwrap()
    assert len(stage.bodies[0].render_mesh.vertex) > split, "the atlas splits vertices"
    np.testing.assert_allclose(Passes(stage).M_back, before, atol=1e-5)
    assert before.max() > 0.01


def test_a_scene_without_translucency_has_no_passes_for_it(gpu):
    stage = Stage(gpu, lit(SIDE, mesh=sphere(60.0, 200), material=MATERIALS["skin1"]))
    PLAIN.bake(stage)
    passes = Passes(stage)
    assert passes.M_back is None
    assert not [name for name in passes.modules if name.startswith("sam/") or name == "frame/irradiance_points"]


def brightness(stage, times, dark_until):
    """Return M_back at the given times relative to its final value. The light is on at times after `dark_until`."""
    scene, M = stage.rest, []
    for time_s in times:
        stage.rest = scene if time_s > dark_until else replace(scene, lights=(replace(SIDE, irradiance=(0, 0, 0)),))
        stage.pose(time_s)
        M.append(Passes(stage).gathered[0])
    stage.rest = scene
    return np.array([rms(of_frame) for of_frame in M]) / rms(Passes(Stage(stage.gpu, scene)).gathered[0])


def test_a_step_in_the_light_arrives_over_time_at_any_frame_rate(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    scene = lit(SIDE, mesh=sphere(5.0, 90), material=MARBLE, camera=FRONT)
    for rate in (60, 24, 144):
        times = np.arange(1 + rate // 6) / rate
        got = brightness(Stage(gpu, scene), times, dark_until=0.0)
        np.testing.assert_allclose(got, 1.0 - np.exp2(-times / 0.030103), atol=1e-5)
        if rate == 60:
            assert got[1] == pytest.approx(0.32, abs=0.005)


def test_frames_not_later_than_the_last_are_not_blended(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    scene = lit(SIDE, mesh=sphere(5.0, 90), material=MARBLE, camera=FRONT)
    got = brightness(Stage(gpu, scene), [0.7], dark_until=0.0)
    np.testing.assert_allclose(got, 1.0, rtol=1e-6)
    for last in (0.01, 0.005):
        got = brightness(Stage(gpu, scene), [0.0, 0.01, last], dark_until=0.001)
        np.testing.assert_allclose(got, [0.0, 1.0 - 0.1**0.1, 1.0], rtol=1e-5)


def test_two_objects_of_one_map_keep_their_own_light(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    mesh = sphere(5.0, 90)
    objects = (Object(mesh, MARBLE), Object(mesh, MARBLE, rotate=(0, 180, 0), translate=(12, 0, 0)))
    stage = Stage(gpu, replace(lit(DirectionalLight((-1, 0, 0), (1, 1, 1))), objects=objects))
    for time_s in (0.0, 1e-6):
        stage.pose(time_s)
        M = Passes(stage).gathered
    alone = [Passes(Stage(gpu, replace(stage.rest, objects=(o,)))).gathered[0] for o in objects]
    # The left object is in the shadow of the right one.
    assert rms(M[0]) < 0.2 * rms(alone[0])
    np.testing.assert_allclose(M[1], alone[1], rtol=1e-5)


THIN = replace(MATERIALS["skin1"], specular=0.0)


def plate(light):
    return lit(light, mesh=slab((12, 12, 2), 600), material=THIN, camera=FRONT)


def test_more_samples_come_closer_to_the_integral_under_any_light(gpu):
    """The rest of the error is at the edges of the plate, where the normals are not those of a plane."""
    for name, scene in light_types(plate(WHITE_SKY)).items():
        stage = Stage(gpu, scene)
        _, back = at_vertices(stage, stage.bodies[0], tolerance=0.05)
        counts = (3, 32, 256) if name == "directional" else (256,)
        errors = [rms(Passes(stage, replace(PLAIN, samples=n)).gathered[0] - back) / rms(back) for n in counts]
        print(name, errors)
        assert errors[-1] < 0.12
        if len(errors) > 1:
            assert errors[1] < 0.6 * errors[0] and errors[2] < 0.3 * errors[1]


def test_knobs_outside_their_range_or_choices_are_refused():
    assert make_method("none+sam", {"samples": "8", "select": "top"}).instances()[1] == SamTranslucency(8, "top")
    with pytest.raises(InputError, match=r"sam: select must be one of top.*, not 3"):
        make_method("sam", {"select": 3})
    with pytest.raises(InputError, match="sam: samples"):
        make_method("sam", {"samples": 0})


def test_a_fitted_map_too_large_for_a_binding_is_mixed_in_blocks(gpu, monkeypatch):
    """The mixtures of one block may read rows of another."""
    scene = lit(SIDE, mesh=ear(500), material=MARBLE, camera=FRONT)
    method = replace(PLAIN, select="fit")
    whole = Passes(Stage(gpu, scene), method)
    monkeypatch.setitem(LIMITS, "max-storage-buffer-binding-size", 300 * 48 + 5)
    blocks = Passes(Stage(gpu, scene), method)
    assert whole.modules.count("sam/neighbour_mixture") == 1
    assert blocks.modules.count("sam/neighbour_mixture") == blocks.modules.count("sam/gather") == 2
    np.testing.assert_array_equal(blocks.mixed, whole.mixed)
