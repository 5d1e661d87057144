"""Reduced fans: their areas, quads and quadrature points, and the one-rings of vertices."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.fans import fan_areas, fan_corners, one_ring
from wgsss.scene import Mesh
from wgsss.scene.shapes import ear, slab

# Two triangles of a 3 x 4 rectangle, and a vertex without faces.
SHEET = Mesh(
    np.array([[0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0], [9, 9, 9]], np.float32), np.array([[0, 1, 2], [0, 2, 3]])
)


def own_points(mesh: Mesh, face: int, vertex: int, count: int) -> np.ndarray:
    """Return random points of a face whose largest barycentric coordinate belongs to the vertex, (n, 3)."""
    share = np.random.default_rng(face).dirichlet((1, 1, 1), count)
    own = share.argmax(axis=1) == np.flatnonzero(mesh.faces[face] == vertex)[0]
    return share[own] @ mesh.positions[mesh.faces[face]].astype(np.float64)


def test_fan_areas_sum_to_the_area_of_the_mesh() -> None:
    np.testing.assert_allclose(fan_areas(SHEET), [4, 2, 4, 2, 0], rtol=1e-12)
    for mesh in (ear(1000), slab(vertices=500)):
        np.testing.assert_allclose(fan_areas(mesh).sum(), mesh.area, rtol=1e-12)


def test_one_ring_has_each_neighbour_along_an_edge_once() -> None:
    ring = one_ring(SHEET)
    neighbours = [ring.vertex[a:b].tolist() for a, b in zip(ring.start, ring.start[1:], strict=False)]
    assert neighbours == [[1, 2, 3], [0, 2], [0, 1, 3], [0, 2], []]
    mesh = ear(1000)
    edges = {(int(f[i]), int(f[j])) for f in mesh.faces for i in range(3) for j in range(3) if i != j}
    ring = one_ring(mesh)
    owner = np.repeat(np.arange(len(mesh.positions)), np.diff(ring.start))
    assert len(owner) == len(edges)
    assert set(zip(owner.tolist(), ring.vertex.tolist(), strict=True)) == edges


def test_quads_contain_the_points_whose_largest_barycentric_coordinate_is_the_vertexs() -> None:
    mesh, vertex = ear(1000), 123
    corners, quads = fan_corners(mesh), Fans(mesh).points(np.array([vertex]), 1)
    own = corners.corner[corners.start[vertex] : corners.start[vertex + 1]]
    assert len(own) == len(quads.position)
    for corner, position, area in zip(own, quads.position, quads.area, strict=True):
        face, k = divmod(int(corner), 3)
        assert mesh.faces[face, k] == vertex
        mean = own_points(mesh, face, vertex, 40_000).mean(axis=0)
        np.testing.assert_allclose(position, mean, atol=0.02 * np.sqrt(area))
        np.testing.assert_allclose(area, np.linalg.norm(mesh.face_normals[face]) / 6.0, rtol=1e-5)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_quadrature_points_of_every_order_have_the_moments_of_the_fan(order: int) -> None:
    mesh = ear(1000)
    fans, vertex = Fans(mesh), np.array([5, 77, 401])
    points = fans.points(vertex, order)
    assert (np.diff(points.start) == fans.point_counts(order)[vertex]).all()
    for k, v in enumerate(vertex):
        own, area = slice(points.start[k], points.start[k + 1]), fan_areas(mesh)[v]
        faces = np.flatnonzero((mesh.faces == v).any(axis=1))
        samples = np.concatenate([own_points(mesh, f, v, 60_000) for f in faces])
        size = np.linalg.norm(mesh.face_normals[faces], axis=1)
        weight = np.concatenate(
            [np.full(len(own_points(mesh, f, v, 60_000)), s) for f, s in zip(faces, size, strict=True)]
        )
        mean = np.average(samples, axis=0, weights=weight)
        spread = np.average(np.square(samples - mean).sum(axis=1), weights=weight)
        w = points.area[own]
        np.testing.assert_allclose(w.sum(), area, rtol=1e-9)
        np.testing.assert_allclose(w @ points.position[own] / area, mean, atol=0.01 * np.sqrt(area))
        square = w @ (np.square(points.position[own] - mean).sum(axis=1) + points.extent[own]) / area
        np.testing.assert_allclose(square, spread, rtol=0.02)


def test_a_vertex_without_faces_has_no_quadrature_points() -> None:
    fans = Fans(SHEET)
    assert fans.area[4] == 0 and [fans.point_counts(order)[4] for order in range(4)] == [0, 0, 0, 0]
