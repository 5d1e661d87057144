"""Shapes built by code: closed, with the documented size, thickness and vertex count."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wgsss.errors import InputError
from wgsss.scene import shapes
from wgsss.scene.mesh import Mesh

COUNTS = {
    "slab": (100, 700, 20_000),
    "sphere": (90, 700, 20_000),
    "capsule": (50, 700, 20_000),
    "ear": (500, 2000, 20_000),
    "leaf": (1000, 4000, 20_000),
    "gyroid": (2000, 30_000),
    "milk": (5000, 30_000),
    "statue": (5000, 60_000),
    "head": (1000, 20_000),
}
EVERY = [(name, count) for name, counts in COUNTS.items() for count in (None, *counts)]
SIZES_MM = {
    "slab": (40, 40, 4),
    "sphere": (40, 40, 40),
    "capsule": (18, 60, 18),
    "ear": (32, 60, 21),
    "leaf": (38, 80, 12),
    "gyroid": (50, 50, 50),
    "milk": (66, 33, 56),
    "statue": (96, 150, 86),
    "head": (164, 230, 214),
}


def make(name: str, vertices: int | None = None) -> Mesh:
    return getattr(shapes, name)(vertices=vertices)


def corners(mesh: Mesh) -> np.ndarray:
    return mesh.positions.astype(np.float64)[mesh.faces]


def volume(mesh: Mesh) -> float:
    a, b, c = corners(mesh).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def edges(mesh: Mesh) -> np.ndarray:
    return np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])


def pieces(mesh: Mesh) -> int:
    pairs = edges(mesh)
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(mesh.positions),) * 2)
    return connected_components(graph, directed=False)[0]


def shape_quality(mesh: Mesh) -> np.ndarray:
    """Compute the quality of triangles: 1 if equilateral, 0 without area."""
    corner = corners(mesh)
    squared = ((corner - np.roll(corner, 1, axis=1)) ** 2).sum(axis=(1, 2))
    return 2 * math.sqrt(3) * np.linalg.norm(mesh.face_normals, axis=1) / squared


def thickness(mesh: Mesh, faces: np.ndarray) -> np.ndarray:
    """Compute the distance, mm, from the centre of each face through the body to the opposite side."""
    a, b, c = corners(mesh).transpose(1, 0, 2)
    unit = mesh.face_normals / np.linalg.norm(mesh.face_normals, axis=1, keepdims=True)
    distances = []
    for face in faces:
        origin, direction = (a[face] + b[face] + c[face]) / 3, -unit[face]
        p = np.cross(direction, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1 / np.einsum("ij,ij->i", b - a, p)
            u = np.einsum("ij,ij->i", origin - a, p) * scale
            q = np.cross(origin - a, b - a)
            v, along = q @ direction * scale, np.einsum("ij,ij->i", c - a, q) * scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > 1e-3)
        distances.append(along[hit].min())
    return np.array(distances)


@pytest.mark.parametrize(("name", "count"), EVERY)
def test_closed_and_wound_outwards(name: str, count: int | None) -> None:
    mesh = make(name, count)
    pairs = edges(mesh).astype(np.int64)
    forward, back = (pairs[:, i] * len(mesh.positions) + pairs[:, 1 - i] for i in (0, 1))
    assert len(np.unique(forward)) == len(forward), "an edge has two faces with the same direction"
    assert np.array_equal(np.sort(forward), np.sort(back)), "an edge has only one face"
    assert len(np.unique(mesh.faces)) == len(mesh.positions) == len(np.unique(mesh.positions, axis=0))
    assert volume(mesh) > 0
    # Corners of faces at a vertex, connected across shared edges, must form one group (a fan) at each vertex.
    corner = np.arange(len(pairs)).reshape(3, -1)
    partner = np.argsort(forward)[np.searchsorted(np.sort(forward), back)]
    across = np.roll(corner, -1, axis=0).ravel()[partner]  # the end of the opposite half-edge
    graph = coo_array((np.ones(len(pairs)), (corner.ravel(), across)), shape=(len(pairs),) * 2)
    assert connected_components(graph, directed=False)[0] == len(mesh.positions), "faces touch in a single vertex"


@pytest.mark.parametrize(("name", "count"), [(n, c) for n, c in EVERY if c])
def test_vertex_count_is_near_the_request(name: str, count: int) -> None:
    assert len(make(name, count).positions) == pytest.approx(count, rel=0.3)


@pytest.mark.parametrize("name", SIZES_MM)
def test_size_triangles_and_pieces(name: str) -> None:
    mesh = make(name)
    assert np.ptp(mesh.positions, axis=0) == pytest.approx(SIZES_MM[name], rel=0.03)
    quality = shape_quality(mesh)
    assert np.percentile(quality, 1) > 0.3 and quality.min() > 0.02 and np.median(quality) > 0.7
    assert pieces(mesh) == 1 if name != "milk" else pieces(mesh) >= 12


@pytest.mark.parametrize("name", ["gyroid", "milk", "statue", "head"])
def test_tessellation_does_not_change_the_shape(name: str) -> None:
    coarse, fine = make(name, COUNTS[name][0]), make(name, 40_000)
    assert volume(coarse) == pytest.approx(volume(fine), rel=0.06)
    assert coarse.area == pytest.approx(fine.area, rel=0.08)


def test_slab_is_exact_with_hard_edges() -> None:
    mesh = shapes.slab(size=(30, 20, 5), vertices=2000)
    assert volume(mesh) == pytest.approx(30 * 20 * 5)
    assert mesh.area == pytest.approx(2 * (30 * 20 + 20 * 5 + 5 * 30))
    unit = mesh.face_normals / np.linalg.norm(mesh.face_normals, axis=1, keepdims=True)
    assert mesh.corner_normals is not None
    assert np.allclose(mesh.corner_normals, unit[:, None, :])


@pytest.mark.parametrize("size", [(40, 40, 4), (30, 20, 50), (10, 60, 10)])
def test_slab_charts_are_separate_and_have_one_scale(size: tuple[float, float, float]) -> None:
    mesh = shapes.slab(size=size, vertices=1000)
    uvs = np.asarray(mesh.corner_uvs, dtype=np.float64)
    (ua, va), (ub, vb), (uc, vc) = uvs.transpose(1, 2, 0)
    flat = (ub - ua) * (vc - va) - (uc - ua) * (vb - va)
    assert (flat < 0).all(), "v grows downwards, so charts seen from outside are clockwise in (u, v)"
    scale = -flat / np.linalg.norm(mesh.face_normals, axis=1)
    assert scale == pytest.approx(scale[0] * np.ones_like(scale), rel=1e-3)
    assert uvs.min() >= 0.019 and uvs.max() <= 0.981

    side = np.argmax(np.abs(mesh.face_normals), axis=1) * 2 + (mesh.face_normals.sum(axis=1) > 0)
    boxes = [(uvs[side == k].min(axis=(0, 1)), uvs[side == k].max(axis=(0, 1))) for k in range(6)]
    for k, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:k]:
            assert np.maximum(low - other_high, other_low - high).max() > 0.019


def test_sphere_approaches_the_closed_forms() -> None:
    mesh = shapes.sphere(radius=20, vertices=20_000)
    assert np.linalg.norm(mesh.positions, axis=1) == pytest.approx(20, rel=1e-6)
    assert volume(mesh) == pytest.approx(4 / 3 * math.pi * 20**3, rel=1e-3)
    assert mesh.area == pytest.approx(4 * math.pi * 20**2, rel=1e-3)
    assert len(mesh.positions) == 10 * 45**2 + 2, "every frequency, not only powers of two"


def test_capsule_approaches_the_closed_forms() -> None:
    mesh = shapes.capsule(length=60, radius=9, vertices=20_000)
    assert volume(mesh) == pytest.approx(math.pi * 81 * 42 + 4 / 3 * math.pi * 729, rel=2e-3)
    assert mesh.area == pytest.approx(2 * math.pi * 9 * 60, rel=2e-3)


def test_ear_is_a_thin_shell_with_a_thick_rim() -> None:
    mesh = shapes.ear()
    middle = corners(mesh).mean(axis=1)
    at_back = mesh.face_normals[:, 2] < -0.8 * np.linalg.norm(mesh.face_normals, axis=1)
    inside = np.hypot(middle[:, 0] / 9, (middle[:, 1] - 4) / 18) < 1
    shell = thickness(mesh, np.flatnonzero(at_back & inside)[::5])
    assert 1.6 < np.median(shell) < 3.5 and np.percentile(shell, 5) > 1.0
    top = thickness(mesh, np.flatnonzero(at_back & (middle[:, 1] > 26)))
    assert np.median(top) > 4.0


def test_leaf_is_a_thin_sheet_with_thick_veins() -> None:
    mesh = shapes.leaf()
    middle = corners(mesh).mean(axis=1)
    below = mesh.face_normals[:, 2] < -0.8 * np.linalg.norm(mesh.face_normals, axis=1)
    blade = below & (np.abs(middle[:, 0]) > 4) & (np.abs(middle[:, 0]) < 12) & (np.abs(middle[:, 1] - 40) < 12)
    sheet = thickness(mesh, np.flatnonzero(blade)[::10])
    assert 0.25 < np.median(sheet) < 0.42 and sheet.min() > 0.2
    assert sheet.max() > 0.55, "side veins"
    midrib = below & (np.abs(middle[:, 0]) < 0.4) & (np.abs(middle[:, 1] - 40) < 8)
    assert np.median(thickness(mesh, np.flatnonzero(midrib))) > 0.7


def test_gyroid_is_a_wall() -> None:
    mesh = shapes.gyroid()
    middle = corners(mesh).mean(axis=1)
    inside = np.flatnonzero(np.linalg.norm(middle, axis=1) < 20)[::40]
    assert thickness(mesh, inside) == pytest.approx(1.8, abs=0.25)


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize("count", [0, -5, 10_000_000, 2000.5])
def test_a_count_out_of_range_is_an_error_that_names_the_range(name: str, count: float) -> None:
    with pytest.raises(InputError, match=rf"{name}: vertices must be a whole number from \d+ to \d+, not {count}"):
        make(name, count)  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [(40, 40), (40, 0, 4), (40, math.nan, 4)])
def test_a_slab_needs_three_lengths(size: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="three lengths above 0 mm"):
        shapes.slab(size=size)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="radius must be above 0 mm"):
        shapes.sphere(radius=-1)
