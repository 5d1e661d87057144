"""The adaptive resolution converges to one that keeps the time budget."""

from __future__ import annotations

import pytest

from wgsss.viewer.painter import SCALES, AdaptiveResolution


@pytest.mark.parametrize(
    ("fixed_s", "full_s", "expected"),
    [(0.0, 0.05, 1.0), (0.0, 0.3, 0.5), (0.01, 0.6, 0.25), (0.09, 0.5, 0.125), (1, 1, 0.125)],
)
@pytest.mark.parametrize("start", range(len(SCALES)))
def test_resolution_converges_within_the_budget(fixed_s: float, full_s: float, expected: float, start: int) -> None:
    resolution = AdaptiveResolution(step=start)
    scales = []
    for _ in range(12):
        scales.append(resolution.scale)
        resolution.update(fixed_s + full_s * resolution.scale**2)
    assert set(scales[6:]) == {expected} or (
        start > SCALES.index(expected) and fixed_s + full_s * scales[-1] ** 2 <= resolution.budget_s
    )
