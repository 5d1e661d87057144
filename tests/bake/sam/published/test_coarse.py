"""The selection `coarse`: the places and areas of its senders, and the error of M_back."""

from __future__ import annotations

import numpy as np

from wgsss.bake.sam.fans import fan_areas
from wgsss.bake.sam.published.coarse import select_coarse, simplified, spacing
from wgsss.bake.sam.published.top import select_top
from wgsss.gpu import Gpu
from wgsss.optics import SumOfGaussians
from wgsss.scene import Mesh, material
from wgsss.scene.shapes import ear, slab, sphere

EAR, SKIN = ear(4000), material("skin1").profile


def test_n_senders_cover_the_disc_that_the_light_leaves_from() -> None:
    for n in (3, 12):
        simple = simplified(EAR, SKIN, n)
        radius = SKIN.range(0.15 * np.sqrt(3 / n)).max()
        np.testing.assert_allclose(n * EAR.area / len(simple.positions), np.pi * radius**2, rtol=0.05)
        np.testing.assert_allclose(n * spacing(SKIN, n) ** 2, np.pi * radius**2, rtol=0.01)
        assert abs(simple.area / EAR.area - 1.0) < 0.05
    ball = sphere(60.0, 200)
    assert simplified(ball, SKIN, 3) is ball, "a mesh that is coarse already is not simplified"


def test_senders_are_evenly_spaced_on_flat_and_curved_regions() -> None:
    for mesh in (slab(size=(30.0, 30.0, 2.0), vertices=6000), EAR):
        area = fan_areas(simplified(mesh, SKIN, 3))
        assert area.std() < 0.5 * area.mean() and area.max() < 2.5 * area.mean()


def test_senders_lie_on_the_mesh_and_face_the_same_way(gpu: Gpu) -> None:
    sender_map = select_coarse(gpu, EAR, SKIN, 3)
    simple, samples = simplified(EAR, SKIN, 3), sender_map.sender_samples
    assert samples is not None and sender_map.tree is None
    assert sender_map.sender_count == len(simple.positions) == len(samples.face) < 0.2 * len(EAR.positions)
    assert sender_map.sender.shape == (len(EAR.positions), 3) and sender_map.sender.max() < sender_map.sender_count
    faces = EAR.faces[samples.face]
    x = np.einsum("sk,skd->sd", samples.barycentric, EAR.positions[faces])
    n = np.einsum("sk,skd->sd", samples.barycentric, EAR.normals[faces])
    apart = np.linalg.norm(x - simple.positions, axis=1)
    assert np.median(apart) < 0.1 * spacing(SKIN, 3) and apart.max() < 0.5 * spacing(SKIN, 3)
    assert np.einsum("sk,sk->s", n, simple.normals).min() > 0.0


def test_senders_stay_on_their_side_of_a_thin_shell(gpu: Gpu) -> None:
    outer, inner = sphere(5.0, 2000), sphere(4.93, 1900)
    faces = np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.positions)])
    shell = Mesh(np.concatenate([outer.positions, inner.positions]), faces)
    simple, samples = simplified(shell, SKIN, 3), select_coarse(gpu, shell, SKIN, 3).sender_samples
    assert samples is not None and len(simple.positions) < 1000
    n = np.einsum("sk,skd->sd", samples.barycentric, shell.normals[shell.faces[samples.face]])
    assert np.einsum("sk,sk->s", n, simple.normals).min() > 0.5


def test_the_areas_of_all_senders_sum_to_that_of_the_mesh(gpu: Gpu) -> None:
    """Where R_d is constant over the mesh, a form factor is the area of the sender times R_d."""
    ball, level = sphere(5.0, 2000), SumOfGaussians(np.array([1e6]), np.ones((1, 3)))
    sender_map = select_coarse(gpu, ball, level, 80)
    assert sender_map.sender_count < 80, "so that each is a sender of some receiver"
    areas = sender_map.weight[..., 0].astype(np.float64) / level.reflectance(0.0)[0]
    is_used = sender_map.sender >= 0
    each = np.bincount(sender_map.sender[is_used], areas[is_used]) / np.bincount(sender_map.sender[is_used])
    np.testing.assert_allclose(each.sum(), ball.area, rtol=1e-3)


def test_uniform_light_through_a_plate_is_the_integral_of_a_gaussian(gpu: Gpu) -> None:
    plate = slab(size=(30.0, 30.0, 2.0), vertices=3000)
    profile = SumOfGaussians(np.array([2.0]), np.array([[0.2, 0.4, 0.6]]))
    sender_map = select_coarse(gpu, plate, profile, 60)
    assert 60 < sender_map.sender_count < 3000
    inner = (np.abs(plate.positions[:, :2]) < 8.0).all(axis=1)
    M = sender_map.weight[inner].sum(axis=1).mean(axis=0)  # about a thirtieth of the light is left out
    np.testing.assert_allclose(M, profile.total * np.exp(-(2.0**2) / 4.0), rtol=0.06)


def test_coarse_has_a_smaller_error_than_top_on_a_fine_mesh(gpu: Gpu) -> None:
    """On a fine mesh, a few vertices leave out most of the light (Maisch & Ropinski 2017, section 5.2)."""
    x, n, area = EAR.positions.astype(np.float64), EAR.normals.astype(np.float64), fan_areas(EAR)
    o = np.random.default_rng(0).choice(len(x), 60, replace=False)
    away = x - x[o, None]
    back = (np.einsum("oid,od->oi", away, n[o]) < 0) & (n[o] @ n.T < 0)
    light = np.maximum(n @ (0.6, 0.0, 0.8), 0.0)
    R = np.where(back[..., None], SKIN.reflectance(np.linalg.norm(away, axis=2)), 0.0)
    exact = np.einsum("oic,i->oc", R, area * light)
    errors = []
    for select in (select_top, select_coarse):
        chosen = select(gpu, EAR, SKIN, 3)
        samples = chosen.sender_samples
        L = light if samples is None else light[EAR.faces[samples.face, samples.barycentric.argmax(axis=1)]]
        received = np.where(chosen.sender[o] >= 0, L[chosen.sender[o]], 0.0)
        M = np.einsum("onc,on->oc", chosen.weight[o], received)
        errors.append(np.sqrt(np.square(M - exact).sum() / np.square(exact).sum()))
    assert errors[0] > 0.75 and errors[1] < 0.6 * errors[0]
