"""The faces that rays meet, by each library that can cast them."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from scenes import plane

from wgsss.bake import rays
from wgsss.bake.rays import LIBRARIES, Caster
from wgsss.bake.thickness import local_thickness
from wgsss.errors import InputError
from wgsss.scene import MATERIALS, Mesh
from wgsss.scene.shapes import ear, gyroid

INSTALLED = [name for name in LIBRARIES if find_spec(name)]
every_library = pytest.mark.parametrize("library", INSTALLED)
both = pytest.mark.skipif(len(INSTALLED) < 2, reason=f"only {', '.join(INSTALLED)} is installed")


def sphere_points(count: int, seed: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@every_library
def test_rays_meet_faces_from_both_sides_and_the_nearest_first(library: str) -> None:
    sheet = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    caster = Caster(np.concatenate([sheet, sheet + np.array([0, 0, 2])]), np.arange(6).reshape(2, 3), library)
    origins = np.array([[0.2, 0.2, 5], [0.2, 0.2, 1], [0.2, 0.2, -3], [0.9, 0.9, 5], [0.2, 0.2, -1]])
    directions = np.array([[0, 0, -1], [0, 0, -1], [0, 0, 1], [0, 0, -1], [0, 0, -1]])
    assert caster.first(origins, directions).tolist() == [1, 0, 0, -1, -1]
    assert caster.blocked(origins, directions).tolist() == [True, True, True, False, False]


@every_library
def test_an_empty_set_of_rays_is_accepted(library: str) -> None:
    caster, none = Caster(plane().positions, plane().faces, library), np.zeros((0, 3))
    assert len(caster.first(none, none)) == len(caster.blocked(none, none)) == 0


@every_library
@pytest.mark.parametrize("radius", [1e-4, 1.0, 1e6])
@pytest.mark.parametrize("far", [0.0, 300.0])
def test_the_size_and_the_position_of_a_mesh_do_not_matter(library: str, radius: float, far: float) -> None:
    """From inside a closed surface, each ray meets the face in its direction."""
    mesh = ear(2000)
    offset = far * radius * np.array([1.0, -2.0, 3.0])
    size = float(np.ptp(mesh.bounds, axis=0).max())
    placed = mesh.positions.astype(np.float64) / size * radius
    inside = placed[:500] - 1e-3 * radius * mesh.normals[:500]
    directions = sphere_points(500, 1)
    wanted = Caster(placed, mesh.faces, library).first(inside, directions)
    assert (wanted >= 0).all()
    found = Caster(placed + offset, mesh.faces, library).first(inside + offset, directions)
    assert (found != wanted).mean() < 0.01


@both
@pytest.mark.parametrize("mesh", [ear(4000), gyroid(vertices=6000)], ids=["ear", "gyroid"])
def test_libraries_agree_except_at_edges(mesh: Mesh) -> None:
    random = np.random.default_rng(5)
    start = random.integers(0, len(mesh.positions), 40_000)
    side = random.choice([-1e-3, 1e-3], len(start))[:, None] * np.ptp(mesh.bounds, axis=0).max()
    origins, directions = mesh.positions[start] + side * mesh.normals[start], sphere_points(len(start), 7)
    casters = [Caster(mesh.positions, mesh.faces, name) for name in INSTALLED]
    one, other = (caster.first(origins, directions) for caster in casters)
    differ = one != other
    print(f"{differ.mean():.5%} of rays meet another face")
    assert differ.mean() < 1e-4
    shared = [
        len(np.intersect1d(mesh.faces[a], mesh.faces[b])) for a, b in zip(one[differ], other[differ], strict=True)
    ]
    assert all(count > 0 for count in shared), "faces that are no neighbours"
    for caster, faces in zip(casters, (one, other), strict=True):
        assert (caster.blocked(origins, directions) == (faces >= 0)).mean() > 1 - 1e-4


@both
def test_both_libraries_bake_the_same_thickness(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, profile = ear(1500), MATERIALS["marble"].profile
    found = []
    for name in INSTALLED:
        monkeypatch.setattr(rays, "LIBRARIES", {name: LIBRARIES[name]})
        monkeypatch.setattr("wgsss.bake.thickness.cached", lambda kind, key, make, **_: make())
        found.append(local_thickness(mesh, profile))
    np.testing.assert_allclose(*found, atol=2e-3)


def test_the_error_without_a_library_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rays, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="embreex or libigl"):
        Caster(plane().positions, plane().faces)
