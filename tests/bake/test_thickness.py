"""Local thickness, compared with closed forms, with independently cast chords, and with chord lengths."""

from __future__ import annotations

import time
import warnings
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import plane
from scipy.integrate import quad_vec
from scipy.stats import spearmanr

from wgsss.bake import thickness
from wgsss.bake.rays import Caster
from wgsss.bake.thickness import falloff, falloff_table, far_side, local_thickness, smoothed
from wgsss.optics import Profile, SumOfGaussians
from wgsss.scene import MATERIALS, Mesh, load_mesh
from wgsss.scene.shapes import ear, slab, sphere

MARBLE, SKIN, SKIN1 = (MATERIALS[name].profile for name in ("marble", "skin", "skin1"))


def gaussian(variance: float) -> Profile:
    return SumOfGaussians(np.array([variance]), np.array([[0.9, 0.5, 0.0]]))


@pytest.mark.parametrize("profile", [MARBLE, SKIN1, SKIN])
@pytest.mark.parametrize("height", [0.3, 2.0])
def test_the_mean_over_rays_through_a_plate_is_the_share_beyond_its_thickness(profile: Profile, height: float) -> None:
    """Check the integral equation that the falloff solves."""

    def seen(cos: float) -> Any:
        return 2.0 * cos * falloff(profile, np.array(height / cos))

    mean, _ = quad_vec(seen, 1e-6, 1.0)
    np.testing.assert_allclose(mean, profile.beyond(height), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("profile", [MARBLE, SKIN, gaussian(1.0)])
def test_the_falloff_falls_from_1_to_0(profile: Profile) -> None:
    distances, falls = falloff_table(profile)
    lit = profile.total > 0.0
    np.testing.assert_allclose(falls[0, lit], 1.0, atol=1e-3)
    assert (np.diff(falls, axis=0) <= 1e-12).all() and (falls[-1] < 0.02).all() and (falls >= 0.0).all()
    assert (falls[:, ~lit] == 0.0).all()
    np.testing.assert_allclose(profile.beyond(distances[-1]).max(), thickness.BEYOND, rtol=1e-3)


@pytest.mark.parametrize("profile", [MARBLE, SKIN1])
def test_the_local_thickness_of_a_plate(profile: Profile) -> None:
    """It is the share of the profile beyond the thickness of the plate."""
    plate = slab((400.0, 400.0, 2.0), vertices=2500)
    found = local_thickness(plate, profile)[(np.abs(plate.positions[:, :2]) < 100.0).all(axis=1)]
    assert len(found) > 100
    # rays longer than the range of the profile are cut off
    np.testing.assert_allclose(found, np.broadcast_to(profile.beyond(2.0), found.shape), rtol=0.01, atol=2e-3)


@pytest.mark.parametrize("radius", [0.7, 1.5])
def test_the_local_thickness_of_a_ball(radius: float) -> None:
    """Chords have the length 2 r cos. Those longer than sqrt(2) r end where the surface faces away."""
    found = local_thickness(sphere(radius=radius, vertices=4000), gaussian(1.0))

    def below(q: float) -> float:  # the integral of exp(-q) (1 + q), q = d^2 / 2v
        return -(2.0 + q) * np.exp(-q)

    wanted = (below(2.0 * radius**2) - below(radius**2)) / (2.0 * radius**2)
    np.testing.assert_allclose(found[:, :2].mean(axis=0), wanted, rtol=0.01)
    assert found[:, :2].std() < 0.01 * wanted
    assert (found[:, 2] == 0.0).all()


def test_scaling_mesh_and_material_keeps_the_local_thickness() -> None:
    small = ear(1000)
    large = Mesh(3.0 * small.positions, small.faces)
    np.testing.assert_allclose(
        local_thickness(large, gaussian(9.0)), local_thickness(small, gaussian(1.0)), rtol=0.02, atol=2e-3
    )


def test_a_surface_without_a_far_side_lets_no_light_through() -> None:
    assert (local_thickness(plane(), MARBLE) == 0.0).all()


def test_no_light_comes_through_a_hole() -> None:
    """The far side of a plate ends at x = 0: above its edge, half of the light of a plate remains."""
    plate = slab((60.0, 60.0, 2.0), vertices=6000)
    middle = plate.positions[plate.faces].mean(axis=1)
    kept = (np.abs(plate.face_normals[:, 2]) > 0) & ((middle[:, 2] > 0) | (middle[:, 0] < 0))
    found = local_thickness(Mesh(plate.positions, plate.faces[kept]), SKIN1)[:, 0]
    x, y, z = plate.positions.T
    over = (np.abs(y) < 20.0) & (z > 0)
    whole = SKIN1.beyond(2.0)[0]
    np.testing.assert_allclose(found[over & (x < -12.0) & (x > -20.0)], whole, rtol=0.03)
    assert found[over & (np.abs(x) < 0.5)].mean() == pytest.approx(whole / 2, rel=0.15)
    assert found[over & (x > 15.0)].max() < 0.02 * whole


@pytest.mark.parametrize("name", ["ear", "bunny"])
def test_the_mean_over_random_rays_is_the_same(name: str, data: Path) -> None:
    """Compare with random rays that are cast one after another, from face to face."""
    mesh, vertices, d, normals = chords(name, data)
    found = at(mesh, vertices)
    opposed = np.einsum("nrk,nk->nr", normals, mesh.normals[vertices]) < 0.0
    counted = falloff(MARBLE, np.where(np.isfinite(d), d, 1e6)) * (opposed & np.isfinite(d))[..., None]
    error = found - counted.mean(axis=1)
    spread = np.sqrt((counted.var(axis=1) / d.shape[1]).mean())
    assert np.sqrt(np.square(error).mean()) < 2.0 * spread + 0.01
    assert np.abs(error.mean()) < 0.003


@pytest.mark.parametrize(("name", "median", "lowest"), [("ear", 1.3, 0.8), ("bunny", 1.8, 0.8)])
def test_thickness_and_chord_length(name: str, median: float, lowest: float, data: Path) -> None:
    """A plate of thickness h has a mean chord of 2 h, and lets the share of the profile beyond h pass.

    The local thickness at a vertex thus implies a mean chord: that of the plate with the same share. It is the true one
    on plates. It is larger where rays run along the surface, since these are not counted: 1.3 times on the ear, 1.8
    times on the bunny.
    """
    mesh, vertices, d, _ = chords(name, data)
    if name == "ear":  # Cauchy: the mean chord of a closed surface is four times its volume over its area
        volume = np.einsum("nk,nk->", mesh.positions[mesh.faces[:, 0]].astype(float), mesh.face_normals) / 6.0
        areas = np.bincount(mesh.faces.ravel(), np.repeat(np.linalg.norm(mesh.face_normals, axis=1) / 6.0, 3))
        assert np.average(d.mean(axis=1), weights=areas[vertices]) == pytest.approx(4 * volume / mesh.area, rel=0.05)
    true = np.nanmean(np.where(np.isfinite(d), d, np.nan), axis=1)
    heights = np.geomspace(1e-2, 200.0, 2000)
    beyond = MARBLE.beyond(heights)[:, 0]
    implied = 2.0 * np.interp(-at(mesh, vertices)[:, 0], -beyond, heights)
    ratio, rank = np.median(implied / true), spearmanr(implied, true).statistic
    print(f"{name}: median of implied over true mean chord {ratio:.2f}, rank correlation {rank:.2f}")
    assert ratio == pytest.approx(median, abs=0.15) and rank > lowest


def at(mesh: Mesh, vertices: Any) -> Any:
    """Return the local thickness (N, 3) of marble at some vertices of a mesh, before smoothing."""
    lengths = far_side(Caster(mesh.positions, mesh.faces), mesh, vertices)
    return (falloff(MARBLE, np.minimum(lengths, 1e6)) * np.isfinite(lengths)[..., None]).mean(axis=1)


@cache
def chords(name: str, data: Path) -> tuple[Mesh, Any, Any, Any]:
    """A mesh, some of its vertices (N,), random cosine-weighted chords (N, 300) from there, mm, inf where they meet
    nothing, and the normals (N, 300, 3) where they end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the bunny has holes
        mesh = ear(3000) if name == "ear" else load_mesh(data / "bunny_stanford.ply", size_mm=40.0).mesh
    random = np.random.default_rng(2)
    vertices = random.choice(len(mesh.positions), 300, replace=False)
    n = mesh.normals[vertices].astype(np.float64)
    w = random.normal(size=(len(n), 300, 3))
    # Points on a ball that touches the surface have a cosine density as directions.
    w = w / np.linalg.norm(w, axis=2, keepdims=True) - n[:, None]
    w = (w / np.linalg.norm(w, axis=2, keepdims=True)).reshape(-1, 3)
    start = np.repeat(mesh.positions[vertices] - 1e-3 * n, 300, axis=0)
    face = Caster(mesh.positions, mesh.faces).first(start, w)
    normals = np.where(face[:, None] < 0, 0.0, mesh.face_normals[face])
    height = np.einsum("nk,nk->n", normals, mesh.positions[mesh.faces[face, 0]] - start)
    d = np.divide(height, np.einsum("nk,nk->n", normals, w), out=np.full(len(w), np.inf), where=face >= 0)
    return mesh, vertices, d.reshape(-1, 300), normals.reshape(-1, 300, 3)


def test_smoothing_keeps_the_integral() -> None:
    """The integral over the surface stays. A vertex of a regular grid keeps half of its value in each smoothing."""
    mesh = ear(800)
    values = np.random.default_rng(3).random((len(mesh.positions), 3))
    third = np.repeat(np.linalg.norm(mesh.face_normals, axis=1) / 6.0, 3)
    areas = np.bincount(mesh.faces.ravel(), third, len(values))
    np.testing.assert_allclose(areas @ smoothed(mesh, values), areas @ values, rtol=1e-6)
    np.testing.assert_allclose(smoothed(mesh, np.full_like(values, 0.3)), 0.3, rtol=1e-6)
    grid = plane(cells=8)
    peak = np.zeros((len(grid.positions), 3))
    peak[40] = 1.0
    once = 0.5**2 + 6 * (1 / 12) ** 2  # each of the six neighbours receives a twelfth, and returns a twelfth of that
    np.testing.assert_allclose(smoothed(grid, peak)[40], once, rtol=1e-6)


def test_the_thickness_has_the_same_bits_each_time_and_from_the_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = sphere(radius=3.0, vertices=500)
    first = local_thickness(mesh, MARBLE)
    with monkeypatch.context() as patched:
        patched.setattr(thickness, "far_side", None)  # not needed
        np.testing.assert_array_equal(local_thickness(mesh, MARBLE), first)
    assert first.dtype == np.float32
    assert np.abs(local_thickness(mesh, SKIN1) - first).max() > 0.01
    monkeypatch.setattr(thickness, "cached", lambda kind, key, make, **_: make())
    np.testing.assert_array_equal(local_thickness(mesh, MARBLE), first)


@pytest.mark.skipif(not find_spec("embreex"), reason="libigl casts rays, which takes longer")
def test_50000_faces_take_at_most_5_seconds() -> None:
    mesh = ear(25_000)
    assert len(mesh.faces) > 49_000
    _ = mesh.normals
    start = time.process_time()
    local_thickness(mesh, SKIN1)
    seconds = time.process_time() - start
    print(f"{seconds:.1f} s")
    assert seconds < 5.0
