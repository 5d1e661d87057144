"""Maps that follow a mesh that deforms, against closed forms, sums and maps that are baked anew."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from maps import FRONT, MARBLE, PLAIN, SIDE, light_at_vertices, random_sender_map, rms, use_sender_map
from scenes import lit

from wgsss import frame as shared
from wgsss.bake.sam import SenderMap
from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.form_factors import form_factors as integrated
from wgsss.bake.sam.sender_tree import sender_tree
from wgsss.bake.samples import Samples
from wgsss.errors import InputError
from wgsss.gpu import LIMITS
from wgsss.graph import Graph
from wgsss.methods.sam import method as sam
from wgsss.methods.sam.deform import places_at_rest
from wgsss.scene import MATERIALS, EnvironmentLight, Mesh, Object, load_scene
from wgsss.scene.shapes import ear, slab, sphere
from wgsss.stage import Stage


@dataclass(frozen=True)
class Moved:
    """Positions as a function of time."""

    apply: object
    period_s: float = 1.0


def moving(mesh, apply, material=MARBLE, light=SIDE):
    scene = lit(light, camera=FRONT)
    return replace(scene, objects=(Object(mesh, material, motion=Moved(apply)),))


class Followed:
    """The entries of the one object of a stage at a time."""

    def __init__(self, stage, time_s, method=PLAIN):
        stage.pose(time_s)
        graph = Graph(stage.gpu)
        body = stage.bodies[0]
        M_back = method.at_vertices(shared.begin(graph, stage, (8, 8)), body, method.plan(body))
        self.mesh = body.mesh
        passes = {p.module.name: p.reads for p in graph.passes}
        read = passes.get("sam/sum") or {**passes["sam/update"], **passes["sam/gather"]}
        wanted = {name: read[name] for name in ("irradiance", "places", "entries") if name in read}
        graph.run(M_back, *wanted.values())
        got = {name: graph.read(handle) for name, handle in wanted.items()}
        M, self.places = graph.read(M_back), got["places"]
        self.M, self.irradiance = M[:, :3], got["irradiance"][:, :3]
        if "entries" in got:
            entries = got["entries"]
            self.sender = entries["sender"].reshape(len(M), -1)
            self.weight = entries["weight"].reshape(*self.sender.shape, 3).astype(float)


EVEN = EnvironmentLight((1, 2, 3))


def turn(x, time_s):
    c, s = np.cos(time_s), np.sin(time_s)
    return x @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + (30 * time_s, -20 * time_s, 5)


def swollen(x, time_s):
    return x * (1.0 + time_s)


def twisted(x, time_s):
    c, s = np.cos(0.1 * time_s * x[:, 1]), np.sin(0.1 * time_s * x[:, 1])
    return np.stack([c * x[:, 0] - s * x[:, 2], x[:, 1], s * x[:, 0] + c * x[:, 2] * (1 + time_s)], axis=1)


def test_rigid_motion_changes_nothing(gpu):
    stage = Stage(gpu, moving(sphere(6.0, 400), turn))
    baked = PLAIN.map(stage.bodies[0])
    for time_s in (0.0, 0.4, 0.9):
        found = Followed(stage, time_s)
        np.testing.assert_array_equal(found.sender, baked.sender)
        np.testing.assert_allclose(found.weight, baked.weight, rtol=2e-4, atol=1e-9)


def test_uniform_growth_scales_areas_and_distances(gpu):
    """K = F R(d) times what it was more at rest: F grows with the square of the size, d with the size."""
    mesh, profile = sphere(6.0, 400), MARBLE.profile
    stage = Stage(gpu, moving(mesh, swollen))
    baked = PLAIN.map(stage.bodies[0])
    d = np.linalg.norm(mesh.positions[baked.sender] - mesh.positions[:, None], axis=2)
    for size in (1.25, 0.8):
        found = Followed(stage, size - 1.0)
        same = found.sender == baked.sender  # others are better now: what is near counts for more as all grows
        assert same.mean() > 0.9
        grown = size**2 * profile.reflectance(size * d) / profile.reflectance(d)
        np.testing.assert_allclose(found.weight[same], (baked.weight * grown)[same], rtol=2e-3)


def test_places_of_nodes_and_areas_of_fans(gpu, monkeypatch):
    mesh = slab((12, 12, 2), 700)
    entries = random_sender_map(mesh)
    use_sender_map(monkeypatch, lambda mesh: entries)
    found = Followed(Stage(gpu, moving(mesh, twisted)), 0.5)
    x = found.mesh.positions.astype(float)
    area = np.zeros(len(x))
    for a, b, c in mesh.faces:
        area[[a, b, c]] += np.linalg.norm(np.cross(x[b] - x[a], x[c] - x[a])) / 6
    V, over = len(x), entries.tree
    np.testing.assert_allclose(found.places["area"][:V], area, rtol=1e-5)
    np.testing.assert_allclose(found.places["position"][:V], x, atol=1e-5)
    for k in range(len(over.first)):
        under = over.order[over.first[k] : over.first[k] + over.count[k]]
        middle = np.average(x[under], axis=0, weights=area[under])
        variance = np.average(np.square(x[under] - middle).sum(axis=1), weights=area[under])
        node = found.places[V + k]
        np.testing.assert_allclose(node["position"], middle, atol=1e-5)
        normal = np.average(found.mesh.normals[under], axis=0, weights=area[under])
        np.testing.assert_allclose(node["normal"], normal, atol=1e-5)
        assert node["area"] == pytest.approx(area[under].sum(), rel=1e-5)
        assert node["variance"] == pytest.approx(variance, rel=1e-4, abs=1e-5)
        mean = np.average(found.irradiance[under], axis=0, weights=area[under])
        np.testing.assert_allclose(found.irradiance[V + k], mean, rtol=1e-4, atol=1e-6)


def test_places_at_rest_are_those_of_a_mesh_that_does_not_move(gpu, monkeypatch):
    mesh = slab((12, 12, 2), 700)
    for entries in (random_sender_map(mesh), on_faces(mesh)):
        use_sender_map(monkeypatch, lambda mesh, entries=entries: entries)
        found = Followed(Stage(gpu, moving(mesh, lambda x, time_s: x)), 0.5).places
        for name, values in places_at_rest(mesh, entries).items():
            np.testing.assert_allclose(found[name], values, rtol=1e-5, atol=2e-5)


def on_faces(mesh, count=50):
    """A map whose senders are samples on faces."""
    random = np.random.default_rng(5)
    V = len(mesh.positions)
    face = random.integers(0, len(mesh.faces), count).astype(np.int32)
    samples = Samples(face, random.dirichlet((1, 1, 1), count), np.ones(count))
    sender = random.integers(-1, count, (V, 3)).astype(np.int32)
    return SenderMap(
        sender, (random.random((V, 3, 3)) * (sender >= 0)[..., None]).astype(np.float32), count, samples, None
    )


def test_senders_that_are_no_vertices_follow_their_faces(gpu, monkeypatch):
    mesh, size, profile = sphere(6.0, 400), 1.2, MARBLE.profile
    entries = on_faces(mesh)
    use_sender_map(monkeypatch, lambda mesh: entries)
    for size in (1.0, 1.2):
        found = Followed(Stage(gpu, moving(mesh, swollen)), size - 1.0)
        s = entries.sender_samples
        x = np.einsum("nk,nkd->nd", s.barycentric, mesh.positions[mesh.faces[s.face]].astype(float))
        n = np.einsum("nk,nkd->nd", s.barycentric, mesh.normals[mesh.faces[s.face]].astype(float))
        between = x[entries.sender] - mesh.positions[:, None]
        d = np.linalg.norm(between, axis=2)
        height, facing = (np.einsum("vnd,vd->vn", v, mesh.normals) for v in (between, n[entries.sender]))
        back = (height < 0) & (facing < 0)
        clear = (np.abs(height) > 1e-3) & (np.abs(facing) > 1e-3)
        same = clear & (found.sender == entries.sender)  # others have found what is better, or is behind at all
        assert (same & back).sum() > 80
        grown = size**2 * profile.reflectance(size * d) / profile.reflectance(d) * back[..., None]
        np.testing.assert_allclose(found.weight[same], (entries.weight * grown)[same], rtol=2e-3, atol=1e-9)
        expected = np.einsum("vnc,vnc->vc", found.weight, found.irradiance[found.sender])
        np.testing.assert_allclose(found.M, expected, rtol=1e-4, atol=1e-9)


def test_weights_stay_finite_where_the_profile_vanishes(gpu, monkeypatch):
    """R_d of blue light in skin is 1e-40 and less across the ball at rest, and some at the end."""
    mesh, skin = sphere(50.0, 200), MATERIALS["skin1"]
    far = np.argmin(mesh.positions @ mesh.positions.T, axis=1).astype(np.int32)[:, None]
    d = np.linalg.norm(mesh.positions - mesh.positions[far[:, 0]], axis=1)
    K = skin.profile.reflectance(d)[:, None].astype(np.float32)
    use_sender_map(monkeypatch, lambda mesh: SenderMap(far, K, len(far), None, None))
    stage = Stage(gpu, moving(mesh, lambda x, time_s: x * (1, 1, 1 - time_s), skin))
    for time_s in (0.0, 0.5, 0.99):
        found = Followed(stage, time_s)
        assert np.isfinite(found.weight).all() and np.isfinite(found.M).all()
        assert found.weight.max() < 1.0


def sheared(x, time_s):
    return np.stack([x[:, 0] + 2.0 * np.sin(np.pi * time_s) * x[:, 2], x[:, 1], x[:, 2]], axis=1)


def test_senders_give_way_to_better_neighbours_and_come_back(gpu):
    """A plate of 2 mm whose sides slide past each other by 4 mm: what is behind a vertex is soon another part."""
    mesh, profile = slab((12, 12, 2), 700), MARBLE.profile
    stage = Stage(gpu, moving(mesh, sheared))
    baked = PLAIN.map(stage.bodies[0])
    followed = [Followed(stage, time_s) for time_s in np.linspace(0.0, 1.0, 17)]
    np.testing.assert_array_equal(followed[0].sender, baked.sender)
    np.testing.assert_array_equal(followed[-1].sender, baked.sender)

    half = followed[8]
    anew = sam.spatial_adjacency_map(gpu, half.mesh, profile, PLAIN.samples, PLAIN.select)
    inner = (np.abs(mesh.positions[:, :2]).max(axis=1) < 3.5) & (np.abs(mesh.positions[:, 2]) > 0.9)
    best = anew.weight[inner].sum()
    fixed = np.linalg.norm(half.mesh.positions[baked.sender] - half.mesh.positions[:, None], axis=2)
    assert (fan_areas(half.mesh)[baked.sender, None] * profile.reflectance(fixed))[inner].sum() < 0.4 * best
    assert 0.92 * best < half.weight[inner].sum() < 1.001 * best
    assert all(len(set(own[own >= 0])) == (own >= 0).sum() for own in half.sender), "no sender twice"


def test_frames_that_go_back_in_time_start_from_the_senders_at_rest(gpu):
    scene = moving(slab((12, 12, 2), 700), sheared)
    stage = Stage(gpu, scene)
    for time_s in (0.0, 0.25, 0.5):
        Followed(stage, time_s)
    back, alone = Followed(stage, 0.2), Followed(Stage(gpu, scene), 0.2)
    np.testing.assert_array_equal(back.sender, alone.sender)
    np.testing.assert_array_equal(back.M, alone.M)


def test_senders_stay_behind(gpu):
    """In the hollows of an ear, some of what is turned away is in front."""
    found = Followed(Stage(gpu, moving(ear(500), lambda x, time_s: twisted(x, 0.3 * time_s))), 1.0)
    x, n = found.mesh.positions.astype(float), found.mesh.normals.astype(float)
    between = x[found.sender] - x[:, None]
    sine = np.einsum("vnd,vd->vn", between, n) / np.linalg.norm(between, axis=2)
    cosine = np.einsum("vnd,vd->vn", n[found.sender], n)
    sends = (found.weight > 0).any(axis=2)
    assert 0.5 < sends.mean()
    assert sine[sends].max() < 2e-4 and cosine[sends].max() < 2e-4
    assert not sends.all(), "some have lost what was behind them"


def test_objects_that_deform_keep_their_own_maps(gpu):
    objects = [moving(mesh, swollen).objects[0] for mesh in (sphere(4.0, 200), slab((9, 9, 2), 300))]
    scene = lit(SIDE, camera=FRONT)
    apart = [replace(o, translate=(x, 0, 0)) for o, x in zip(objects, (-300, 300), strict=True)]

    def M_back(*objects):
        stage = Stage(gpu, replace(scene, objects=objects))
        stage.pose(0.2)
        graph = Graph(gpu)
        frame = shared.begin(graph, stage, (8, 8))
        M = [PLAIN.at_vertices(frame, body, PLAIN.plan(body)) for body in stage.bodies]
        graph.run(*M)
        return [graph.read(of_body) for of_body in M]

    for got, o in zip(M_back(*apart), apart, strict=True):
        (alone,) = M_back(o)
        assert rms(got - alone) < 0.05 * rms(alone[:, :3])


def psnr(M, reference):
    return 20.0 * np.log10(reference.max() / rms(M - reference))


def form_factors(mesh, profile):
    """(V, V, 3): F R(d) from all vertices on the back side of each (eq. 13, 14)."""
    x, n = mesh.positions.astype(float), mesh.normals.astype(float)
    between = x[None] - x[:, None]
    behind = (np.einsum("oid,od->oi", between, n) < 0) & (n @ n.T < 0)
    return fan_areas(mesh)[:, None] * profile.reflectance(np.linalg.norm(between, axis=2)) * behind[..., None]


@pytest.mark.parametrize("apply", [turn, swollen, twisted])
def test_maps_of_nodes_sum_all_that_is_behind(gpu, monkeypatch, apply):
    """Whatever entries there are. In even light, that is the sum of all form factors; at rest the scale makes up for
    what nodes on both sides of a horizon are off by."""
    use_sender_map(monkeypatch, random_sender_map)
    for light, time_s, most in ((SIDE, 0.0, 0.045), (SIDE, 0.4, 0.045), (EVEN, 0.0, 0.01), (EVEN, 0.4, 0.025)):
        found = Followed(Stage(gpu, moving(sphere(6.0, 400), apply, light=light)), time_s)
        K = form_factors(found.mesh, MARBLE.profile)
        expected = np.einsum("oic,ic->oc", K, found.irradiance[: len(found.M)])
        assert rms(found.M - expected) < most * rms(expected)
        assert np.abs(found.M.mean(axis=0) / expected.mean(axis=0) - 1.0).max() < 0.01


def test_what_is_summed_wants_no_senders_chosen(gpu, monkeypatch):
    monkeypatch.setattr(sam, "spatial_adjacency_map", lambda *_: pytest.fail("senders were chosen"))
    method = replace(PLAIN, select="fit")
    thick = Stage(gpu, moving(sphere(60.0, 400), turn))
    assert method.plan(thick.bodies[0]) is None, "nothing shines through"
    assert Followed(Stage(gpu, moving(sphere(6.0, 400), turn)), 0.4, method).M.min() > 0.0


def test_the_sum_is_blended_with_that_of_the_frame_before(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    scene = moving(sphere(6.0, 400), twisted)
    stage = Stage(gpu, scene)
    before, now = (Followed(stage, time_s).M for time_s in (0.3, 0.33))
    alone = Followed(Stage(gpu, scene), 0.33).M
    np.testing.assert_allclose(now, 0.5 * before + 0.5 * alone, rtol=5e-3)  # 30 ms are half of what is left of it
    assert rms(before - alone) > 0.02 * rms(alone)


def test_fans_that_nearly_touch_are_integrated_at_rest(gpu, monkeypatch):
    """A disc of 0.3 mm, whose fans are 0.7 mm wide: there areas times R_d are too much. How much stays as it bends."""
    ball, profile = sphere(6.0, 500), MARBLE.profile
    mesh = Mesh(ball.positions * (1.0, 1.0, 0.025), ball.faces)
    use_sender_map(monkeypatch, lambda mesh: replace(random_sender_map(mesh), tree=sender_tree(mesh, 3.0).tree))
    stage = Stage(gpu, moving(mesh, twisted))
    for time_s in (0.0, 0.2):
        found = Followed(stage, time_s)
        taken = form_factors(found.mesh, profile)
        o, i = np.nonzero(taken.any(axis=2))
        K = np.zeros_like(taken)
        K[o, i] = integrated(gpu, found.mesh, profile, np.stack([o, i], axis=1))
        light = found.irradiance[: len(found.M)]
        expected, without = (np.einsum("oic,ic->oc", each, light) for each in (K, taken))
        assert rms(found.M - expected) < 0.035 * rms(expected) < 0.5 * rms(without - expected)


@pytest.mark.parametrize(
    ("select", "samples", "most"), [("top", 3, 0.1), ("coarse", 3, 1.5), ("fit", 3, 1.5), ("fit", 8, 1.5)]
)
def test_a_map_that_follows_the_wave_is_nearly_as_good_as_one_baked_anew(gpu, monkeypatch, select, samples, most):
    """Against the sum over all vertices behind, over two seconds: half a period, at vertices and in pixels."""
    monkeypatch.setattr(sam, "KEPT_A_SECOND", 0.0)
    method, scene = replace(PLAIN, select=select, samples=samples), load_scene("wave", vertices=600)
    stage, profile = Stage(gpu, scene), scene.objects[0].material.profile
    lost = []
    for frame in range(0, 21, 5 if select == "fit" else 1):  # senders move from frame to frame
        found = Followed(stage, frame / 10, method)
        if frame % 5:
            continue
        still = Stage(gpu, scene.at(frame / 10))
        everything = np.einsum("oic,ic->oc", form_factors(found.mesh, profile), light_at_vertices(still))
        graph, body = Graph(gpu), still.bodies[0]
        anew = method.at_vertices(shared.begin(graph, still, (8, 8)), body, method.plan(body))
        graph.run(anew)
        whole, *both = (seen(still, M) for M in (everything, graph.read(anew)[:, :3], found.M))
        lost.append([np.subtract(*(psnr(M[part], whole[part]) for M in both)) for part in ("vertices", "pixels")])
    print(select, samples, np.round(lost, 2).tolist())
    assert np.max(lost) < most


def seen(stage, M):
    """M_back at the vertices of the one object, and in the pixels that show it."""
    graph, body = Graph(stage.gpu), stage.bodies[0]
    frame = shared.begin(graph, stage, (128, 128))
    drawn = graph.draw(
        "sam/show",
        size=frame.size,
        indices=body.indices,
        params={"world_to_clip": frame.view.world_to_clip},
        object=body.object_uniforms,
        vertices=body.vertices,
        M_back_at=stage.gpu.buffer(np.column_stack([M, np.ones(len(M))]).astype(np.float32)),
        **frame.gbuffer_bindings("gbuffer_id", "base_color", "depth"),
    )
    graph.run(drawn)
    image = graph.read(drawn)
    return {"vertices": M, "pixels": image[image.any(axis=2)][:, :3]}


def test_topology_that_changes_is_an_error_that_names_the_frame(gpu):
    stage = Stage(gpu, moving(sphere(6.0, 100), lambda x, time_s: x if time_s < 0.5 else x[:-1]))
    stage.pose(0.4)
    with pytest.raises(InputError, match=r"a deformation must keep 92 positions, 0\.6 s into its motion"):
        stage.pose(0.6)


@pytest.mark.parametrize("moves", [False, True], ids=["still", "moving"])
def test_a_map_too_large_for_a_binding_is_read_in_parts(gpu, monkeypatch, moves):
    mesh = slab((12, 12, 2), 700)
    scene = moving(mesh, twisted) if moves else lit(SIDE, mesh=mesh, material=MARBLE, camera=FRONT)

    def M_back():
        stage = Stage(gpu, scene)
        stage.pose(0.5)
        graph = Graph(gpu)
        body = stage.bodies[0]
        M = PLAIN.at_vertices(shared.begin(graph, stage, (8, 8)), body, PLAIN.plan(body))
        graph.run(M)
        return graph.read(M), len([p for p in graph.ran if p.module.name == "sam/gather"])

    whole, parts = M_back()
    monkeypatch.setitem(LIMITS, "max-storage-buffer-binding-size", 300 * 3 * 16 + 5)
    got, more = M_back()
    assert (parts, more) == (1, 3)
    np.testing.assert_array_equal(got, whole)
    assert whole[:, :3].any()
