"""The surface integral by brute force against closed forms, and after an interrupt or without convergence."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import ABOVE, MATTE, lit, plane
from scipy.integrate import quad, trapezoid
from scipy.ndimage import gaussian_filter

from wgsss.bake.samples import Samples
from wgsss.gpu import Gpu
from wgsss.optics import SKIN_GAUSSIANS, NormalizedDiffusion, Profile, SumOfGaussians
from wgsss.reference import convergence, surface_sum
from wgsss.reference import integral as reference
from wgsss.reference.convergence import Converged, irradiance_at, sum_at_spacing
from wgsss.reference.integral import Integral, at_vertices, integral
from wgsss.reference.kernel import BLUR, RADIUS, Kernel, make_kernel
from wgsss.registry import REFERENCES, make_method
from wgsss.rendering import Renderer
from wgsss.scene import (
    DirectionalLight,
    EnvironmentLight,
    Maps,
    Mesh,
    Object,
    OrthographicCamera,
    PointLight,
    Scene,
    material,
    shapes,
)
from wgsss.scene.motion import BendAndSwell
from wgsss.stage import Stage

WIDE = SumOfGaussians(np.array([1.0, 4.0]), np.array([[0.3, 0.2, 0.1], [0.4, 0.3, 0.2]]))
SOFT = replace(MATTE, gaussians=WIDE)
BURLEY = NormalizedDiffusion((0.8, 0.5, 0.3), (0.5, 0.3, 0.2))
SUN = DirectionalLight((0, -1, 0), (2.0, 2.0, 2.0))


class Bar:
    """Counts pairs like a progress bar, without output."""

    n = 0

    def update(self, n: int) -> None:
        self.n += n


def random_points(mesh: Mesh, count: int, seed: int = 0) -> Samples:
    """Return random points on a mesh."""
    rng = np.random.default_rng(seed)
    faces = rng.integers(0, len(mesh.faces), count).astype(np.int32)
    return Samples(faces, rng.dirichlet([1, 1, 1], count), np.zeros(count))


def rms(values: Any) -> Any:
    return np.sqrt(np.square(values).mean(axis=0))


def distances(kernel: Kernel) -> Any:
    """Return the distances of the rows of a kernel, mm."""
    bits = kernel.first + np.arange(len(kernel.table) // 2, dtype=np.uint32)
    return np.sqrt((bits << 15).view(np.float32).astype(float))


@pytest.mark.parametrize("profile", [WIDE, SKIN_GAUSSIANS, BURLEY, material("skin1").profile])
@pytest.mark.parametrize("spacing", [0.1, 1.0])
def test_a_kernel_conserves_the_total_reflectance(profile: Profile, spacing: float) -> None:
    """Over the plane, the analytic part matches a quadrature, and with the sampled part it gives the total."""
    kernel, radius = make_kernel(profile, spacing, 1e9), RADIUS * spacing
    for channel in range(3):

        def ring(r: float, channel: int = channel) -> float:
            return float(2 * np.pi * r * profile.reflectance(r)[channel] * (1 - (r / radius) ** 2) ** 3)

        near = quad(ring, 0, radius, limit=200, epsabs=1e-9)[0]
        assert kernel.near[channel] == pytest.approx(near, abs=3e-5 * profile.total[channel])
    r = distances(kernel)
    same, opposite = kernel.table[:, :3].astype(float).reshape(2, len(r), 3)
    beyond = np.pi * (same[0] * r[0] ** 2 + trapezoid(same, np.square(r), axis=0))
    np.testing.assert_allclose(kernel.near + beyond, profile.total, rtol=2e-4)
    np.testing.assert_allclose(opposite[:-1], profile.reflectance(r[:-1]), rtol=1e-5, atol=1e-12)
    np.testing.assert_array_equal(kernel.table[len(r) - 1 :: len(r)], 0)


def test_the_sampled_part_is_blurred_over_the_plane() -> None:
    """It matches a blurred image."""
    spacing, step = 1.0, 1 / 30
    x = np.arange(-240, 241) * step
    r = np.hypot(x, x[:, None])
    chi = np.maximum(1 - np.square(r / (RADIUS * spacing)), 0) ** 3
    image = SKIN_GAUSSIANS.reflectance(r)[..., 0] * (1 - chi)
    blurred = gaussian_filter(image, BLUR * spacing / step, truncate=8)[240, 240:]
    kernel = make_kernel(SKIN_GAUSSIANS, spacing, 1e9)
    found = np.interp(x[240:], distances(kernel), kernel.table[: len(kernel.table) // 2, 0])
    near = x[240:] < 4
    assert abs(blurred - image[240, 240:])[near].max() > 0.2 * image.max()
    np.testing.assert_allclose(found[near], blurred[near], rtol=0.01, atol=1e-4 * image.max())


def test_sums_are_those_of_maisch_and_ropinski_eq_5_13_and_14(gpu: Gpu) -> None:
    """There are 70,000 samples, more than the iterations of lavapipe's loops, in a box wider than the profile's
    range. The samples lie on a lattice, so that many lie in a receiver's tangent plane with a perpendicular
    normal. They do not count as back."""
    rng = np.random.default_rng(1)
    count, receivers = 70_000, 70
    box, axes = np.array([300, 30, 30]), np.concatenate([np.eye(3), -np.eye(3)])

    def points(count: int) -> surface_sum.Points:
        position = 0.1 * np.floor(box * rng.random((count, 3)))
        return surface_sum.Points(position.astype(np.float32), axes[rng.integers(0, 6, count)].astype(np.float32))

    samples, places = points(count), points(receivers)
    flux = rng.random((count, 3)).astype(np.float32)
    kernel = make_kernel(WIDE, 0.5, 1e3)
    squares = np.square(distances(kernel))
    assert kernel.reach < 12
    found = surface_sum.surface_sum(gpu, kernel, samples, flux, places, Bar())
    expected = np.zeros((2, receivers, 3))
    for i in range(receivers):
        d = samples.position.astype(float) - places.position[i]
        facing = samples.normal.astype(float) @ places.normal[i]
        square = np.square(d).sum(axis=1)
        same = [np.interp(square, squares, kernel.table[: len(squares), c]) for c in range(3)]
        M = np.where((facing >= 0)[:, None], np.stack(same, axis=1), WIDE.reflectance(np.sqrt(square))) * flux
        back = (d @ places.normal[i] < 0) & (facing < 0)
        expected[:, i] = M[~back].sum(axis=0), M[back].sum(axis=0)
    # Both omit light beyond the profile's range, 1e-5 of the total.
    np.testing.assert_allclose(found, expected, rtol=5e-5)
    again = surface_sum.surface_sum(gpu, kernel, samples, flux, places, Bar())
    np.testing.assert_array_equal(found, again)


def test_a_uniformly_lit_sphere(gpu: Gpu) -> None:
    """Chords of length r to r + dr cover the area 2 pi r dr. Normals are opposed from sqrt(2) a on. The sphere is
    moved and rotated."""
    a, at = 3.0, (30.0, -5.0, 2.0)
    ball = Object(shapes.sphere(a, vertices=1500), replace(SOFT, specular=1.0), translate=at, rotate=(20, 30, 40))
    camera = OrthographicCamera((at[0], at[1], 50), at, height=7)
    scene = replace(lit(EnvironmentLight((1.0, 0.5, 2.0)), camera=camera), objects=(ball,))
    stage = Stage(gpu, scene)
    found = integral(stage, (24, 24), tolerance=0.02)
    L_d = Renderer(scene, make_method("lambert"), (24, 24), gpu).frame(aovs=["irradiance"]).aovs["irradiance"]
    seen = L_d[..., 0] > 0
    assert found.M_back is not None and seen.sum() > 300 and (found.M[~seen] == 0).all()
    L_d, opposed, across = L_d[seen], WIDE.beyond(np.sqrt(2) * a), WIDE.beyond(2 * a)
    np.testing.assert_allclose(found.M[seen], WIDE.total * (1 - across) * L_d, rtol=0.01)
    back = WIDE.total * (opposed - across) * L_d
    np.testing.assert_allclose(found.M_back[seen].mean(axis=0), back.mean(axis=0), rtol=0.01)
    front, behind = at_vertices(stage, stage.bodies[0], tolerance=0.02)
    assert front.shape == behind.shape == ball.mesh.positions.shape
    np.testing.assert_allclose(front + behind, np.broadcast_to(found.M[12, 12], front.shape), rtol=0.005)
    np.testing.assert_allclose(behind.mean(axis=0), back.mean(axis=0), rtol=0.01)


@pytest.mark.parametrize(("thickness", "vertices"), [(2.0, 6000), (0.3, 3000)])
def test_a_slab_lit_on_the_far_face(gpu: Gpu, thickness: float, vertices: int) -> None:
    """The thin slab is thinner than the radius of the analytic part, which must not apply to its far face."""
    below = OrthographicCamera((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=2)
    up = DirectionalLight((0, 1, 0), (2.0, 2.0, 2.0))
    scene = lit(up, mesh=shapes.slab((30, thickness, 30), vertices), material=SOFT, camera=below)
    stage = Stage(gpu, scene)
    places = Samples(*_under(scene.objects[0].mesh, thickness / 2))
    spacing = 0.5
    assert (RADIUS * spacing > thickness) == (thickness == 0.3)
    found = sum_at_spacing(stage.bodies[0], places, np.zeros((len(places.face), 3)), WIDE, spacing)
    np.testing.assert_array_equal(found.front, 0)
    expected = 2.0 * WIDE.total * WIDE.beyond(thickness)
    np.testing.assert_allclose(found.back, np.broadcast_to(expected, found.back.shape), rtol=0.01)


def _under(mesh: Mesh, height: float) -> tuple[Any, Any, Any]:
    """Return points on the faces of a slab's top within 2 mm of its centre."""
    middle = mesh.positions[mesh.faces].mean(axis=1)
    faces = np.flatnonzero((middle[:, 1] > 0.99 * height) & (np.abs(middle[:, [0, 2]]).max(axis=1) < 2)).astype(
        np.int32
    )
    return faces, np.full((len(faces), 3), 1 / 3), np.zeros(len(faces))


@pytest.mark.parametrize("profile", [SKIN_GAUSSIANS, BURLEY], ids=["skin", "burley"])
def test_a_half_lit_plane(gpu: Gpu, profile: Profile) -> None:
    """The base colour, applied before diffusion, is white beyond a straight edge. Two spacings from the edge, M is the
    integral of the line spread function. The narrowest Gaussian of skin is narrower than the spacing, and Burley's
    profile is unbounded at 0."""
    color = np.zeros((1, 1000, 3), np.uint8)
    color[:, 470:] = 255
    side, spacing = 24.0, 0.15
    edge = ((0.47 - 0.01) / 0.98 - 0.5) * side
    striped = replace(MATTE, color_after=0.0, maps=replace(MATTE.maps, base_color=color))
    stage = Stage(gpu, lit(SUN, mesh=plane(side), material=striped))
    body = stage.bodies[0]
    places = random_points(body.mesh, 4000)
    x = body.at(places).position
    keep = (np.abs(x[:, 2]) < 3) & (np.abs(x[:, 0] - edge) < 2) & (np.abs(x[:, 0] - edge) > 2 * spacing)
    places = Samples(places.face[keep], places.barycentric[keep], places.share[keep])
    x = x[keep, 0].astype(float) - edge
    found = sum_at_spacing(body, places, irradiance_at(body, places), profile, spacing)
    t = np.geomspace(1e-9, 12, 4000)
    spread = profile.line_spread(t)
    half = np.concatenate([[[0, 0, 0]], np.cumsum(0.5 * (spread[1:] + spread[:-1]) * np.diff(t)[:, None], axis=0)])
    within = np.stack([np.interp(np.abs(x), t, half[:, c]) for c in range(3)], axis=-1)
    expected = 2.0 * (0.5 * profile.total + np.sign(x)[:, None] * within)
    assert keep.sum() > 50 and found.samples < 150_000
    np.testing.assert_allclose(found.front, expected, atol=0.01 * 2.0 * profile.total.max())
    np.testing.assert_array_equal(found.back, 0)


@pytest.mark.parametrize(
    "profile", [WIDE, material("skin1").profile, replace(BURLEY)], ids=["wide", "dipole", "burley"]
)
def test_error_falls_faster_than_the_spacing(gpu: Gpu, profile: Profile) -> None:
    mesh = shapes.sphere(5.0, vertices=250)
    stage = Stage(gpu, lit(PointLight((0, 30, 5), (1e-3, 1e-3, 1e-3)), mesh=mesh, material=SOFT))
    body, places = stage.bodies[0], random_points(mesh, 200)
    L_d = irradiance_at(body, places)
    *coarse, exact = (sum_at_spacing(body, places, L_d, profile, spacing) for spacing in (1.0, 0.5, 0.25, 0.1))
    wanted = exact.front + exact.back
    errors = np.array([rms(found.front + found.back - wanted) / rms(wanted) for found in coarse])
    assert (errors[-1] < 0.005).all()
    orders = np.log2(errors[:-1] / errors[1:])
    assert (orders > 1.0).all() and orders.mean() > 1.4


def test_base_colour_and_a_profile_of_another_kind(gpu: Gpu) -> None:
    half = replace(SOFT, base_color=(0.5, 0.25, 1.0), color_after=0.3)
    scene = lit(SUN, material=half, camera=replace(ABOVE, height=2))
    stage = Stage(gpu, scene)
    for profile in (None, BURLEY):
        found = integral(stage, (4, 4), profiles={0: profile} if profile else None)
        total = (profile or WIDE).total
        np.testing.assert_allclose(found.M, np.broadcast_to(2.0 * total * half.base_color, found.M.shape), rtol=2e-3)
    front, back = at_vertices(stage, stage.bodies[0], tolerance=0.04)
    middle = np.abs(stage.bodies[0].mesh.positions).max(axis=1) < 1
    expected = 2.0 * WIDE.total * np.array(half.base_color) ** 0.7
    np.testing.assert_allclose(front[middle], np.broadcast_to(expected, front[middle].shape), rtol=2e-3)
    assert (back == 0).all()


def test_light_stays_in_the_object_that_it_enters(gpu: Gpu) -> None:
    """A plane lies half a millimetre below a lit one, in its shadow."""
    below = OrthographicCamera((0, -50, 0), (0, 0, 0), up=(0, 0, -1), height=4)
    hidden = Object(plane(20, y=-0.5), SOFT)
    found = integral(Stage(gpu, lit(SUN, material=SOFT, camera=below, extra=(hidden,))), (4, 4), samples=20_000)
    np.testing.assert_array_equal(found.M, 0)


def test_pixels_of_a_half_lit_plane(gpu: Gpu) -> None:
    """The plane has two triangles, so that the barycentric coordinates of the pixels matter."""
    color = np.zeros((1, 1000, 3), np.uint8)
    color[:, 500:] = 255
    striped = replace(SOFT, color_after=0.0, maps=replace(MATTE.maps, base_color=color))
    found = integral(Stage(gpu, lit(SUN, mesh=plane(cells=1), material=striped)), (16, 16), tolerance=0.02)
    expected = 2.0 * WIDE.step_response((np.arange(16) + 0.5) * 20 / 16 - 10)
    np.testing.assert_allclose(found.M, np.broadcast_to(expected, (16, 16, 3)), atol=0.01 * expected.max())


def test_each_object_has_its_own_profile(gpu: Gpu) -> None:
    """Two planes side by side, each uniformly lit."""
    scene = lit(SUN, extra=(Object(plane(10), SOFT, translate=(5.5, 0, 0)),))
    scene = replace(scene, objects=(Object(plane(10), SOFT, translate=(-5.5, 0, 0)), *scene.objects[1:]))
    profiles = {i: SumOfGaussians(np.array([0.5]), np.full((1, 3), 0.3 + 0.4 * i)) for i in (0, 1)}
    found = integral(Stage(gpu, scene), (8, 8), profiles=profiles)
    for column, total in ((2, 0.3), (5, 0.7)):
        np.testing.assert_allclose(found.M[4, column], 2.0 * total, rtol=0.01)
    assert (found.M[0] == 0).all()


def test_an_interrupted_sum_continues(gpu: Gpu, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path))
    monkeypatch.setattr(surface_sum, "_PART", 1)  # a part for each workgroup
    stage = Stage(gpu, lit(SUN, mesh=shapes.sphere(5.0, vertices=250), material=SOFT))
    summed, most, done = surface_sum._Source.summed, 6, []

    def interrupted(self: Any, receivers: Any, bar: Any) -> Any:
        if len(done) == most:
            raise KeyboardInterrupt
        done.append(len(receivers.position))
        return summed(self, receivers, bar)

    monkeypatch.setattr(surface_sum._Source, "summed", interrupted)
    with pytest.raises(KeyboardInterrupt):
        integral(stage, (48, 48), tolerance=0.05)
    most = 10_000
    first, found = done[:], integral(stage, (48, 48), tolerance=0.05)
    resumed = done[len(first) :]
    done.clear()
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path / "other"))
    whole = integral(stage, (48, 48), tolerance=0.05)
    assert len(first) == 6 and sorted(first + resumed) == sorted(done)
    np.testing.assert_array_equal(found.M, whole.M)
    done.clear()
    again = integral(stage, (48, 48), tolerance=0.05)  # the whole, from the cache
    np.testing.assert_array_equal(again.M, whole.M)
    assert not done
    brighter = Stage(gpu, replace(stage.scene, lights=(replace(SUN, irradiance=(4.0, 4.0, 4.0)),)))
    np.testing.assert_allclose(integral(brighter, (48, 48), tolerance=0.05).M, 2 * whole.M, rtol=1e-5)
    assert done


def test_a_limit_on_the_samples_gives_a_warning(gpu: Gpu) -> None:
    stage = Stage(gpu, lit(SUN, mesh=shapes.sphere(5.0, vertices=250), material=SOFT))
    for _ in range(2):  # and again when the result comes from the cache
        with pytest.warns(UserWarning, match=r"white on sphere: M still changes by .* from \d+ to \d+ samples"):
            found = integral(stage, (16, 16), tolerance=1e-5, samples=20_000)
    assert 0 < found.error.max() < 0.1 * found.M.max()
    with pytest.warns(UserWarning, match="mm apart, too far for the material"):
        integral(stage, (16, 16), profiles={0: NormalizedDiffusion((0.8,) * 3, (0.05,) * 3)}, samples=1000)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loose = integral(stage, (16, 16), tolerance=0.05)
    assert rms(loose.error[loose.M[..., 0] > 0]).max() < 0.05 * rms(loose.M[loose.M[..., 0] > 0]).max()


def test_every_input_changes_the_cache_key(gpu: Gpu, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path))
    calls = []

    def stub(body: Any, receivers: Samples, *settings: Any) -> Converged:
        calls.append(settings)
        nothing = np.zeros((len(receivers.face), 3))
        return Converged(front=nothing, back=nothing, error=nothing, note="")

    monkeypatch.setattr(reference, "converged", stub)
    finger = Object(shapes.capsule(vertices=500), SOFT, motion=BendAndSwell())
    scene = replace(lit(SUN, EnvironmentLight()), objects=(finger,), camera=replace(ABOVE, height=200))

    def thing(**changes: Any) -> Scene:
        return replace(scene, objects=(replace(finger, **changes),))

    scenes = [
        scene,
        replace(scene, lights=(SUN, EnvironmentLight((1.0, 1.0, 1.1)))),
        replace(scene, camera=replace(scene.camera, height=201)),
        *(thing(material=replace(SOFT, **change)) for change in ({"color_after": 0.9}, {"roughness": 0.6})),
        thing(material=replace(SOFT, maps=Maps(base_color=np.zeros((1, 1, 3), np.uint8)))),
        thing(material=replace(SOFT, gaussians=SumOfGaussians(1.01 * WIDE.variances, WIDE.weights))),
        thing(translate=(0, 1, 0)),
        thing(motion=None, mesh=shapes.capsule(vertices=600)),
    ]
    for stage in (*(Stage(gpu, scene) for scene in scenes), Stage(gpu, scene, 0.3)):
        before = len(calls)
        integral(stage, (16, 16))
        integral(stage, (16, 16))
        assert len(calls) == before + 1
    before = len(calls)
    integral(stage, (16, 17))
    integral(stage, (16, 16), tolerance=0.02)
    integral(stage, (16, 16), samples=1000)
    integral(stage, (16, 16), profiles={0: BURLEY})
    at_vertices(stage, stage.bodies[0])
    at_vertices(stage, stage.bodies[0], profile=BURLEY)
    assert len(calls) == before + 6


def test_irradiance_of_many_points_is_gathered_in_parts(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = shapes.sphere(5.0, vertices=250)
    stage = Stage(gpu, lit(SUN, mesh=mesh, material=SOFT))
    body, places = stage.bodies[0], random_points(mesh, 250)
    at_once = irradiance_at(body, places)
    monkeypatch.setattr(convergence, "_POINTS", 100)
    np.testing.assert_array_equal(irradiance_at(body, places), at_once)
    expected = 2.0 * np.maximum(body.at(places).normal[:, 1], 0)
    np.testing.assert_allclose(at_once[:, 0], expected, atol=0.05)


def test_the_integral_can_be_used_like_a_method(gpu: Gpu) -> None:
    assert REFERENCES["integral"] is Integral
    method = make_method("integral", {"tolerance": "0.05", "samples": "20000"})
    assert isinstance(method, Integral) and (method.tolerance, method.samples) == (0.05, 20_000)
    side = DirectionalLight((0.5, 1, 0), (2.0, 2.0, 2.0))
    scene = lit(side, mesh=shapes.sphere(2.0, vertices=250), material=SOFT)
    image = Renderer(scene, method, (16, 16), gpu).frame(aovs=["M_front", "M_back"])
    found = method.estimate(Stage(gpu, scene), (16, 16))
    np.testing.assert_allclose(image.aovs["M_front"], found.M_front, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(image.aovs["M_back"], found.M_back, rtol=1e-3, atol=1e-4)
    assert found.M_back is not None and found.M_back.max() > 0.01
