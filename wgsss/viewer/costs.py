"""What pictures cost, pass by pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wgsss.viewer.painter import Painter
    from wgsss.viewer.window import Window

SIDES = "left", "right"
MOST = 8
"""bars of a side; passes that cost less are added up"""


def milliseconds(painter: Painter, side: int) -> float:
    """That the passes of a side's picture took, shared ones among them; 0 where they were not timed."""
    return sum(_times(painter, side).values())


def _times(painter: Painter, side: int) -> dict[str, float]:
    """ms by pass."""
    picture = painter.sides[side]
    if painter.drawing is None or picture is None:
        return {}
    times = painter.drawing.graph.times
    return {name: times[name] for name in picture.passes if name in times}


def costs(window: Window) -> None:
    """Declare the bars of both sides, on one scale."""
    from imgui_bundle import imgui

    painter = window.painter
    if painter.drawing is None:
        return
    width, height = window.full_size
    imgui.text_disabled(f"{painter.seconds * 1e3:.0f} ms for both, at {painter.scale:.3g} of {width} x {height}")
    imgui.text_disabled(f"passes by {painter.drawing.graph.clock}")
    timed = [_times(painter, side) for side in range(2)]
    most = max((ms for times in timed for ms in times.values()), default=1.0)
    for name, times in zip(SIDES, timed, strict=True):
        if not times:
            continue
        imgui.text(f"{name}: {sum(times.values()):.1f} ms")
        ordered = sorted(times.items(), key=lambda item: -item[1])
        for passed, ms in ordered[:MOST]:
            _bar(passed, ms, most)
        if ordered[MOST:]:
            _bar(f"{len(ordered) - MOST} more", sum(ms for _, ms in ordered[MOST:]), most)


def _bar(name: str, ms: float, most: float) -> None:
    """A bar with its text at its beginning, where it can be read whatever the bar's length."""
    from imgui_bundle import imgui

    x, y = imgui.get_cursor_pos()
    imgui.push_style_color(imgui.Col_.plot_histogram, imgui.get_style_color_vec4(imgui.Col_.header))
    imgui.progress_bar(ms / most, (-1, 0), "")
    imgui.pop_style_color()
    below = imgui.get_cursor_pos()
    pad = imgui.get_style().frame_padding
    imgui.set_cursor_pos((x + pad.x, y + pad.y))
    imgui.text(f"{ms:.2f}  {name}")
    imgui.set_cursor_pos(below)
