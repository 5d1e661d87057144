"""Where the window shows its pictures: side by side, one alone, or the map of errors, and what is drawn over them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from wgsss.gpu import Gpu
from wgsss.study import error_maps
from wgsss.viewer import controls
from wgsss.viewer.entries import adjacency, links
from wgsss.viewer.measure import WHOLE
from wgsss.viewer.painter import Painter
from wgsss.viewer.sheet import Sheet
from wgsss.viewer.state import ERROR, LEFT, RIGHT, SPLIT

if TYPE_CHECKING:
    from wgsss.viewer.window import Window

MARGIN, FONT_SIZE = 8.0, 13.0
"""round a text and of it, logical pixels"""
LABELLED = 0.25
"""of the widest line's width: thinner ones have no number"""


class Gallery:
    """What is shown beside the panel."""

    def __init__(self, gpu: Gpu, backend: Any) -> None:
        import matplotlib

        self._sides = Sheet(gpu, backend), Sheet(gpu, backend)
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._mono = backend.io.fonts.add_font_from_file_ttf(str(fonts / "DejaVuSansMono.ttf"), FONT_SIZE)
        self._map, self._colours = Sheet(gpu, backend), Sheet(gpu, backend)

    def hang(self, painter: Painter) -> None:
        """Take over what was painted."""
        for sheet, picture in zip(self._sides, painter.sides, strict=True):
            if picture is None or picture.display is None:
                sheet.clear()
            else:
                sheet.show(picture.display.resource.gpu)
        if painter.measured is None or painter.measured.map is None:
            self._map.clear()
        else:
            self._map.write(painter.measured.map)

    def declare(self, window: Window) -> None:
        """All of it for this frame, behind the panel."""
        from imgui_bundle import imgui

        behind = imgui.get_background_draw_list()
        width, height = window.canvas.get_logical_size()
        behind.add_rect_filled((0, 0), (width, height), imgui.IM_COL32(0, 0, 0, 255))
        left, top, across, down = window.region
        state = window.state

        def add(sheet: Sheet, a: float, b: float) -> None:
            if sheet.reference is not None and b > a:
                corners = (left + a * across, top), (left + b * across, top + down)
                behind.add_image(sheet.reference, *corners, (a, 0.0), (b, 1.0))

        if window.painter.fault:
            self._say(imgui.get_foreground_draw_list(), window.painter.fault, window.region)
        if state.comparison == ERROR:
            add(self._map, 0.0, 1.0)
            self._legend(behind, window.region)
            return
        cut = {LEFT: 1.0, RIGHT: 0.0}.get(state.comparison, state.divider)
        add(self._sides[0], 0.0, cut)
        add(self._sides[1], cut, 1.0)
        if state.comparison == SPLIT:
            x = left + state.divider * across
            behind.add_line((x, top), (x, top + down), imgui.IM_COL32(255, 255, 255, 160), 1.0)
        if state.shows_entries:
            _entries(behind, window)

    def _legend(self, behind: Any, region: tuple[float, float, float, float]) -> None:
        """The colours of the map of errors."""
        from imgui_bundle import imgui

        left, top, across, down = region
        if self._colours.reference is None:
            self._colours.write(error_maps.colour_bar())
        x, y, length = left + 0.2 * across, top + down - 40.0, 0.6 * across
        behind.add_image(self._colours.reference, (x, y), (x + length, y + 10))
        for share, text in error_maps.ticks(WHOLE):
            behind.add_text((x + share * length - 8, y + 14), imgui.IM_COL32(255, 255, 255, 255), text)

    def _say(self, before: Any, text: str, region: tuple[float, float, float, float]) -> None:
        """What went wrong, in front of the pictures, in a font in which compilers point at characters."""
        from imgui_bundle import imgui

        left, top, across, _ = region
        wrap = across - 2 * MARGIN
        imgui.push_font(self._mono, FONT_SIZE)
        size = imgui.calc_text_size(text, wrap_width=wrap)
        before.add_rect_filled((left, top), (left + across, top + size.y + 2 * MARGIN), imgui.IM_COL32(60, 0, 0, 220))
        at, colour = (left + MARGIN, top + MARGIN), imgui.IM_COL32(255, 220, 220, 255)
        before.add_text(self._mono, FONT_SIZE, at, colour, text, wrap_width=wrap)
        imgui.pop_font()


def _entries(behind: Any, window: Window) -> None:
    """Lines from the vertex under the pointer to where it reads from, as wide as they weigh."""
    from imgui_bundle import imgui

    state, painter = window.state, window.painter
    maps = adjacency(state.methods[window.side])
    point = None if maps is None else window.pointer.pick(*window.pointer.at)
    if maps is None or point is None:
        return
    stage = painter.easel.stage(state.scene, painter.present, state.time_s)
    found = links(stage, maps, point)
    start = _on_screen(window, found.vertex)
    most = max(float(found.weights.max(initial=0.0)), 1e-30)
    for place, weight in zip(found.senders, found.weights, strict=True):
        end, share = _on_screen(window, place), float(weight) / most
        behind.add_line(start, end, imgui.IM_COL32(90, 220, 255, 255), 1.0 + 4.0 * share)
        if share > LABELLED:
            behind.add_text(end, imgui.IM_COL32(255, 255, 255, 255), f"{weight:.3g}")
    behind.add_circle_filled(start, 4.0, imgui.IM_COL32(255, 200, 60, 255))


def _on_screen(window: Window, point: Any) -> tuple[float, float]:
    left, top, across, down = window.region
    right, up = controls.project(window.state.camera, across / down, point)
    return left + 0.5 * (1.0 + right) * across, top + 0.5 * (1.0 - up) * down
