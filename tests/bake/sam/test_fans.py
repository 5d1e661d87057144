"""What surrounds a vertex: areas, neighbours and quads."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.sam.fan_quadrature import Fans
from wgsss.bake.sam.fans import fan_areas, fan_quads, one_ring
from wgsss.scene import Mesh
from wgsss.scene.shapes import ear, slab

# Two triangles of a 3 x 4 rectangle, and a vertex that no face has.
SHEET = Mesh(
    np.array([[0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0], [9, 9, 9]], np.float32), np.array([[0, 1, 2], [0, 2, 3]])
)


def own_points(mesh: Mesh, face: int, vertex: int, count: int) -> np.ndarray:
    """Random points of a face whose largest barycentric coordinate is a vertex's."""
    share = np.random.default_rng(face).dirichlet((1, 1, 1), count)
    own = share.argmax(axis=1) == np.flatnonzero(mesh.faces[face] == vertex)[0]
    return share[own] @ mesh.positions[mesh.faces[face]].astype(np.float64)


def test_fans_share_out_the_mesh_open_ones_too() -> None:
    np.testing.assert_allclose(fan_areas(SHEET), [4, 2, 4, 2, 0], rtol=1e-12)
    for mesh in (ear(1000), slab(vertices=500)):
        np.testing.assert_allclose(fan_areas(mesh).sum(), mesh.area, rtol=1e-12)


def test_neighbours_are_those_along_edges_each_once() -> None:
    found = one_ring(SHEET)
    around = [found.vertex[a:b].tolist() for a, b in zip(found.start, found.start[1:], strict=False)]
    assert around == [[1, 2, 3], [0, 2], [0, 1, 3], [0, 2], []]
    mesh = ear(1000)
    edges = {(int(f[i]), int(f[j])) for f in mesh.faces for i in range(3) for j in range(3) if i != j}
    found = one_ring(mesh)
    owner = np.repeat(np.arange(len(mesh.positions)), np.diff(found.start))
    assert len(owner) == len(edges)
    assert set(zip(owner.tolist(), found.vertex.tolist(), strict=True)) == edges


def test_quads_hold_the_points_whose_largest_coordinate_is_the_vertexs() -> None:
    mesh = ear(1000)
    made = fan_quads(mesh)
    vertex = 123
    for k in range(made.start[vertex], made.start[vertex + 1]):
        face, corner = divmod(int(made.corner[k]), 3)
        assert mesh.faces[face, corner] == vertex
        mean = own_points(mesh, face, vertex, 40_000).mean(axis=0)
        size = np.sqrt(made.area[k])
        np.testing.assert_allclose(made.centre[k], mean, atol=0.02 * size)
        np.testing.assert_allclose(made.area[k], np.linalg.norm(mesh.face_normals[face]) / 6.0, rtol=1e-5)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_points_of_any_order_tell_a_fans_moments(order: int) -> None:
    mesh = ear(1000)
    fans, vertex = Fans(mesh), np.array([5, 77, 401])
    points = fans.points(vertex, order)
    assert (np.diff(points.start) == fans.count(order)[vertex]).all()
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
        found = w @ (np.square(points.position[own] - mean).sum(axis=1) + points.extent[own]) / area
        np.testing.assert_allclose(found, spread, rtol=0.02)


def test_a_vertex_without_faces_has_no_points() -> None:
    fans = Fans(SHEET)
    assert fans.area[4] == 0 and [fans.count(order)[4] for order in range(4)] == [0, 0, 0, 0]
