"""The selection `top`, compared with a brute-force search by independently computed form factors."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.published import top as module
from wgsss.bake.sam.published.top import IGNORED_SHARE, SenderSearch, largest_form_factors, select_top
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene import Mesh, material
from wgsss.scene.shapes import ear, gyroid, slab, sphere

EAR, SHELL = ear(1000), gyroid(2000)
BALLS = Mesh(  # two separate balls, close to each other
    np.concatenate([sphere(4.0, 300).positions, sphere(3.0, 200).positions + np.float32([6.0, 4.0, 0.0])]),
    np.concatenate([sphere(4.0, 300).faces, sphere(3.0, 200).faces + len(sphere(4.0, 300).positions)]),
)
# An ear of which one part has fans 16 times as small as the rest.
UNEVEN = Mesh(
    *trimesh.remesh.subdivide(*trimesh.remesh.subdivide(EAR.positions, EAR.faces, range(0, 900)), range(0, 900))
)


def sums(mesh: Mesh, profile: Profile, receivers: np.ndarray) -> np.ndarray:
    """Return form factors (R, V), summed over the channels, of all vertices on the back sides of receivers (R,).

    They are sums over eight points in each quad: the centroids of the quarters of its two halves.
    """
    a, ab, ac, middle = np.array([[1, 0, 0], [1 / 2, 1 / 2, 0], [1 / 2, 0, 1 / 2], [1 / 3, 1 / 3, 1 / 3]])
    quarters = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6.0
    share = np.concatenate([quarters @ half for half in ([a, ab, middle], [a, middle, ac])])
    x, n = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    turned = np.stack([np.roll(mesh.faces, -k, axis=1) for k in range(3)], axis=1).reshape(-1, 3)
    points = np.einsum("sk,qkd->qsd", share, x[turned]).reshape(-1, 3)
    owner = np.repeat(turned[:, 0], len(share))
    area = np.repeat(np.linalg.norm(mesh.face_normals, axis=1) / 6.0 / len(share), 3 * len(share))
    r = np.geomspace(1e-3, 2.0 * np.linalg.norm(np.ptp(x, axis=0)), 4000)
    R = profile.reflectance(r).sum(axis=1)
    K = np.zeros((len(receivers), len(x)))
    reach = profile.range(IGNORED_SHARE).max()
    for row, o in enumerate(receivers):
        back = ((x - x[o]) @ n[o] < 0) & (n @ n[o] < 0) & (np.linalg.norm(x - x[o], axis=1) < reach)
        chosen = np.flatnonzero(back[owner])
        for p in np.flatnonzero(owner == o):
            distance = np.linalg.norm(points[chosen] - points[p], axis=1)
            share_of_o = area[p] / area[owner == o].sum()
            K[row] += share_of_o * np.bincount(owner[chosen], area[chosen] * np.interp(distance, r, R), len(x))
    return K


@pytest.mark.parametrize(
    ("mesh", "name", "n"),
    [
        *((EAR, "skin1", n) for n in (1, 3, 8, 50)),
        *((SHELL, "marble", n) for n in (1, 3)),
        *((BALLS, "wholemilk", n) for n in (3, 8)),
        (UNEVEN, "marble", 3),
        (slab(size=(10.0, 10.0, 0.5), vertices=300), "skin1", 8),
    ],
)
def test_top_finds_the_largest_form_factors_of_a_brute_force_search(gpu: Gpu, mesh: Mesh, name: str, n: int) -> None:
    profile = material(name).profile
    sender_map = select_top(gpu, mesh, profile, n)
    receivers = np.random.default_rng(n).choice(len(mesh.positions), 8, replace=False)
    K = sums(mesh, profile, receivers)
    largest = -np.sort(-K, axis=1)[:, :n]
    sender, weight = sender_map.sender[receivers], sender_map.weight[receivers].sum(axis=2)
    assert sender_map.sender_count == len(mesh.positions) and sender_map.sender.shape == (len(mesh.positions), n)
    own = np.where(sender >= 0, np.take_along_axis(K, sender.astype(np.int64), axis=1), 0.0)
    unit = largest[:, :1] + 1e-12
    np.testing.assert_allclose(weight / unit, own / unit, atol=0.03)
    np.testing.assert_allclose(own.sum(axis=1), largest.sum(axis=1), rtol=0.01, atol=1e-7)
    assert (np.diff(weight, axis=1) <= 1e-9).all(), "in falling order"
    assert ((weight > 0) == (sender >= 0)).all()
    assert all(len(set(row[row >= 0])) == (row >= 0).sum() for row in sender)


def test_the_search_is_repeated_with_more_blocks_or_dispatches(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    profile = material("marble").profile
    whole = select_top(gpu, SHELL, profile, 3)
    monkeypatch.setattr(module, "_CANDIDATES", 2)
    monkeypatch.setattr(module, "_MAX_GROUPS", 20)
    np.testing.assert_array_equal(select_top(gpu, SHELL, profile, 3).sender, whole.sender)
    uneven = select_top(gpu, UNEVEN, profile, 3)
    monkeypatch.setattr(module, "_CANDIDATES", 10_000)
    np.testing.assert_array_equal(select_top(gpu, UNEVEN, profile, 3).sender, uneven.sender)
    search = SenderSearch(gpu, EAR, profile, FormFactors(gpu, EAR, profile), 90)
    groups = np.arange(search.blocks.receivers.stop)
    np.testing.assert_array_equal(search._search(groups, 64, 1), search._search(groups, 64, 64))


def test_with_a_mask_of_senders_only_the_other_vertices_receive(gpu: Gpu) -> None:
    profile, V = material("wholemilk").profile, len(BALLS.positions)
    sending = np.arange(V) >= V // 2
    sender, K = largest_form_factors(gpu, BALLS, profile, 3, sending=sending)
    assert (sender[sending] == -1).all() and (K[sending] == 0).all()
    receivers = np.arange(0, V // 2, 40)
    largest = -np.sort(-np.where(sending, sums(BALLS, profile, receivers), 0.0), axis=1)[:, :3]
    assert sending[sender[sender >= 0]].all() and (sender >= 0).any()
    np.testing.assert_allclose(K[receivers].sum(axis=(1, 2)), largest.sum(axis=1), rtol=0.02, atol=1e-6)


def test_flat_sheets_and_vertices_without_faces_have_no_entries(gpu: Gpu) -> None:
    """Both inequalities of Maisch & Ropinski 2017 (eq. 13, 14) are strict: coplanar points belong to the front side."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(9.0), np.arange(9.0)))
    corner = np.arange(81).reshape(9, 9)[:-1, :-1].ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 10], 1), np.stack([corner, corner + 10, corner + 9], 1)]
    )
    sheet = Mesh(np.stack([x, y, 0 * x], axis=1), faces)
    assert (select_top(gpu, sheet, material("skin1").profile, 3).sender == -1).all()
    with_lone_vertex = Mesh(np.concatenate([EAR.positions, [[0, 0, 0]]]), EAR.faces)
    sender_map = select_top(gpu, with_lone_vertex, material("skin1").profile, 3)
    assert (sender_map.sender[-1] == -1).all() and (sender_map.weight[-1] == 0).all()
    assert not (sender_map.sender == len(EAR.positions)).any() and (sender_map.sender >= 0).any()


def test_senders_beyond_the_range_of_the_profile_are_ignored(gpu: Gpu) -> None:
    ball = sphere(60.0, 400)
    assert (select_top(gpu, ball, material("skin1").profile, 3).sender == -1).all()
