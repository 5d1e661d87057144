"""The time that each pass takes, as bars."""

from __future__ import annotations

from imgui_bundle import imgui

from wgsss.viewer.panels.widgets import bar
from wgsss.viewer.session import SIDES, Session

MAX_BARS = 8
"""passes of a side with a bar of their own: those that take longest; the rest share one"""


def declare_passes(session: Session) -> None:
    """Declare the bars of both sides, on one scale."""
    painter = session.painter
    if painter.drawing is None:
        return
    width, height = session.layout.picture_size
    imgui.text_disabled(f"{painter.draw_s * 1e3:.0f} ms for both, at {painter.scale:.3g} of {width} x {height}")
    imgui.text_disabled(f"passes by {painter.drawing.graph.clock}")
    times_by_side = [painter.pass_times(side) for side in range(2)]
    longest = max((ms for times in times_by_side for ms in times.values()), default=1.0)
    for name, times in zip(SIDES, times_by_side, strict=True):
        if not times:
            continue
        imgui.text(f"{name}: {sum(times.values()):.1f} ms")
        ordered = sorted(times.items(), key=lambda item: -item[1])
        if len(ordered) > MAX_BARS:
            rest = f"{len(ordered) - MAX_BARS} more", sum(ms for _, ms in ordered[MAX_BARS:])
            ordered = [*ordered[:MAX_BARS], rest]
        for pass_name, ms in ordered:
            bar(f"{ms:.2f}  {pass_name}", ms / longest)
