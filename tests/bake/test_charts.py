"""Maps of the charts of an atlas: stretch, gradients, areas, clearance, and seams on developable surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from atlases import TILTED, box, cylinder, icosphere, locate, sheet

from wgsss import wgsl
from wgsss.bake.charts import INSIDE, Charts, charts
from wgsss.bake.seams import apply_maps, find_seams
from wgsss.bake.stretch import stretch
from wgsss.bake.unwrap import RenderMesh, unwrap
from wgsss.gpu import Gpu
from wgsss.scene import Mesh

TURN = np.array([[0.8, -0.6], [0.6, 0.8]])
MAPS = {
    "upright": 0.03 * np.eye(2),
    "turned": 0.03 * TURN,
    "mirrored": 0.03 * TURN @ np.diag([1, -1]),
    "sheared": 0.02 * np.array([[1, 0.7], [0, 1]]),
    "4 to 1": 0.04 * TURN @ np.diag([1, 0.25]),
    "4 to 1, sheared": 0.02 * np.array([[1.0, 0.4], [-0.2, 0.25]]),
}


class Baked:
    """The charts of a mesh, read back from the GPU."""

    def __init__(self, gpu: Gpu, mesh: Mesh, size: int) -> None:
        self.mesh, self.size = mesh, size
        self.render_mesh: RenderMesh = unwrap(gpu, mesh)
        made: Charts = charts(gpu, mesh, self.render_mesh, size)
        self.gradient_u = gpu.read_texture(made.gradient_u).astype(np.float64)
        self.gradient_v = gpu.read_texture(made.gradient_v).astype(np.float64)
        self.ids = gpu.read_texture(made.ids)[..., 0]
        raw = np.frombuffer(gpu.queue.read_buffer(made.seams), wgsl.load("charts").layout("array<Seam>").dtype)
        self.maps = np.stack([raw["to_u"], raw["to_v"]], axis=1).astype(np.float64)
        self.inside = self.ids >= INSIDE
        self.gutter = (self.ids > 0) & ~self.inside

    def across(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the centres of gutter texels (N, 2), the points (N, 2) to which seams map them, and the seams (N,)."""
        row, column = np.nonzero(self.gutter)
        uv = np.stack([column + 0.5, row + 0.5], axis=-1) / self.size
        seam = self.ids[row, column].astype(int) - 1
        return uv, apply_maps(self.maps[seam], uv), seam


@pytest.mark.parametrize("name", MAPS)
def test_the_root_inverts_the_metric(gpu: Gpu, name: str) -> None:
    """Check S (J^T J) S = I, where J is the analytic derivative of position by texture coordinate."""
    mesh = sheet(MAPS[name])
    J = TILTED[:2].T @ np.linalg.inv(MAPS[name])
    for S in stretch(mesh, unwrap(gpu, mesh)).root:
        np.testing.assert_allclose(S, S.T)
        np.testing.assert_allclose(S @ (J.T @ J) @ S, np.eye(2), atol=1e-4)


@pytest.mark.parametrize("name", MAPS)
def test_gradients_convert_mm_to_texels(gpu: Gpu, name: str) -> None:
    baked = Baked(gpu, sheet(MAPS[name]), 256)
    expected = 256 * MAPS[name] @ TILTED[:2]
    for got, want in ((baked.gradient_u, expected[0]), (baked.gradient_v, expected[1])):
        assert np.abs(got[baked.inside][:, :3] - want).max() < 1e-3 * np.linalg.norm(want)
        assert not got[~baked.inside].any()


def test_gradients_lie_in_a_bent_surface(gpu: Gpu) -> None:
    """On a coarse cylinder, means over faces are neither too short nor out of the tangent plane."""
    baked = Baked(gpu, cylinder(radius=5, height=20, sides=12), 256)
    column = np.nonzero(baked.inside)[1]
    angle = 2 * np.pi * ((column + 0.5) / 256 - 0.1) / 0.8
    around = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    chord = 12 * 2 * 5 * np.sin(np.pi / 12)
    u, v = baked.gradient_u[baked.inside][:, :3], baked.gradient_v[baked.inside][:, :3]
    np.testing.assert_allclose(np.linalg.norm(u, axis=1), 256 * 0.8 / chord, rtol=2e-3)
    np.testing.assert_allclose(v, np.broadcast_to([0, 0, -256 * 0.6 / 20], v.shape), atol=1e-2)
    middle = (column > 40) & (column < 215)  # at the border there are faces on one side only
    assert (np.einsum("ni,ni->n", u, around)[middle] > 0.995 * np.linalg.norm(u, axis=1)[middle]).all()


def test_texel_areas_sum_to_the_area(gpu: Gpu) -> None:
    for mesh in (icosphere(20, 3), box(cells=3), cylinder(), sheet(MAPS["4 to 1, sheared"])):
        baked = Baked(gpu, mesh, 512)
        per_mm2 = np.linalg.norm(np.cross(baked.gradient_u[..., :3], baked.gradient_v[..., :3]), axis=-1)
        assert (1 / per_mm2[baked.inside]).sum() == pytest.approx(mesh.area, rel=0.01), mesh.name


def test_the_clearance_is_a_tight_lower_bound(gpu: Gpu) -> None:
    left, right = (sheet(np.eye(2) * 0.02, cells=2, center=(x, 0.5)) for x in (0.3, 0.7))  # the two charts touch
    positions = np.concatenate([left.positions, right.positions + np.array([0, 0, 50])])
    faces = np.concatenate([left.faces, right.faces + len(left.positions)])
    touching = Mesh(positions, faces, corner_uvs=np.concatenate([left.corner_uvs, right.corner_uvs]))
    for mesh in (touching, box(3)):
        baked = Baked(gpu, mesh, 64)
        row, column = np.mgrid[-1:65, -1:65]
        labels = np.pad(np.where(baked.inside, baked.ids, 0), 1)
        for i, j in np.argwhere(baked.inside)[::7]:
            distance = np.hypot(row - i, column - j)[labels != baked.ids[i, j]].min()
            assert distance - 1.5 < baked.gradient_u[i, j, 3] <= distance + 0.01


def test_the_gutter_is_three_texels_wide(gpu: Gpu) -> None:
    baked = Baked(gpu, box(1), 256)
    seams = find_seams(baked.render_mesh, stretch(baked.mesh, baked.render_mesh).root)
    row, column = np.nonzero(~baked.inside)
    texel = np.stack([column + 0.5, row + 0.5], axis=-1)
    a, b = 256 * seams.ends[:, 0], 256 * seams.ends[:, 1]
    t = np.clip(np.einsum("nsi,si->ns", texel[:, None] - a, b - a) / ((b - a) ** 2).sum(-1), 0, 1)
    distance = np.linalg.norm(texel[:, None] - a - t[..., None] * (b - a), axis=-1).min(axis=1)
    in_gutter = baked.gutter[row, column]
    assert (distance[in_gutter] < 3.01).all()
    assert in_gutter[distance < 2.99].all()


@pytest.mark.parametrize("seed", range(3))
def test_seams_continue_around_the_edges_of_a_box(gpu: Gpu, seed: int) -> None:
    """A point h mm beyond an edge of one side is mapped to the next side, h mm from the edge."""
    baked = Baked(gpu, box(seed, cells=2), 512)
    uv, to, seam = baked.across()
    seams = find_seams(baked.render_mesh, stretch(baked.mesh, baked.render_mesh).root)
    single = seam < len(seams.maps)  # around corners of the box two seams are applied, and the result is not unique
    uv, to, seam = uv[single], to[single], seam[single]
    assert single.mean() > 0.8
    a, b = seams.ends[seam, 0], seams.ends[seam, 1]
    # A point just inside the middle of the edge is in the chart of the texel; its affine map extends over the edge.
    _, face = locate(baked.mesh, baked.render_mesh, 0.5 * (a + b) - 1e-4 * (to_left(b - a) * seams.outward[seam, None]))
    corners = baked.render_mesh.atlas.astype(float)[baked.render_mesh.faces[face]]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    local = np.linalg.solve(edges, (uv - corners[:, 0])[..., None])[..., 0]
    p = baked.mesh.positions.astype(float)[baked.mesh.faces[face]]
    flat = p[:, 0] + local[:, :1] * (p[:, 1] - p[:, 0]) + local[:, 1:] * (p[:, 2] - p[:, 0])
    folded = np.clip(flat, -5, 5)
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    folded -= n / np.linalg.norm(n, axis=1, keepdims=True) * np.linalg.norm(flat - folded, axis=1, keepdims=True)
    beside_corner = (np.abs(flat) > 5.001).sum(axis=1) > 1
    found, arrived = locate(baked.mesh, baked.render_mesh, to)
    assert (baked.render_mesh.charts[arrived] != baked.render_mesh.charts[face])[~beside_corner].all()
    assert np.abs(found - folded)[~beside_corner].max() < 1e-3


def to_left(edge: np.ndarray) -> np.ndarray:
    return np.stack([-edge[:, 1], edge[:, 0]], axis=-1) / np.linalg.norm(edge, axis=1, keepdims=True)


def test_seams_continue_around_a_cylinder(gpu: Gpu) -> None:
    """Beyond the seam the atlas continues at its other end, in the same row; beyond the open rims it is mirrored."""
    baked = Baked(gpu, cylinder(), 256)
    uv, to, _ = baked.across()
    left, right = uv[:, 0] < 0.1, uv[:, 0] > 0.9
    top, bottom = uv[:, 1] < 0.2, uv[:, 1] > 0.8
    for side, shift in ((left, 0.8), (right, -0.8)):
        beside = side & ~top & ~bottom
        assert beside.sum() > 300
        np.testing.assert_allclose(to[beside], uv[beside] + [shift, 0], atol=1e-5)
    for rim, v in ((top, 0.2), (bottom, 0.8)):
        beside = rim & ~left & ~right
        assert beside.sum() > 500
        np.testing.assert_allclose(to[beside], uv[beside] * [1, -1] + [0, 2 * v], atol=1e-5)


@pytest.mark.parametrize("name", MAPS)
def test_open_edges_mirror_the_surface(gpu: Gpu, name: str) -> None:
    """The reflection keeps distances on the surface, not in the atlas."""
    baked = Baked(gpu, sheet(MAPS[name]), 256)
    uv, to, seam = baked.across()
    back = np.linalg.inv(MAPS[name])
    here, there = (uv - 0.5) @ back.T, (to - 0.5) @ back.T  # mm
    single = seam < 16  # four edges of four cells
    beyond = np.clip(here, -10, 10)
    beside = single & ((np.abs(here) > 10).sum(axis=1) == 1)
    assert beside.sum() > 0.8 * single.sum()
    np.testing.assert_allclose(there[beside], (2 * beyond - here)[beside], atol=2e-3)


@pytest.mark.parametrize("make", [lambda: box(5), cylinder, lambda: icosphere(20, 3), lambda: sheet(MAPS["sheared"])])
def test_a_seam_and_the_seam_back_are_the_identity_on_the_edge(gpu: Gpu, make: object) -> None:
    mesh = make()  # type: ignore[operator]
    render_mesh = unwrap(gpu, mesh)
    seams = find_seams(render_mesh, stretch(mesh, render_mesh).root)
    position = np.stack([locate(mesh, render_mesh, seams.ends[:, k])[0] for k in (0, 1)], axis=1)
    for share in (0.0, 0.3, 1.0):
        point = seams.ends[:, 0] + share * (seams.ends[:, 1] - seams.ends[:, 0])
        there = apply_maps(seams.maps, point)
        # The seam back is the one between the same two positions; at an open edge it is the same seam.
        ends = np.stack([apply_maps(seams.maps, seams.ends[:, k]) for k in (0, 1)], axis=1)
        gap = np.minimum(
            np.abs(seams.ends[None] - ends[:, None]).max(axis=(2, 3)),
            np.abs(seams.ends[None, :, ::-1] - ends[:, None]).max(axis=(2, 3)),
        )
        assert gap.min(axis=1).max() < 1e-6
        np.testing.assert_allclose(apply_maps(seams.maps[gap.argmin(axis=1)], there), point, atol=1e-6)
        np.testing.assert_allclose(
            locate(mesh, render_mesh, there)[0], position[:, 0] + share * (position[:, 1] - position[:, 0]), atol=1e-3
        )


@pytest.mark.parametrize("size", [256, 512])
def test_the_gutter_of_a_closed_surface_is_mapped_to_the_neighbouring_chart(gpu: Gpu, size: int) -> None:
    """On a sphere, a gutter texel is mapped to a point as far from its chart on the surface as it is in the map."""
    baked = Baked(gpu, icosphere(20, 3), size)
    seams = find_seams(baked.render_mesh, stretch(baked.mesh, baked.render_mesh).root)
    uv, to, seam = baked.across()
    single = np.flatnonzero(seam < len(seams.maps))[::5]
    assert len(single) > 0.97 / 5 * len(seam)
    uv, to, seam = uv[single], to[single], seam[single]
    a, b = seams.ends[seam, 0], seams.ends[seam, 1]
    t = np.clip(np.einsum("ni,ni->n", uv - a, b - a) / ((b - a) ** 2).sum(-1), 0, 1)[:, None]
    foot, home = locate(baked.mesh, baked.render_mesh, a + t * (b - a))
    found, away = locate(baked.mesh, baked.render_mesh, to)
    assert (baked.render_mesh.charts[home] != baked.render_mesh.charts[away]).mean() > 0.98
    texel = np.sqrt(baked.mesh.area / baked.inside.sum())  # mm, on average; the atlas is stretched to fill the map
    ratio = np.linalg.norm(found - foot, axis=1) / (texel * size * np.linalg.norm(uv - a - t * (b - a), axis=1))
    assert 0.6 < ratio.min()
    assert ratio.max() < 1.6


@pytest.mark.parametrize("size", [64, 256])
def test_every_gutter_texel_is_mapped_into_a_chart(gpu: Gpu, size: int) -> None:
    thin = sheet(np.array([[0.04, 0], [0, 0.0004]]), center=(0.5, 32.5 / 64))  # one row of texels
    for mesh in (icosphere(20, 3), box(2), cylinder(), thin):
        baked = Baked(gpu, mesh, size)
        _, to, _ = baked.across()
        corner = np.floor(to * size - 0.5).astype(int)
        reached = np.zeros(len(to), bool)
        for step in np.ndindex(2, 2):
            column, row = np.clip(corner + step, 0, size - 1).T
            reached |= baked.inside[row, column]
        assert reached.all(), mesh.name


def test_charts_have_the_same_bits_every_time(
    gpu: Gpu, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = Baked(gpu, box(1), 128)
    monkeypatch.setenv("WGSSS_CACHE", str(tmp_path_factory.mktemp("other")))
    again = Baked(gpu, box(1), 128)
    for name in ("ids", "gradient_u", "gradient_v", "maps"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
