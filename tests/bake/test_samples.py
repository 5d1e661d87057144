"""Samples of a surface and their areas."""

from __future__ import annotations

import numpy as np
import pytest

from wgsss.bake.samples import subdivided, vertex_samples
from wgsss.gpu import Gpu
from wgsss.scene import Mesh, load_scene
from wgsss.scene.shapes import sphere
from wgsss.stage import Stage


@pytest.mark.parametrize("spacing", [50.0, 3.0, 0.7])
def test_areas_and_first_moments_are_those_of_the_mesh(spacing: float) -> None:
    ball = sphere(radius=10.0, vertices=500)
    samples = subdivided(ball, spacing)
    corners = ball.positions[ball.faces].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    np.testing.assert_allclose(np.bincount(samples.face, samples.share), 1.0, rtol=1e-12)
    np.testing.assert_allclose(samples.barycentric.sum(axis=1), 1.0, rtol=1e-12)
    x = np.einsum("nk,nkd->nd", samples.barycentric, corners[samples.face])
    dA = area[samples.face] * samples.share
    # Linear functions are integrated exactly.
    offset = x - corners.mean(axis=1)[samples.face]
    for face in (0, len(area) // 2):
        own = samples.face == face
        np.testing.assert_allclose(offset[own].T @ dA[own], 0.0, atol=1e-9 * area[face])
    if spacing < 1.0:
        assert np.sqrt(dA.max()) < spacing


def test_the_midpoint_rule_is_of_second_order() -> None:
    ball = sphere(radius=10.0, vertices=100)
    corners = ball.positions[ball.faces].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)

    def integral(spacing: float) -> float:
        samples = subdivided(ball, spacing)
        x = np.einsum("nk,nkd->nd", samples.barycentric, corners[samples.face])
        return float((np.exp(x[:, 0] / 4.0) * area[samples.face] * samples.share).sum())

    exact = integral(0.05)
    errors = [abs(integral(spacing) - exact) for spacing in (2.0, 1.0, 0.5)]
    assert errors[1] < 0.45 * errors[0] and errors[2] < 0.45 * errors[1]


def test_samples_move_with_the_surface(gpu: Gpu) -> None:
    stage = Stage(gpu, load_scene("wave", vertices=2000))
    body = stage.bodies[0]
    samples = subdivided(body.mesh, 3.0)
    for time_s in (0.0, 0.4):
        stage.pose(time_s)
        at, mesh = body.at(samples), body.mesh
        np.testing.assert_allclose(at.area.sum(), mesh.area, rtol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(at.normal, axis=1), 1.0, rtol=1e-5)
        corners = mesh.positions[mesh.faces[samples.face]]
        np.testing.assert_allclose(at.position, np.einsum("nk,nkd->nd", samples.barycentric, corners), atol=1e-3)


def test_vertices_as_samples_are_where_the_vertices_are() -> None:
    ball = sphere(radius=10.0, vertices=100)
    lonely = Mesh(np.append(ball.positions, [[50, 0, 0]], axis=0), ball.faces)
    corners = lonely.positions[lonely.faces]
    for samples, wanted in (
        (vertex_samples(lonely), ball.positions),
        (vertex_samples(lonely, np.array([7, 3])), ball.positions[[7, 3]]),
    ):
        x = np.einsum("nk,nkd->nd", samples.barycentric, corners[samples.face])
        np.testing.assert_array_equal(x[: len(wanted)], wanted)
        assert not samples.share.any()
    assert len(vertex_samples(lonely).face) == len(lonely.positions), "a vertex without faces has a sample, too"
