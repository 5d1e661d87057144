"""The render mesh and its atlas: from the texture coordinates of a file, or computed by each library."""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from atlases import box, cylinder, icosphere, sheet

from wgsss.bake import atlas
from wgsss.bake.atlas import LIBRARIES, VARIABLE
from wgsss.bake.charts import INSIDE, charts
from wgsss.bake.unwrap import RenderMesh, is_unique, split, unwrap
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.scene import Mesh, load_mesh


@pytest.fixture(params=LIBRARIES)
def library(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Unwrap by each of the libraries in turn."""
    if not find_spec(request.param):
        pytest.skip(f"{request.param} is not installed")
    monkeypatch.setenv(VARIABLE, request.param)
    return str(request.param)


def joined(*meshes: Mesh) -> Mesh:
    """Join meshes as separate parts of one mesh."""
    starts = np.cumsum([0, *(len(m.positions) for m in meshes)])
    positions = np.concatenate([m.positions + np.array([0, 0, 100 * i]) for i, m in enumerate(meshes)])
    faces = np.concatenate([m.faces + s for m, s in zip(meshes, starts[:-1], strict=True)])
    return Mesh(positions, faces, corner_uvs=np.concatenate([m.corner_uvs for m in meshes]))


def check(mesh: Mesh, render_mesh: RenderMesh) -> None:
    """Check what every render mesh must satisfy."""
    np.testing.assert_array_equal(render_mesh.vertex[render_mesh.faces], mesh.faces)
    np.testing.assert_array_equal(render_mesh.normals[render_mesh.faces], mesh.shading_normals)
    if mesh.corner_uvs is not None:
        np.testing.assert_array_equal(render_mesh.uvs[render_mesh.faces], mesh.corner_uvs)
    rows = np.concatenate(
        [render_mesh.vertex[:, None], render_mesh.normals, render_mesh.atlas, render_mesh.uvs], axis=1
    )
    assert len(np.unique(rows, axis=0)) == len(rows), "a vertex was split without need"
    assert render_mesh.atlas.min() >= 0
    assert render_mesh.atlas.max() <= 1
    assert set(render_mesh.charts) == set(range(render_mesh.charts.max() + 1))
    assert render_mesh.faces.dtype == render_mesh.charts.dtype == render_mesh.vertex.dtype == np.int32
    assert render_mesh.atlas.dtype == render_mesh.uvs.dtype == render_mesh.normals.dtype == np.float32


@pytest.mark.parametrize("make", [box, cylinder, lambda: sheet(0.03 * np.array([[1, 0.5], [0, -1]]))])
def test_unique_coordinates_are_kept(gpu: Gpu, make: object) -> None:
    mesh = make()  # type: ignore[operator]
    render_mesh = unwrap(gpu, mesh)
    check(mesh, render_mesh)
    np.testing.assert_array_equal(render_mesh.atlas[render_mesh.faces], mesh.corner_uvs)
    assert render_mesh.charts.max() + 1 == {"box": 6, "cylinder": 1, "sheet": 1}[mesh.name]


def test_hard_edges_split_normals_but_not_charts(gpu: Gpu) -> None:
    mesh = sheet(np.eye(2) * 0.03, cells=2)
    normals = np.broadcast_to(np.eye(3)[np.arange(len(mesh.faces)) % 3][:, None], (len(mesh.faces), 3, 3))
    hard = Mesh(mesh.positions, mesh.faces, corner_uvs=mesh.corner_uvs, corner_normals=normals)
    render_mesh = unwrap(gpu, hard)
    check(hard, render_mesh)
    assert len(render_mesh.vertex) > len(mesh.positions)
    assert render_mesh.charts.max() == 0


def test_split_makes_no_atlas(gpu: Gpu) -> None:
    smooth = icosphere(10, 2)
    render_mesh = split(smooth)
    assert len(render_mesh.vertex) == len(smooth.positions)
    check(smooth, render_mesh)
    check(box(), split(box()))
    assert not split(box()).atlas.any()


def test_overlapping_coordinates_are_replaced(gpu: Gpu, library: str) -> None:
    left, right = sheet(np.eye(2) * 0.02, center=(0.25, 0.5)), sheet(np.eye(2) * 0.02, center=(0.75, 0.5))
    mirrored = sheet(np.diag([-0.02, 0.02]), center=(0.25, 0.5))
    apart, twice, mirror = joined(left, right), joined(left, left), joined(left, mirrored)
    assert is_unique(gpu, apart, apart.corner_uvs)
    assert not is_unique(gpu, twice, twice.corner_uvs)
    assert not is_unique(gpu, mirror, mirror.corner_uvs)
    assert is_unique(gpu, mirrored, mirrored.corner_uvs)
    little = sheet(np.eye(2) * 0.002, center=(0.25, 0.5))  # has 1 % of the texels of the other
    overlapped = joined(left, little)
    assert not is_unique(gpu, overlapped, overlapped.corner_uvs)
    for mesh in (twice, mirror, overlapped):
        render_mesh = unwrap(gpu, mesh)
        check(mesh, render_mesh)
        assert is_unique(gpu, mesh, render_mesh.atlas[render_mesh.faces])


def test_coordinates_without_area_are_replaced(gpu: Gpu) -> None:
    mesh = sheet(np.eye(2) * 0.03)
    uvs = mesh.corner_uvs.copy()
    uvs[0] = uvs[0, 0]
    assert not is_unique(gpu, mesh, uvs)
    assert not is_unique(gpu, mesh, np.full_like(uvs, 0.5))


def test_coordinates_outside_the_unit_square_are_fitted_into_it(gpu: Gpu) -> None:
    mesh = sheet(np.eye(2) * 0.2, center=(3, -1))
    render_mesh = unwrap(gpu, mesh)
    check(mesh, render_mesh)
    assert render_mesh.charts.max() == 0
    np.testing.assert_allclose(render_mesh.atlas.max(axis=0), 1)


@pytest.mark.parametrize("radius", [20, 1e-3, 1e4])
def test_a_sphere_is_unwrapped(gpu: Gpu, radius: float, library: str) -> None:
    from scipy.ndimage import distance_transform_edt

    mesh = icosphere(radius, 3)
    render_mesh = unwrap(gpu, mesh)
    check(mesh, render_mesh)
    assert is_unique(gpu, mesh, render_mesh.atlas[render_mesh.faces])
    count = render_mesh.charts.max() + 1
    assert count <= 16, "many small charts: the scale of the mesh must not matter"
    ids = gpu.read_texture(charts(gpu, mesh, render_mesh, 1024).ids)[..., 0]
    assert (ids >= INSIDE).mean() > 0.4
    for chart in range(count):
        distance = distance_transform_edt(ids != (INSIDE | chart))
        others = (ids >= INSIDE) & (ids != (INSIDE | chart))
        assert distance[others].min() > 8


def test_the_atlas_is_the_same_every_time(
    gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    first = unwrap(gpu, icosphere(7, 3))
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path))
    np.testing.assert_array_equal(first.atlas, unwrap(gpu, icosphere(7, 3)).atlas)


def test_faces_without_area_are_accepted(gpu: Gpu, library: str) -> None:
    mesh = icosphere(10, 2)
    with_sliver = Mesh(mesh.positions, np.concatenate([mesh.faces, [[0, 1, 1]]]))
    render_mesh = unwrap(gpu, with_sliver)
    check(with_sliver, render_mesh)
    assert np.isfinite(gpu.read_texture(charts(gpu, with_sliver, render_mesh, 128).gradient_u)).all()
    with pytest.raises(InputError, match="no face has an area"):
        unwrap(gpu, Mesh(np.eye(3) * [1, 2, 0], [[0, 1, 1]]))


@pytest.mark.parametrize(
    ("file", "faces", "own"),
    [("lee_perry_smith/LeePerrySmith.obj", None, True), ("spot.obj", None, True), ("bunny_stanford.ply", 6000, False)],
)
def test_scans_are_unwrapped(gpu: Gpu, library: str, data: Path, file: str, faces: int | None, own: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of repairs
        mesh = load_mesh(data / file, size_mm=300).mesh
    if faces:  # an open piece; the whole mesh takes xatlas half a minute
        used, index = np.unique(mesh.faces[:faces], return_inverse=True)
        mesh = Mesh(mesh.positions[used], index.reshape(-1, 3))
    render_mesh = unwrap(gpu, mesh)
    check(mesh, render_mesh)
    assert is_unique(gpu, mesh, render_mesh.atlas[render_mesh.faces])
    assert own == (mesh.corner_uvs is not None and render_mesh.charts.max() < 20)


def test_many_separate_pieces_share_one_page(gpu: Gpu, library: str) -> None:
    random = np.random.default_rng(4)
    corners = (10 * random.normal(size=(1500, 1, 3)) + random.normal(size=(1500, 3, 3))).reshape(-1, 3)
    mesh = Mesh(corners, np.arange(4500).reshape(-1, 3))
    render_mesh = unwrap(gpu, mesh)
    check(mesh, render_mesh)
    assert render_mesh.charts.max() + 1 == 1500
    assert is_unique(gpu, mesh, render_mesh.atlas[render_mesh.faces])


def test_the_library_is_chosen_by_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    def installed(*names: str) -> None:
        monkeypatch.setattr(atlas, "find_spec", lambda name: name in names or None)

    monkeypatch.delenv(VARIABLE, raising=False)
    installed("xatlas", "uvunwrap")
    assert atlas.library() == "xatlas"
    monkeypatch.setenv(VARIABLE, "uvunwrap")
    assert atlas.library() == "uvunwrap"
    installed("xatlas")
    with pytest.raises(InputError, match=r"install the Python package uvunwrap$"):
        atlas.library()
    monkeypatch.setenv(VARIABLE, "xatlsa")
    with pytest.raises(InputError, match=r"unknown library in \$WGSSS_UNWRAP 'xatlsa'; did you mean 'xatlas'"):
        atlas.library()
    monkeypatch.setenv(VARIABLE, "")
    installed("uvunwrap")
    assert atlas.library() == "uvunwrap"
    installed()
    with pytest.raises(InputError, match=r"install the Python package xatlas or uvunwrap$"):
        atlas.library()
