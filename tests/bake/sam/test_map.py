"""Maps are cached, warn of flaws of the mesh, and are refused before any work if they would be too large."""

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
    """Return one mesh of several components."""
    firsts = np.cumsum([0, *(len(m.positions) for m in meshes)])
    faces = [m.faces + first for m, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.concatenate([m.positions for m in meshes]), np.concatenate(faces))


def assert_equal(a: SenderMap, b: SenderMap) -> None:
    expected = b.arrays()
    assert a.arrays().keys() == expected.keys()
    for name, array in a.arrays().items():
        np.testing.assert_array_equal(array, expected[name])


def test_a_map_is_equal_after_conversion_to_arrays_and_back() -> None:
    sender, weight = np.array([[0, 5]], np.int32), np.ones((1, 2, 3), np.float32)
    samples = Samples(np.array([3], np.int32), np.array([[0.2, 0.3, 0.5]]), np.array([1.0]))
    for original in (SenderMap(sender, weight, 1), SenderMap(sender, weight, 1, samples, point_tree(np.zeros((9, 2))))):
        back = SenderMap.from_arrays(original.arrays())
        assert_equal(back, original)
        assert (back.sender_samples is None) == (original.sender_samples is None) and (back.tree is None) == (
            original.tree is None
        )


@pytest.mark.parametrize("select", ["top", "coarse"])
def test_a_map_is_computed_once_for_each_mesh_profile_and_number_of_entries(
    gpu: Gpu, select: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    original = SELECTIONS[select]

    def counting(gpu: Gpu, mesh: Mesh, profile: Profile, n: int) -> SenderMap:
        calls.append(n)
        return original(gpu, mesh, profile, n)

    counting.__module__ = original.__module__
    monkeypatch.setitem(SELECTIONS, select, counting)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        first = spatial_adjacency_map(gpu, BALL, MILK, 3, select)
        assert_equal(spatial_adjacency_map(gpu, BALL, MILK, 3, select), first)
        assert calls == [3] and first.sender.shape == (len(BALL.positions), 3)
        spatial_adjacency_map(gpu, BALL, material("marble").profile, 3, select)
        spatial_adjacency_map(gpu, BALL, MILK, 2, select)
        spatial_adjacency_map(gpu, sphere(5.0, 320), MILK, 2, select)
        assert calls == [3, 3, 2, 2]
        for variance in (1.0, 2.0):  # equal totals
            spatial_adjacency_map(gpu, BALL, SumOfGaussians(np.array([variance]), np.full((1, 3), 0.5)), 2, select)
    assert calls == [3, 3, 2, 2, 2, 2]


@pytest.mark.parametrize(
    ("mesh", "warning"),
    [
        (BALL, ""),
        (Mesh(BALL.positions, BALL.faces[5:]), r"\d+ open edges: no light enters through the holes"),
        (
            Mesh(BALL.positions, BALL.faces[:, ::-1]),
            "the normals point inwards: the outside of the object counts as its back side",
        ),
        (joined(BALL, sphere(1.0, 100)), "2 separate components: light passes between them as if the gaps were filled"),
        (
            Mesh(BALL.positions, np.concatenate([BALL.faces, BALL.faces[:1, ::-1]])),
            "3 edges without exactly two faces of the same winding: some normals may point inwards",
        ),
        (
            Mesh(BALL.positions, np.concatenate([BALL.faces[1:], BALL.faces[:1, ::-1]])),
            "3 edges without exactly two faces of the same winding: some normals may point inwards",
        ),
    ],
)
def test_maps_warn_of_flaws_of_the_mesh_in_one_line(gpu: Gpu, mesh: Mesh, warning: str) -> None:
    assert re.fullmatch(warning, topology_warning(mesh))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        spatial_adjacency_map(gpu, mesh, MILK, 3, "top")
        spatial_adjacency_map(gpu, mesh, MILK, 3, "top")  # from the cache
    assert len(caught) == (2 if warning else 0)
    assert all(re.fullmatch(f"mesh: {warning}", str(w.message)) for w in caught)


def test_vertices_without_faces_are_no_component_and_have_no_entries(gpu: Gpu) -> None:
    mesh = Mesh(np.concatenate([BALL.positions, [[0, 0, 9]]]), BALL.faces)
    assert topology_warning(mesh) == ""
    for select in ("top", "coarse"):
        entries = spatial_adjacency_map(gpu, mesh, MILK, 3, select)
        assert (entries.sender[-1] == -1).all() and (entries.weight[-1] == 0).all() and (entries.sender[:-1] >= 0).any()


def test_a_map_that_is_too_large_is_refused_before_any_work(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SELECTIONS, "top", lambda *_: pytest.fail("a map was computed"))
    monkeypatch.setattr(module, "MAX_BYTES", 16 * 3 * len(BALL.positions) - 1)
    size = 16 * 3 * len(BALL.positions)
    with pytest.raises(InputError, match=f"3 entries for each of {len(BALL.positions)} vertices take {size} bytes"):
        spatial_adjacency_map(gpu, BALL, MILK, 3, "top")


def test_unknown_selections_and_numbers_of_entries_below_one_are_refused(gpu: Gpu) -> None:
    with pytest.raises(InputError, match="unknown selection 'tpo'; did you mean 'top'"):
        spatial_adjacency_map(gpu, BALL, MILK, 3, "tpo")
    with pytest.raises(InputError, match="samples, the number of entries per vertex, must be at least 1, not 0"):
        spatial_adjacency_map(gpu, BALL, MILK, 0, "top")
