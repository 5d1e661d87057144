"""The vertices of largest form factor: against a search through all of them, by other sums."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.sam.published import top as module
from wgsss.bake.sam.published.top import BEYOND, SenderSearch, largest_form_factors, select_top
from wgsss.gpu import Gpu
from wgsss.optics import Profile
from wgsss.scene import Mesh, material
from wgsss.scene.shapes import ear, gyroid, slab, sphere

EAR, SHELL = ear(1000), gyroid(2000)
PARTS = Mesh(  # a ball within a short way of another
    np.concatenate([sphere(4.0, 300).positions, sphere(3.0, 200).positions + np.float32([6.0, 4.0, 0.0])]),
    np.concatenate([sphere(4.0, 300).faces, sphere(3.0, 200).faces + len(sphere(4.0, 300).positions)]),
)
# Some fans a 16th of others.
HALF = Mesh(
    *trimesh.remesh.subdivide(*trimesh.remesh.subdivide(EAR.positions, EAR.faces, range(0, 900)), range(0, 900))
)


def sums(mesh: Mesh, profile: Profile, receivers: np.ndarray) -> np.ndarray:
    """K (R, V) of all channels, 0 in front: by the middles of the quarters of both halves of each quad."""
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
    reach = profile.range(BEYOND).max()
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
        *((PARTS, "wholemilk", n) for n in (3, 8)),
        (HALF, "marble", 3),
        (slab(size=(10.0, 10.0, 0.5), vertices=300), "skin1", 8),
    ],
)
def test_they_are_those_of_a_search_through_all(gpu: Gpu, mesh: Mesh, name: str, n: int) -> None:
    profile = material(name).profile
    found = select_top(gpu, mesh, profile, n)
    receivers = np.random.default_rng(n).choice(len(mesh.positions), 8, replace=False)
    K = sums(mesh, profile, receivers)
    largest = -np.sort(-K, axis=1)[:, :n]
    sender, weight = found.sender[receivers], found.weight[receivers].sum(axis=2)
    assert found.sender_count == len(mesh.positions) and found.sender.shape == (found.sender_count, n)
    own = np.where(sender >= 0, np.take_along_axis(K, sender.astype(np.int64), axis=1), 0.0)
    unit = largest[:, :1] + 1e-12
    np.testing.assert_allclose(weight / unit, own / unit, atol=0.03)
    np.testing.assert_allclose(own.sum(axis=1), largest.sum(axis=1), rtol=0.01, atol=1e-7)
    assert (np.diff(weight, axis=1) <= 1e-9).all(), "the largest first"
    assert ((weight > 0) == (sender >= 0)).all()
    assert all(len(set(row[row >= 0])) == (row >= 0).sum() for row in sender)


def test_groups_that_want_more_blocks_or_turns_get_them(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    profile = material("marble").profile
    whole = select_top(gpu, SHELL, profile, 3)
    monkeypatch.setattr(module, "_LISTED", 2)
    monkeypatch.setattr(module, "_CHUNK", 20)
    np.testing.assert_array_equal(select_top(gpu, SHELL, profile, 3).sender, whole.sender)
    uneven = select_top(gpu, HALF, profile, 3)
    monkeypatch.setattr(module, "_LISTED", 10_000)
    np.testing.assert_array_equal(select_top(gpu, HALF, profile, 3).sender, uneven.sender)
    search = SenderSearch(gpu, EAR, profile, FormFactors(gpu, EAR, profile), 90)
    groups = np.arange(search.blocks.receivers.stop)
    np.testing.assert_array_equal(search._best(groups, 64, 1), search._best(groups, 64, 64))


def test_only_some_send_and_the_others_receive(gpu: Gpu) -> None:
    profile, V = material("wholemilk").profile, len(PARTS.positions)
    sending = np.arange(V) >= V // 2
    sender, K = largest_form_factors(gpu, PARTS, profile, 3, sending=sending)
    assert (sender[sending] == -1).all() and (K[sending] == 0).all()
    receivers = np.arange(0, V // 2, 40)
    largest = -np.sort(-np.where(sending, sums(PARTS, profile, receivers), 0.0), axis=1)[:, :3]
    assert sending[sender[sender >= 0]].all() and (sender >= 0).any()
    np.testing.assert_allclose(K[receivers].sum(axis=(1, 2)), largest.sum(axis=1), rtol=0.02, atol=1e-6)


def test_a_flat_sheet_has_no_back_and_what_has_no_fan_no_entries(gpu: Gpu) -> None:
    """000 eq. 13 and 14 are strict: coplanar points, and normals at a right angle, are front."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(9.0), np.arange(9.0)))
    corner = np.arange(81).reshape(9, 9)[:-1, :-1].ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 10], 1), np.stack([corner, corner + 10, corner + 9], 1)]
    )
    sheet = Mesh(np.stack([x, y, 0 * x], axis=1), faces)
    assert (select_top(gpu, sheet, material("skin1").profile, 3).sender == -1).all()
    alone = Mesh(np.concatenate([EAR.positions, [[0, 0, 0]]]), EAR.faces)
    found = select_top(gpu, alone, material("skin1").profile, 3)
    assert (found.sender[-1] == -1).all() and (found.weight[-1] == 0).all()
    assert not (found.sender == len(EAR.positions)).any() and (found.sender >= 0).any()


def test_beyond_the_profiles_range_nothing_is_found(gpu: Gpu) -> None:
    ball = sphere(60.0, 400)
    assert (select_top(gpu, ball, material("skin1").profile, 3).sender == -1).all()
