"""Samples of a mesh: evenly spread, with the right area on each side."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake import point_cloud as module
from wgsss.bake.point_cloud import PointCloud, point_cloud
from wgsss.errors import InputError
from wgsss.scene import Mesh
from wgsss.scene.shapes import ear, slab, sphere


def areas(mesh: Mesh, cloud: PointCloud) -> np.ndarray:
    return 0.5 * np.linalg.norm(mesh.face_normals, axis=1)[cloud.samples.face] * cloud.samples.share


def positions(mesh: Mesh, cloud: PointCloud) -> np.ndarray:
    corners = mesh.positions[mesh.faces[cloud.samples.face]].astype(np.float64)
    return np.einsum("nk,nkd->nd", cloud.samples.barycentric, corners)


@pytest.mark.parametrize(
    ("mesh", "spacing"), [(sphere(10.0, 800), 0.7), (sphere(10.0, 8000), 2.0), (slab(), 1.0), (ear(2000), 1.0)]
)
def test_samples_are_evenly_spread_and_their_areas_sum_to_that_of_the_mesh(mesh: Mesh, spacing: float) -> None:
    from scipy.spatial import KDTree

    cloud = point_cloud(mesh, spacing)
    area, x = areas(mesh, cloud), positions(mesh, cloud)
    np.testing.assert_allclose(area.sum(), mesh.area, rtol=1e-9)
    assert abs(cloud.spacing / spacing - 1.0) < 0.02
    assert area.std() < 0.3 * area.mean(), "at random it is the mean"
    np.testing.assert_allclose(cloud.samples.barycentric.sum(axis=1), 1.0, rtol=1e-12)
    assert cloud.samples.barycentric.min() >= 0.0
    apart = KDTree(x).query(x, k=2)[0][:, 1]
    assert np.percentile(apart, 1) > 0.4 * spacing, "at random it is 0.06"
    # Sums of linear functions are near their integrals.
    corners = mesh.positions[mesh.faces].astype(np.float64)
    exact = 0.5 * np.linalg.norm(mesh.face_normals, axis=1) @ corners.mean(axis=1) / mesh.area
    np.testing.assert_allclose(area @ x / mesh.area, exact, atol=0.02 * spacing)


def test_both_sides_of_a_plate_thinner_than_the_spacing_have_their_own_samples() -> None:
    from scipy.spatial import KDTree

    plate = slab(size=(20, 20, 0.2), vertices=2000)
    cloud = point_cloud(plate, 1.0)
    normal = plate.face_normals[cloud.samples.face]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    grid = np.stack(np.meshgrid(*[np.linspace(-9, 9, 60)] * 2), axis=-1).reshape(-1, 2)
    for side in (-1, 1):
        own = side * normal[:, 2] > 0.9
        np.testing.assert_allclose(areas(plate, cloud)[own].sum(), 400.0, rtol=0.02)  # the area of the rim counts, too
        away = KDTree(positions(plate, cloud)[own][:, :2]).query(grid)[0]
        assert away.max() < 1.1


def test_too_many_samples_are_reduced_with_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST", 500)
    with pytest.warns(UserWarning, match="samples 0.32 mm apart are too many: 500 are used, 1.6 mm apart"):
        cloud = point_cloud(sphere(10.0, 500), 0.316)
    assert 450 < len(cloud.samples.face) <= 500


def test_slivers_and_faces_without_an_area_are_accepted() -> None:
    corners = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [5, 1e-5, 0], [10, 10, 0], [5, 0, 0]], np.float32)
    mesh = Mesh(corners, np.array([[0, 1, 2], [1, 4, 2], [0, 3, 1], [0, 5, 1], [0, 1, 2]]))
    cloud = point_cloud(mesh, 1.0)
    np.testing.assert_allclose(areas(mesh, cloud).sum(), mesh.area, rtol=1e-9)
    assert np.isfinite(positions(mesh, cloud)).all() and (areas(mesh, cloud) > 0).all()


def test_a_mesh_without_an_area_raises_an_error() -> None:
    line = Mesh(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.float32), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="no area"):
        point_cloud(line, 1.0)


def test_the_same_mesh_gives_the_same_samples() -> None:
    first, second = (module._make(sphere(10.0, 500), 1.0)[0] for _ in range(2))
    np.testing.assert_array_equal(first.face, second.face)
    np.testing.assert_array_equal(first.barycentric, second.barycentric)
    np.testing.assert_array_equal(first.share, second.share)
