"""The resolution follows what pictures cost, and settles."""

from __future__ import annotations

import pytest

from wgsss.viewer.pace import SCALES, Pace


@pytest.mark.parametrize(
    ("fixed", "full", "settled"),
    [(0.0, 0.05, 1.0), (0.0, 0.3, 0.5), (0.01, 0.6, 0.25), (0.09, 0.5, 0.125), (1, 1, 0.125)],
)
@pytest.mark.parametrize("start", range(len(SCALES)))
def test_it_settles_at_what_keeps_the_budget(fixed: float, full: float, settled: float, start: int) -> None:
    pace = Pace(step=start)
    seen = []
    for _ in range(12):
        seen.append(pace.scale)
        pace.took(fixed + full * pace.scale**2)
    assert set(seen[6:]) == {settled} or (
        start > SCALES.index(settled) and fixed + full * seen[-1] ** 2 <= pace.budget_s
    )
