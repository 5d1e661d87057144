"""Making a map: cached, told what is wrong with the mesh, and refused before any work where it is too large."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

from wgsss.bake import sam as module
from wgsss.bake.sam import SELECTIONS, SenderMap, spatial_adjacency_map
from wgsss.bake.sam.mesh_checks import topology_warning
from wgsss.bake.sam.point_tree import point_tree
from wgsss.bake.samples import Samples
from wgsss.errors import InputError
from wgsss.gpu import Gpu
from wgsss.optics import Profile, SumOfGaussians
from wgsss.scene import Mesh, material
from wgsss.scene.shapes import sphere

BALL, MILK = sphere(5.0, 300), material("wholemilk").profile


def joined(*meshes: Mesh) -> Mesh:
    firsts = np.cumsum([0, *(len(m.positions) for m in meshes)])
    faces = [m.faces + first for m, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.concatenate([m.positions for m in meshes]), np.concatenate(faces))


def same(a: SenderMap, b: SenderMap) -> None:
    found, wanted = a.arrays(), b.arrays()
    assert found.keys() == wanted.keys()
    for name, value in found.items():
        np.testing.assert_array_equal(value, wanted[name])


def test_entries_come_back_from_arrays_as_they_were() -> None:
    sender, weight = np.array([[0, 5]], np.int32), np.ones((1, 2, 3), np.float32)
    samples = Samples(np.array([3], np.int32), np.array([[0.2, 0.3, 0.5]]), np.array([1.0]))
    for made in (SenderMap(sender, weight, 1), SenderMap(sender, weight, 1, samples, point_tree(np.zeros((9, 2))))):
        back = SenderMap.from_arrays(made.arrays())
        same(back, made)
        assert (back.sender_samples is None) == (made.sender_samples is None) and (back.tree is None) == (
            made.tree is None
        )


@pytest.mark.parametrize("select", ["top", "coarse"])
def test_a_map_is_made_once_for_each_mesh_profile_and_number(
    gpu: Gpu, select: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    original = SELECTIONS[select]

    def counting(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
        made.append(n)
        return original(gpu, mesh, profile, n)

    counting.__module__ = original.__module__
    monkeypatch.setitem(SELECTIONS, select, counting)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        first = spatial_adjacency_map(gpu, BALL, MILK, 3, select)
        same(spatial_adjacency_map(gpu, BALL, MILK, 3, select), first)
        assert made == [3] and first.sender.shape == (len(BALL.positions), 3)
        spatial_adjacency_map(gpu, BALL, material("marble").profile, 3, select)
        spatial_adjacency_map(gpu, BALL, MILK, 2, select)
        spatial_adjacency_map(gpu, sphere(5.0, 320), MILK, 2, select)
        assert made == [3, 3, 2, 2]
        for variance in (1.0, 2.0):  # of the same total
            spatial_adjacency_map(gpu, BALL, SumOfGaussians(np.array([variance]), np.full((1, 3), 0.5)), 2, select)
    assert made == [3, 3, 2, 2, 2, 2]


def test_what_makes_a_map_is_part_of_its_key() -> None:
    assert set(module._CODE) == {*SELECTIONS, "full_tree"}


@pytest.mark.parametrize(
    ("mesh", "told"),
    [
        (BALL, ""),
        (Mesh(BALL.positions, BALL.faces[5:]), r"\d+ open edges: where there is no surface, nothing arrives"),
        (Mesh(BALL.positions, BALL.faces[:, ::-1]), "wound inwards: what is outside counts as the back side"),
        (joined(BALL, sphere(1.0, 100)), "2 parts: light passes from one to another as if the gaps .* filled"),
        (
            Mesh(BALL.positions, np.concatenate([BALL.faces, BALL.faces[:1, ::-1]])),
            "3 edges not between two faces that agree: normals there may point inwards",
        ),
        (
            Mesh(BALL.positions, np.concatenate([BALL.faces[1:], BALL.faces[:1, ::-1]])),
            "3 edges not between two faces that agree: normals there may point inwards",
        ),
    ],
)
def test_meshes_on_which_the_split_means_little_are_told_in_a_line(gpu: Gpu, mesh: Mesh, told: str) -> None:
    assert re.fullmatch(told, topology_warning(mesh))
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        spatial_adjacency_map(gpu, mesh, MILK, 3, "top")
        spatial_adjacency_map(gpu, mesh, MILK, 3, "top")  # from the cache
    assert len(seen) == (2 if told else 0)
    assert all(re.fullmatch(f"mesh: {told}", str(w.message)) for w in seen)


def test_isolated_vertices_are_no_part_and_get_no_entries(gpu: Gpu) -> None:
    mesh = Mesh(np.concatenate([BALL.positions, [[0, 0, 9]]]), BALL.faces)
    assert topology_warning(mesh) == ""
    for select in ("top", "coarse"):
        found = spatial_adjacency_map(gpu, mesh, MILK, 3, select)
        assert (found.sender[-1] == -1).all() and (found.weight[-1] == 0).all() and (found.sender[:-1] >= 0).any()


def test_a_map_that_would_not_fit_is_refused_before_any_work(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SELECTIONS, "top", lambda *_: pytest.fail("work was done"))
    monkeypatch.setattr(module, "MOST_BYTES", 16 * 3 * len(BALL.positions) - 1)
    taken = 16 * 3 * len(BALL.positions)
    with pytest.raises(InputError, match=f"3 samples for each of {len(BALL.positions)} vertices take {taken} bytes"):
        spatial_adjacency_map(gpu, BALL, MILK, 3, "top")


def test_what_is_not_a_selection_or_a_number_of_samples_is_refused(gpu: Gpu) -> None:
    with pytest.raises(InputError, match="unknown selection 'tpo'; did you mean 'top'"):
        spatial_adjacency_map(gpu, BALL, MILK, 3, "tpo")
    with pytest.raises(InputError, match="at least one sample, not 0"):
        spatial_adjacency_map(gpu, BALL, MILK, 0, "top")
