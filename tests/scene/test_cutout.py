"""Alpha masks that cut a mesh: areas against closed forms, closed seams, and wrapping."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

from wgsss.scene.cutout import MOST_FACES, Mask, cut

Array = np.ndarray[Any, Any]

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
REPEAT = ("repeat", "repeat")


def ellipse(size: int, a: float = 0.4, b: float = 0.24, soft: bool = False) -> Array:
    """Return alpha (size, size): 1 in a centred ellipse with half axes a and b, with a soft outline on request."""
    t = (np.arange(size) + 0.5) / size - 0.5
    r = np.hypot(t[None, :] / a, t[:, None] / b)
    return np.clip((1 - r) * 8 + 0.5, 0, 1) if soft else (r < 1).astype(float)


def area(positions: Array, faces: Array) -> float:
    a, b, c = positions[faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def edges(faces: Array) -> Counter[int]:
    """Count the edges by their number of faces."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2), 1)
    return Counter(np.unique(ends, axis=0, return_counts=True)[1].tolist())


@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("size", [64, 300])
def test_an_ellipse_on_two_triangles(size: int, soft: bool) -> None:
    blend, faces = cut(SQUARE, HALVES, SQUARE[:, :2], Mask(ellipse(size, soft=soft), 0.5, REPEAT))
    positions = blend.of(SQUARE)
    assert area(positions, faces) == pytest.approx(np.pi * 0.4 * 0.24, rel=0.02 if size == 64 else 0.004)
    normal = np.cross(*(positions[faces[:, i]] - positions[faces[:, 0]] for i in (1, 2)))
    assert normal[:, 2].min() >= 0, "no face is flipped"
    assert set(edges(faces)) == {1, 2}, "the surface has no cracks"
    r = np.hypot((positions[:, 0] - 0.5) / 0.4, (positions[:, 1] - 0.5) / 0.24)
    assert r.max() < 1 + 3 / (0.24 * size)
    assert len(faces) < 40 * size, "only faces at the outline are small"


def test_vertices_interpolate_their_triangles() -> None:
    blend, faces = cut(SQUARE, HALVES, SQUARE[:, :2], Mask(ellipse(64), 0.5, REPEAT))
    assert blend.weight.sum(axis=1) == pytest.approx(1) and blend.weight.min() >= 0
    assert blend.of(SQUARE[:, :2]) == pytest.approx(blend.of(SQUARE)[:, :2])
    assert np.array_equal(np.unique(faces), np.arange(len(blend.index)))


@pytest.mark.parametrize(
    ("wrap", "share"),
    [(REPEAT, 1.0), (("mirror", "repeat"), 1.0), (("repeat", "mirror"), 1.0), (("clamp", "repeat"), 1 / 3)],
)
def test_masks_wrap_like_their_texture(wrap: tuple[str, str], share: float) -> None:
    """Coordinates from -1 to 2 show three by three tiles. Clamped along u, only the middle column shows the ellipse."""
    uvs = SQUARE[:, :2] * 3 - 1
    blend, faces = cut(SQUARE, HALVES, uvs, Mask(ellipse(96), 0.5, wrap))
    assert area(blend.of(SQUARE), faces) == pytest.approx(np.pi * 0.4 * 0.24 * share, rel=0.01)


def test_a_mirrored_mask_is_mirrored() -> None:
    """Alpha covers the left half of the image. From u = 0 to 2, the mirrored copy covers the right end."""
    left = np.zeros((16, 16))
    left[:, :8] = 1
    blend, faces = cut(SQUARE, HALVES, SQUARE[:, :2] * [2, 1], Mask(left, 0.5, ("mirror", "repeat")))
    x = blend.of(SQUARE)[faces].mean(axis=1)[:, 0]
    assert ((x < 0.27) | (x > 0.73)).all() and (x > 0.73).any() and (x < 0.27).any()


def test_masks_that_keep_all_nothing_or_all_but_a_hole() -> None:
    whole = cut(SQUARE, HALVES, SQUARE[:, :2], Mask(np.ones((4, 4)), 0.5, REPEAT))
    assert np.array_equal(whole[0].of(SQUARE)[whole[1]], SQUARE[HALVES])
    assert len(cut(SQUARE, HALVES, SQUARE[:, :2], Mask(np.zeros((4, 4)), 0.5, REPEAT))[1]) == 0
    blend, faces = cut(SQUARE, HALVES, SQUARE[:, :2], Mask(1 - ellipse(128), 0.5, REPEAT))
    assert area(blend.of(SQUARE), faces) == pytest.approx(1 - np.pi * 0.4 * 0.24, rel=0.01)


def test_a_cutoff_of_zero_keeps_everything() -> None:
    assert len(cut(SQUARE, HALVES, SQUARE[:, :2], Mask(ellipse(32), 0.0, REPEAT))[1]) == 2


def test_a_seam_is_split_equally_on_both_sides() -> None:
    """Two adjacent squares have different texture coordinates on the two sides of their common edge."""
    positions = np.concatenate([SQUARE, SQUARE + np.array([1, 0, 0])])
    faces = np.concatenate([HALVES, HALVES + 4])
    uvs = np.concatenate([SQUARE[:, :2], SQUARE[:, :2] * [1, 0.2]])
    solid = ellipse(64, 0.45, 0.45)
    solid[:, -8:] = 1  # the first square is solid at the seam; its edge is split only to match the other square
    solid[:, :4] = np.arange(64)[:, None] % 8 < 4
    blend, cut_faces = cut(positions, faces, uvs, Mask(solid, 0.5, REPEAT))
    at = np.round(blend.of(positions), 9)
    welded = np.unique(at, axis=0, return_inverse=True)[1].reshape(-1)[cut_faces]
    seam = np.abs(at[:, 0] - 1) < 1e-9
    sides = [set(map(tuple, at[np.unique(part)][seam[np.unique(part)]])) for part in (
        cut_faces[at[cut_faces][:, :, 0].mean(axis=1) < 1], cut_faces[at[cut_faces][:, :, 0].mean(axis=1) > 1]
    )]  # fmt: skip
    assert len(sides[1]) > 4 and {p for p in sides[0] if p in sides[1]}, "both sides have vertices on the seam"
    assert edges(welded)[2] > 0
    assert 3 not in edges(welded)


def test_a_noisy_mask_uses_limited_memory() -> None:
    noise = np.random.default_rng(0).integers(0, 2, (1024, 1024)).astype(float)
    _, faces = cut(SQUARE, HALVES, SQUARE[:, :2], Mask(noise, 0.5, REPEAT))
    assert 0 < len(faces) <= 2 * MOST_FACES
