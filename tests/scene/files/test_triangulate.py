"""Triangulation of polygons keeps area and winding, makes no triangles without area, and terminates."""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from wgsss.errors import InputError
from wgsss.scene.files.triangulate import MAX_CORNERS, triangulate

FILE = Path("mesh.obj")


def split(*polygons, notes: list[str] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate polygons. Return the area vectors (T, 3) of the triangles, and the polygon of each (T,)."""
    positions = np.array([point for polygon in polygons for point in polygon], np.float64)
    counts = np.array([len(polygon) for polygon in polygons])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        triangles, faces = triangulate(
            FILE, positions, np.arange(len(positions)), counts, [] if notes is None else notes
        )
    assert (np.diff(faces) >= 0).all() and triangles.shape == (len(faces), 3)
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    with np.errstate(all="ignore"):
        return np.cross(b - a, c - a) / 2, faces


def flat(*points: tuple[float, float], turn: np.ndarray | None = None) -> np.ndarray:
    polygon = np.array([(x, y, 0) for x, y in points], np.float64)
    return polygon if turn is None else polygon @ turn.T


def rotation(seed: int) -> np.ndarray:
    matrix = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return matrix * np.linalg.det(matrix)


CONCAVE = {
    "arrow": flat((0, 0), (4, 0), (1, 1), (0, 4)),
    "corner": flat((0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)),
    "comb": flat((0, 0), (7, 0), (7, 5), (6, 5), (6, 1), (5, 1), (5, 5), (4, 5), (4, 1), (3, 1), (3, 5), (0, 5)),
    "with straight corners": flat((0, 0), (1, 0), (2, 0), (4, 0), (4, 2), (4, 4), (2, 2), (0, 4), (0, 3), (0, 1)),
    "a triangle with straight corners": flat((0, 0), (1, 0), (2, 0), (1, 1), (0, 2)),
    "hole with a bridge": flat((0, 0), (6, 0), (6, 6), (0, 6), (0, 0), (2, 2), (2, 4), (4, 4), (4, 2), (2, 2)),
    "spiral": flat((0, 0), (6, 0), (6, 6), (1, 6), (1, 3), (3, 3), (3, 4), (2, 4), (2, 5), (5, 5), (5, 1), (0, 1)),
}


@pytest.mark.parametrize("name", CONCAVE)
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
@pytest.mark.parametrize("start", [0, 1, 3])
def test_concave_polygons(name: str, seed: int | None, start: int) -> None:
    polygon = np.roll(CONCAVE[name], start, axis=0)
    turn = np.eye(3) if seed is None else rotation(seed)
    x, y, _ = polygon.T
    expected = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    for order in (1, -1):
        areas, faces = split(polygon[::order] @ turn.T * 1e-3 + 0.5)
        up = areas @ turn[:, 2] * order
        assert len(faces) == len(polygon) - 2
        assert (up > 0).all(), "a triangle is flipped, or has no area"
        assert up.sum() == pytest.approx(expected * 1e-6)


def test_nearly_straight_corners_give_no_slivers() -> None:
    rng = np.random.default_rng(0)
    ends = flat((0, 0), (9, 0), (9, 3), (4, 3), (4, 9), (0, 9), turn=rotation(4))
    shares = np.linspace(0, 1, 7)[:-1, None, None]
    polygon = (ends * (1 - shares) + np.roll(ends, -1, axis=0) * shares).transpose(1, 0, 2).reshape(-1, 3)
    for _ in range(20):
        areas, _ = split(polygon + rng.uniform(-5e-7, 5e-7, polygon.shape))
        assert np.linalg.norm(areas, axis=1).min() > 0.1


def test_convex_polygons_are_fans_from_their_first_corner() -> None:
    angles = np.arange(7) * 2 * np.pi / 7
    polygon = np.stack([np.cos(angles), np.sin(angles), 0.1 * np.cos(2 * angles)], axis=1)
    triangles, _ = triangulate(FILE, polygon, np.arange(7), np.array([7]), [])
    assert triangles.tolist() == [[0, i, i + 1] for i in range(1, 6)]


def test_the_corners_of_many_faces_keep_their_order() -> None:
    square, triangle = flat((0, 0), (1, 0), (1, 1), (0, 1)), flat((0, 0), (1, 0), (0, 1))
    notes: list[str] = []
    areas, faces = split(square, triangle, CONCAVE["arrow"], flat((0, 0), (1, 1)), square, notes=notes)
    assert faces.tolist() == [0, 0, 1, 2, 2, 4, 4]
    assert areas[:, 2].tolist() == [0.5, 0.5, 0.5, 2, 2, 0.5, 0.5]
    assert notes == ["1 faces of fewer than three corners are left out"]


def test_polygons_that_cross_themselves_keep_all_edges() -> None:
    angles = np.arange(5) * 4 * np.pi / 5
    star = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    folded = np.array([(0, 0, 0), (0.49, 0.25, 0), (0.5, 0.246, 0), (0.02, 0.12, 0.05)])
    for polygon in (star, folded, flat((0, 0), (1, 1), (1, 0), (0, 1)), flat((0, 0), (2, 0), (2, 2), (1, -1), (0, 2))):
        count = len(polygon)
        triangles, _ = triangulate(FILE, polygon, np.arange(count), np.array([count]), [])
        edges = {(int(t[i]), int(t[i - 2])) for t in triangles for i in range(3)}
        assert len(triangles) == count - 2 and {(i, (i + 1) % count) for i in range(count)} <= edges


def test_a_folded_quad_is_split_along_the_diagonal_with_less_area() -> None:
    areas, _ = split([(0, 0, 0), (1, 1, 0), (1, 0, 0.1), (0, 1, 0.1)])
    other, _ = split([(1, 1, 0), (1, 0, 0.1), (0, 1, 0.1), (0, 0, 0)])
    np.testing.assert_allclose(*(np.linalg.norm(a, axis=1).sum() for a in (areas, other)))


@pytest.mark.parametrize(
    "polygon",
    [
        flat(*[(0, 0)] * 6),
        flat(*[(i, 0) for i in range(5)]),
        flat((0, 0), (1, 1), (1, 0), (0, 1)),
        flat((0, 0), (1, 0), (0, 0), (1, 0)),
        flat((0, 0), (4, 0), (2, 0), (2, 2), (2, 0), (0, 0)),
        np.array([(0, 0, 0), (1, 0, np.nan), (1, 1, 0), (0, 1, np.inf)]),
        np.array([(1e308, 0, 0), (-1e308, 0, 0), (0, 1e308, 0), (0, -1e308, 5)]),
        np.array([(0, 0, 0), (5e-324, 0, 0), (5e-324, 5e-324, 0), (0, 5e-324, 0)]),
    ],
)
def test_degenerate_polygons_terminate(polygon: np.ndarray) -> None:
    assert len(split(polygon)[1]) >= 1, "degenerate triangles are returned for the caller to count"


def test_repeated_corners_are_left_out() -> None:
    areas, _ = split(flat((0, 0), (0, 0), (1, 0), (1, 1), (1, 1), (0, 1)))
    assert len(areas) == 2 and areas[:, 2].sum() == 1.0


def test_large_polygons_take_little_time() -> None:
    angles = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    radius = 1 + 0.2 * np.cos(angles * 500)
    rng = np.random.default_rng(0)
    start = time.perf_counter()
    areas, _ = split(np.stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles], axis=1))
    assert areas[:, 2].sum() == pytest.approx(np.pi * 1.02, rel=1e-3)
    split(np.concatenate([rng.uniform(size=(5000, 2)), np.zeros((5000, 1))], axis=1))
    assert time.perf_counter() - start < 10.0


def test_a_concave_face_with_too_many_corners_is_refused() -> None:
    wild = np.random.default_rng(0).uniform(size=(MAX_CORNERS + 1, 3))
    with pytest.raises(InputError, match=r"mesh.obj: a face of 100001 corners is too large"):
        split(wild)


def test_a_mesh_without_a_face_of_three_corners_is_empty() -> None:
    with pytest.raises(InputError, match="no face has three corners"):
        split(flat((0, 0), (1, 0)))
    with pytest.raises(InputError, match="it has no faces"):
        triangulate(FILE, np.zeros((3, 3)), np.empty(0, np.int64), np.empty(0, np.int64), [])
