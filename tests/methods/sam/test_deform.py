"""Sender maps of meshes that deform, against closed forms, sums over all senders and maps baked for the pose."""

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
from wgsss.methods.sam.rest_state import clusters_at_rest
from wgsss.scene import MATERIALS, EnvironmentLight, Mesh, Object, load_scene
from wgsss.scene.shapes import ear, slab, sphere
from wgsss.stage import Stage


@dataclass(frozen=True)
class Deformation:
    """A motion whose `apply` gives positions (V, 3), mm, from those at rest and a time in seconds."""

    apply: object
    period_s: float = 1.0


def moving(mesh, apply, material=MARBLE, light=SIDE):
    """Return a scene with one object that deforms."""
    scene = lit(light, camera=FRONT)
    return replace(scene, objects=(Object(mesh, material, motion=Deformation(apply)),))


class Pose:
    """What the passes of a frame compute for the only object of a stage.

    Attributes:
        mesh: the mesh as posed.
        M: (V, 3), W/m^2, M_back at the vertices.
        irradiance: (N, 3), W/m^2, of the map's points and nodes.
        clusters: those of the map's points and nodes, by field.
        sender, weight: (V, n) and (V, n, 3), the entries, if the map has no tree.
    """

    def __init__(self, stage, time_s, method=PLAIN):
        stage.pose(time_s)
        graph = Graph(stage.gpu)
        body = stage.bodies[0]
        M_back = method.M_back_at_vertices(shared.begin(graph, stage, (8, 8)), body, method.gpu_map(body))
        self.mesh = body.mesh
        passes = {p.module.name: p.reads for p in graph.passes}
        inputs = passes.get("sam/barnes_hut") or {**passes["sam/update_form_factors"], **passes["sam/gather"]}
        handles = {name: inputs[name] for name in ("irradiance", "clusters", "entries") if name in inputs}
        graph.run(M_back, *handles.values())
        buffers = {name: graph.read(handle) for name, handle in handles.items()}
        M, self.clusters = graph.read(M_back), buffers["clusters"]
        self.M, self.irradiance = M[:, :3], buffers["irradiance"][:, :3]
        if "entries" in buffers:
            entries = buffers["entries"]
            self.sender = entries["sender"].reshape(len(M), -1)
            self.weight = entries["weight"].reshape(*self.sender.shape, 3).astype(float)


EVEN = EnvironmentLight((1, 2, 3))


def turned(x, time_s):
    """Turn about z by 1 rad/s and move, as a rigid body."""
    c, s = np.cos(time_s), np.sin(time_s)
    return x @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + (30 * time_s, -20 * time_s, 5)


def grown(x, time_s):
    """Scale by 1 + time."""
    return x * (1.0 + time_s)


def twisted(x, time_s):
    """Twist about y and stretch along z."""
    c, s = np.cos(0.1 * time_s * x[:, 1]), np.sin(0.1 * time_s * x[:, 1])
    return np.stack([c * x[:, 0] - s * x[:, 2], x[:, 1], s * x[:, 0] + c * x[:, 2] * (1 + time_s)], axis=1)


def test_rigid_motion_changes_no_entry(gpu):
    stage = Stage(gpu, moving(sphere(6.0, 400), turned))
    baked = PLAIN.sender_map(stage.bodies[0])
    for time_s in (0.0, 0.4, 0.9):
        pose = Pose(stage, time_s)
        np.testing.assert_array_equal(pose.sender, baked.sender)
        np.testing.assert_allclose(pose.weight, baked.weight, rtol=2e-4, atol=1e-9)


def test_uniform_growth_scales_areas_and_distances(gpu):
    """A form factor grows by the ratio of the areas times the ratio of R_d at the two distances."""
    mesh, profile = sphere(6.0, 400), MARBLE.profile
    stage = Stage(gpu, moving(mesh, grown))
    baked = PLAIN.sender_map(stage.bodies[0])
    d = np.linalg.norm(mesh.positions[baked.sender] - mesh.positions[:, None], axis=2)
    for size in (1.25, 0.8):
        pose = Pose(stage, size - 1.0)
        same = pose.sender == baked.sender  # entries may have moved to nearer senders
        assert same.mean() > 0.9
        ratio = size**2 * profile.reflectance(size * d) / profile.reflectance(d)
        np.testing.assert_allclose(pose.weight[same], (baked.weight * ratio)[same], rtol=2e-3)


def test_clusters_of_nodes_are_means_and_areas_of_fans_sum_faces(gpu, monkeypatch):
    mesh = slab((12, 12, 2), 700)
    sender_map = random_sender_map(mesh)
    use_sender_map(monkeypatch, lambda mesh: sender_map)
    pose = Pose(Stage(gpu, moving(mesh, twisted)), 0.5)
    x = pose.mesh.positions.astype(float)
    area = np.zeros(len(x))
    for a, b, c in mesh.faces:
        area[[a, b, c]] += np.linalg.norm(np.cross(x[b] - x[a], x[c] - x[a])) / 6
    V, tree = len(x), sender_map.tree
    np.testing.assert_allclose(pose.clusters["area"][:V], area, rtol=1e-5)
    np.testing.assert_allclose(pose.clusters["position"][:V], x, atol=1e-5)
    for k in range(len(tree.first)):
        below = tree.order[tree.first[k] : tree.first[k] + tree.count[k]]
        centre = np.average(x[below], axis=0, weights=area[below])
        variance = np.average(np.square(x[below] - centre).sum(axis=1), weights=area[below])
        node = pose.clusters[V + k]
        np.testing.assert_allclose(node["position"], centre, atol=1e-5)
        normal = np.average(pose.mesh.normals[below], axis=0, weights=area[below])
        np.testing.assert_allclose(node["normal"], normal, atol=1e-5)
        assert node["area"] == pytest.approx(area[below].sum(), rel=1e-5)
        assert node["variance"] == pytest.approx(variance, rel=1e-4, abs=1e-5)
        mean = np.average(pose.irradiance[below], axis=0, weights=area[below])
        np.testing.assert_allclose(pose.irradiance[V + k], mean, rtol=1e-4, atol=1e-6)


def test_clusters_at_rest_equal_those_of_a_pose_that_changes_nothing(gpu, monkeypatch):
    mesh = slab((12, 12, 2), 700)
    for sender_map in (random_sender_map(mesh), face_sender_map(mesh)):
        use_sender_map(monkeypatch, lambda mesh, sender_map=sender_map: sender_map)
        posed = Pose(Stage(gpu, moving(mesh, lambda x, time_s: x)), 0.5).clusters
        for name, values in clusters_at_rest(mesh, sender_map).items():
            np.testing.assert_allclose(posed[name], values, rtol=1e-5, atol=2e-5)


def face_sender_map(mesh, count=50):
    """Return a map with random entries whose senders are samples on faces."""
    random = np.random.default_rng(5)
    V = len(mesh.positions)
    face = random.integers(0, len(mesh.faces), count).astype(np.int32)
    samples = Samples(face, random.dirichlet((1, 1, 1), count), np.ones(count))
    sender = random.integers(-1, count, (V, 3)).astype(np.int32)
    return SenderMap(
        sender, (random.random((V, 3, 3)) * (sender >= 0)[..., None]).astype(np.float32), count, samples, None
    )


def test_senders_on_faces_follow_the_faces(gpu, monkeypatch):
    mesh, size, profile = sphere(6.0, 400), 1.2, MARBLE.profile
    sender_map = face_sender_map(mesh)
    use_sender_map(monkeypatch, lambda mesh: sender_map)
    for size in (1.0, 1.2):
        pose = Pose(Stage(gpu, moving(mesh, grown)), size - 1.0)
        s = sender_map.sender_samples
        x = np.einsum("nk,nkd->nd", s.barycentric, mesh.positions[mesh.faces[s.face]].astype(float))
        n = np.einsum("nk,nkd->nd", s.barycentric, mesh.normals[mesh.faces[s.face]].astype(float))
        between = x[sender_map.sender] - mesh.positions[:, None]
        d = np.linalg.norm(between, axis=2)
        height, facing = (np.einsum("vnd,vd->vn", v, mesh.normals) for v in (between, n[sender_map.sender]))
        back = (height < 0) & (facing < 0)
        clear = (np.abs(height) > 1e-3) & (np.abs(facing) > 1e-3)
        same = clear & (pose.sender == sender_map.sender)  # other entries have moved
        assert (same & back).sum() > 80
        ratio = size**2 * profile.reflectance(size * d) / profile.reflectance(d) * back[..., None]
        np.testing.assert_allclose(pose.weight[same], (sender_map.weight * ratio)[same], rtol=2e-3, atol=1e-9)
        expected = np.einsum("vnc,vnc->vc", pose.weight, pose.irradiance[pose.sender])
        np.testing.assert_allclose(pose.M, expected, rtol=1e-4, atol=1e-9)


def test_weights_stay_finite_where_the_profile_vanishes(gpu, monkeypatch):
    """R_d of blue light in skin across the ball is below 1e-40 per mm^2 at rest, and larger when the ball is flat."""
    mesh, skin = sphere(50.0, 200), MATERIALS["skin1"]
    far = np.argmin(mesh.positions @ mesh.positions.T, axis=1).astype(np.int32)[:, None]
    d = np.linalg.norm(mesh.positions - mesh.positions[far[:, 0]], axis=1)
    K = skin.profile.reflectance(d)[:, None].astype(np.float32)
    use_sender_map(monkeypatch, lambda mesh: SenderMap(far, K, len(far), None, None))
    stage = Stage(gpu, moving(mesh, lambda x, time_s: x * (1, 1, 1 - time_s), skin))
    for time_s in (0.0, 0.5, 0.99):
        pose = Pose(stage, time_s)
        assert np.isfinite(pose.weight).all() and np.isfinite(pose.M).all()
        assert pose.weight.max() < 1.0


def sheared(x, time_s):
    """Slide the two sides of a plate past each other and back within one second."""
    return np.stack([x[:, 0] + 2.0 * np.sin(np.pi * time_s) * x[:, 2], x[:, 1], x[:, 2]], axis=1)


def test_entries_move_to_better_neighbours_and_return_to_the_senders_at_rest(gpu):
    """The two sides of a plate of 2 mm slide past each other by 4 mm, so other vertices come to lie behind a vertex."""
    mesh, profile = slab((12, 12, 2), 700), MARBLE.profile
    stage = Stage(gpu, moving(mesh, sheared))
    baked = PLAIN.sender_map(stage.bodies[0])
    poses = [Pose(stage, time_s) for time_s in np.linspace(0.0, 1.0, 17)]
    np.testing.assert_array_equal(poses[0].sender, baked.sender)
    np.testing.assert_array_equal(poses[-1].sender, baked.sender)

    half = poses[8]
    rebaked = sam.spatial_adjacency_map(gpu, half.mesh, profile, PLAIN.samples, PLAIN.select)
    inner = (np.abs(mesh.positions[:, :2]).max(axis=1) < 3.5) & (np.abs(mesh.positions[:, 2]) > 0.9)
    best = rebaked.weight[inner].sum()
    fixed = np.linalg.norm(half.mesh.positions[baked.sender] - half.mesh.positions[:, None], axis=2)
    assert (fan_areas(half.mesh)[baked.sender, None] * profile.reflectance(fixed))[inner].sum() < 0.4 * best
    assert 0.92 * best < half.weight[inner].sum() < 1.001 * best
    assert all(len(set(own[own >= 0])) == (own >= 0).sum() for own in half.sender), "no sender twice"


def test_a_frame_earlier_than_the_last_starts_from_the_senders_at_rest(gpu):
    scene = moving(slab((12, 12, 2), 700), sheared)
    stage = Stage(gpu, scene)
    for time_s in (0.0, 0.25, 0.5):
        Pose(stage, time_s)
    back, alone = Pose(stage, 0.2), Pose(Stage(gpu, scene), 0.2)
    np.testing.assert_array_equal(back.sender, alone.sender)
    np.testing.assert_array_equal(back.M, alone.M)


def test_senders_stay_on_the_back_side(gpu):
    """In the hollows of an ear, some vertices whose normals point away are in front of the tangent plane."""
    pose = Pose(Stage(gpu, moving(ear(500), lambda x, time_s: twisted(x, 0.3 * time_s))), 1.0)
    x, n = pose.mesh.positions.astype(float), pose.mesh.normals.astype(float)
    between = x[pose.sender] - x[:, None]
    sine = np.einsum("vnd,vd->vn", between, n) / np.linalg.norm(between, axis=2)
    cosine = np.einsum("vnd,vd->vn", n[pose.sender], n)
    sends = (pose.weight > 0).any(axis=2)
    assert 0.5 < sends.mean()
    assert sine[sends].max() < 2e-4 and cosine[sends].max() < 2e-4
    assert not sends.all(), "some senders at rest are no longer on the back side"


def test_objects_that_deform_keep_their_own_maps(gpu):
    objects = [moving(mesh, grown).objects[0] for mesh in (sphere(4.0, 200), slab((9, 9, 2), 300))]
    scene = lit(SIDE, camera=FRONT)
    apart = [replace(o, translate=(x, 0, 0)) for o, x in zip(objects, (-300, 300), strict=True)]

    def M_back(*objects):
        stage = Stage(gpu, replace(scene, objects=objects))
        stage.pose(0.2)
        graph = Graph(gpu)
        frame = shared.begin(graph, stage, (8, 8))
        M = [PLAIN.M_back_at_vertices(frame, body, PLAIN.gpu_map(body)) for body in stage.bodies]
        graph.run(*M)
        return [graph.read(of_body) for of_body in M]

    for got, o in zip(M_back(*apart), apart, strict=True):
        (alone,) = M_back(o)
        assert rms(got - alone) < 0.05 * rms(alone[:, :3])


def psnr(M, reference):
    """Return the peak signal-to-noise ratio in dB."""
    return 20.0 * np.log10(reference.max() / rms(M - reference))


def form_factors(mesh, profile):
    """Return area times R_d (V, V, 3) from each vertex i, second index, to each vertex o; 0 unless i is on the back
    side of o (Maisch & Ropinski 2017, eq. 13, 14)."""
    x, n = mesh.positions.astype(float), mesh.normals.astype(float)
    between = x[None] - x[:, None]
    behind = (np.einsum("oid,od->oi", between, n) < 0) & (n @ n.T < 0)
    return fan_areas(mesh)[:, None] * profile.reflectance(np.linalg.norm(between, axis=2)) * behind[..., None]


@pytest.mark.parametrize("apply", [turned, grown, twisted])
def test_the_sum_over_a_tree_is_close_to_that_over_all_vertices_behind(gpu, monkeypatch, apply):
    """The entries of the map do not matter. Even light gives the sums of form factors, which are exact at rest, where
    the scale corrects for nodes that lie on both sides of a horizon."""
    use_sender_map(monkeypatch, random_sender_map)
    for light, time_s, most in ((SIDE, 0.0, 0.045), (SIDE, 0.4, 0.045), (EVEN, 0.0, 0.01), (EVEN, 0.4, 0.025)):
        pose = Pose(Stage(gpu, moving(sphere(6.0, 400), apply, light=light)), time_s)
        K = form_factors(pose.mesh, MARBLE.profile)
        expected = np.einsum("oic,ic->oc", K, pose.irradiance[: len(pose.M)])
        assert rms(pose.M - expected) < most * rms(expected)
        assert np.abs(pose.M.mean(axis=0) / expected.mean(axis=0) - 1.0).max() < 0.01


def test_no_senders_are_chosen_for_a_mesh_that_deforms(gpu, monkeypatch):
    monkeypatch.setattr(sam, "spatial_adjacency_map", lambda *_: pytest.fail("senders were chosen"))
    method = replace(PLAIN, select="fit")
    thick = Stage(gpu, moving(sphere(60.0, 400), turned))
    assert method.gpu_map(thick.bodies[0]) is None, "nothing shines through"
    assert Pose(Stage(gpu, moving(sphere(6.0, 400), turned)), 0.4, method).M.min() > 0.0


def test_the_sum_is_blended_with_that_of_the_last_frame(gpu, monkeypatch):
    use_sender_map(monkeypatch, random_sender_map)
    scene = moving(sphere(6.0, 400), twisted)
    stage = Stage(gpu, scene)
    before, now = (Pose(stage, time_s).M for time_s in (0.3, 0.33))
    alone = Pose(Stage(gpu, scene), 0.33).M
    np.testing.assert_allclose(now, 0.5 * before + 0.5 * alone, rtol=5e-3)  # one half is left after 30 ms
    assert rms(before - alone) > 0.02 * rms(alone)


def test_fans_that_nearly_touch_are_integrated_at_rest(gpu, monkeypatch):
    """On a disc of 0.3 mm with fans 0.7 mm wide, area times R_d is too large. The ratio at rest holds as it bends."""
    ball, profile = sphere(6.0, 500), MARBLE.profile
    mesh = Mesh(ball.positions * (1.0, 1.0, 0.025), ball.faces)
    use_sender_map(monkeypatch, lambda mesh: replace(random_sender_map(mesh), tree=sender_tree(mesh, 3.0).tree))
    stage = Stage(gpu, moving(mesh, twisted))
    for time_s in (0.0, 0.2):
        pose = Pose(stage, time_s)
        approximate = form_factors(pose.mesh, profile)
        o, i = np.nonzero(approximate.any(axis=2))
        K = np.zeros_like(approximate)
        K[o, i] = integrated(gpu, pose.mesh, profile, np.stack([o, i], axis=1))
        light = pose.irradiance[: len(pose.M)]
        expected, uncorrected = (np.einsum("oic,ic->oc", each, light) for each in (K, approximate))
        assert rms(pose.M - expected) < 0.035 * rms(expected) < 0.5 * rms(uncorrected - expected)


@pytest.mark.parametrize(
    ("select", "samples", "most"), [("top", 3, 0.1), ("coarse", 3, 1.5), ("fit", 3, 1.5), ("fit", 8, 1.5)]
)
def test_a_map_follows_the_wave_nearly_as_accurately_as_one_baked_for_each_pose(
    gpu, monkeypatch, select, samples, most
):
    """The loss in PSNR against the sum over all vertices behind, over half a period, at vertices and in pixels."""
    monkeypatch.setattr(sam, "HISTORY_AFTER_1_S", 0.0)
    method, scene = replace(PLAIN, select=select, samples=samples), load_scene("wave", vertices=600)
    stage, profile = Stage(gpu, scene), scene.objects[0].material.profile
    losses = []
    for frame in range(0, 21, 5 if select == "fit" else 1):  # entries move from frame to frame
        pose = Pose(stage, frame / 10, method)
        if frame % 5:
            continue
        still = Stage(gpu, scene.at(frame / 10))
        exact = np.einsum("oic,ic->oc", form_factors(pose.mesh, profile), light_at_vertices(still))
        graph, body = Graph(gpu), still.bodies[0]
        rebaked = method.M_back_at_vertices(shared.begin(graph, still, (8, 8)), body, method.gpu_map(body))
        graph.run(rebaked)
        reference, *both = (vertices_and_pixels(still, M) for M in (exact, graph.read(rebaked)[:, :3], pose.M))
        losses.append([np.subtract(*(psnr(M[part], reference[part]) for M in both)) for part in ("vertices", "pixels")])
    print(select, samples, np.round(losses, 2).tolist())
    assert np.max(losses) < most


def vertices_and_pixels(stage, M):
    """Return M_back at the vertices of the only object, and in the pixels that show it."""
    graph, body = Graph(stage.gpu), stage.bodies[0]
    frame = shared.begin(graph, stage, (128, 128))
    drawn = graph.draw(
        "sam/show",
        size=frame.size,
        indices=body.indices,
        params={"world_to_clip": frame.view.world_to_clip},
        object=body.object_uniforms,
        vertices=body.vertices,
        vertex_M_back=stage.gpu.buffer(np.column_stack([M, np.ones(len(M))]).astype(np.float32)),
        **frame.gbuffer_bindings("gbuffer_id", "base_color", "depth"),
    )
    graph.run(drawn)
    image = graph.read(drawn)
    return {"vertices": M, "pixels": image[image.any(axis=2)][:, :3]}


def test_a_deformation_that_changes_the_vertex_count_is_an_error_with_the_time(gpu):
    stage = Stage(gpu, moving(sphere(6.0, 100), lambda x, time_s: x if time_s < 0.5 else x[:-1]))
    stage.pose(0.4)
    with pytest.raises(InputError, match=r"a deformation must keep 92 positions, 0\.6 s into its motion"):
        stage.pose(0.6)


@pytest.mark.parametrize("moves", [False, True], ids=["still", "moving"])
def test_a_map_too_large_for_a_binding_is_read_in_blocks(gpu, monkeypatch, moves):
    mesh = slab((12, 12, 2), 700)
    scene = moving(mesh, twisted) if moves else lit(SIDE, mesh=mesh, material=MARBLE, camera=FRONT)

    def M_back():
        stage = Stage(gpu, scene)
        stage.pose(0.5)
        graph = Graph(gpu)
        body = stage.bodies[0]
        M = PLAIN.M_back_at_vertices(shared.begin(graph, stage, (8, 8)), body, PLAIN.gpu_map(body))
        graph.run(M)
        return graph.read(M), len([p for p in graph.ran if p.module.name == "sam/gather"])

    whole, passes = M_back()
    monkeypatch.setitem(LIMITS, "max-storage-buffer-binding-size", 300 * 3 * 16 + 5)
    in_blocks, more_passes = M_back()
    assert (passes, more_passes) == (1, 3)
    np.testing.assert_array_equal(in_blocks, whole)
    assert whole[:, :3].any()
