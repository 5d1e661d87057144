"""The pictures beside the panel: side by side, one alone, or the error map, with lines and texts over them."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy.typing as npt
from imgui_bundle import imgui
from wgpu.utils.imgui import ImguiWgpuBackend

from wgsss.gpu import Gpu
from wgsss.study import error_maps
from wgsss.viewer import manipulation
from wgsss.viewer.painter import ERROR_MAP_END
from wgsss.viewer.sender_lines import find_sam, sender_lines
from wgsss.viewer.session import ERROR, LEFT, RIGHT, SPLIT, Session
from wgsss.viewer.ui import UiTexture

MARGIN, FONT_SIZE = 8.0, 13.0
"""of the error message, logical pixels"""
MIN_LABELLED = 0.25
"""smallest weight of a sender with a number beside it, relative to the largest"""

BLACK, WHITE, DIVIDER = (imgui.IM_COL32(*rgba) for rgba in ((0, 0, 0, 255), (255, 255, 255, 255), (255, 255, 255, 160)))
ERROR_TEXT, ERROR_BACKGROUND = imgui.IM_COL32(255, 220, 220, 255), imgui.IM_COL32(60, 0, 0, 220)
SENDER, VERTEX = imgui.IM_COL32(90, 220, 255, 255), imgui.IM_COL32(255, 200, 60, 255)


class Gallery:
    """Shows the pictures of a session behind the panel."""

    def __init__(self, session: Session, gpu: Gpu, backend: ImguiWgpuBackend) -> None:
        self._session = session
        self._sides = UiTexture(gpu, backend), UiTexture(gpu, backend)
        self._error_map, self._colour_bar = UiTexture(gpu, backend), UiTexture(gpu, backend)
        self._colour_bar.write(error_maps.colour_bar())
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._mono = backend.io.fonts.add_font_from_file_ttf(str(fonts / "DejaVuSansMono.ttf"), FONT_SIZE)

    def update_textures(self) -> None:
        """Copy the pictures that the session has painted."""
        painter = self._session.painter
        for texture, picture in zip(self._sides, painter.sides, strict=True):
            if picture is None or picture.display is None:
                texture.clear()
            else:
                texture.copy(picture.display.resource.gpu)
        if painter.measurement is None or painter.measurement.error_map is None:
            self._error_map.clear()
        else:
            self._error_map.write(painter.measurement.error_map)

    def declare(self) -> None:
        """Declare everything beside the panel for this frame."""
        session, layout = self._session, self._session.layout
        canvas = imgui.get_background_draw_list()
        canvas.add_rect_filled((0, 0), (layout.width, layout.height), BLACK)
        if session.painter.error_message:
            self._declare_error_message(imgui.get_foreground_draw_list(), session.painter.error_message)
        if session.comparison == ERROR:
            self._declare_picture(canvas, self._error_map, 0.0, 1.0)
            self._declare_legend(canvas)
            return
        cut = {LEFT: 1.0, RIGHT: 0.0}.get(session.comparison, session.divider)
        self._declare_picture(canvas, self._sides[0], 0.0, cut)
        self._declare_picture(canvas, self._sides[1], cut, 1.0)
        if session.comparison == SPLIT:
            x = layout.panel_width + session.divider * layout.picture_width
            canvas.add_line((x, 0.0), (x, layout.picture_height), DIVIDER, 1.0)
        if session.shows_senders:
            self._declare_senders(canvas)

    def _declare_picture(self, canvas: imgui.ImDrawList, texture: UiTexture, start: float, end: float) -> None:
        """Show a texture from `start` to `end`, shares of its width, where that part of the picture belongs."""
        layout = self._session.layout
        if end > start:
            left, width = layout.panel_width, layout.picture_width
            corners = (left + start * width, 0.0), (left + end * width, layout.picture_height)
            texture.draw(canvas, corners, ((start, 0.0), (end, 1.0)))

    def _declare_legend(self, canvas: imgui.ImDrawList) -> None:
        """Show the colours of the error map with a scale."""
        layout = self._session.layout
        x, y = layout.panel_width + 0.2 * layout.picture_width, layout.picture_height - 40.0
        length = 0.6 * layout.picture_width
        self._colour_bar.draw(canvas, ((x, y), (x + length, y + 10)))
        for place, text in error_maps.ticks(ERROR_MAP_END):
            canvas.add_text((x + place * length - 8, y + 14), WHITE, text)

    def _declare_error_message(self, canvas: imgui.ImDrawList, text: str) -> None:
        """Show why drawing failed, in a monospaced font: compilers mark a column below the line of an error."""
        left, width = self._session.layout.panel_width, self._session.layout.picture_width
        wrap = width - 2 * MARGIN
        imgui.push_font(self._mono, FONT_SIZE)
        size = imgui.calc_text_size(text, wrap_width=wrap)
        canvas.add_rect_filled((left, 0.0), (left + width, size.y + 2 * MARGIN), ERROR_BACKGROUND)
        canvas.add_text(self._mono, FONT_SIZE, (left + MARGIN, MARGIN), ERROR_TEXT, text, wrap_width=wrap)
        imgui.pop_font()

    def _declare_senders(self, canvas: imgui.ImDrawList) -> None:
        """Draw lines from the vertex under the pointer to its senders, with a width that grows with their weights."""
        session = self._session
        sam = find_sam(session.methods[session.side])
        point = None if sam is None else session.pick(*session.pointer)
        if sam is None or point is None:
            return
        painter = session.painter
        stage = painter.renderer.stage(session.scene, painter.drawn_methods, session.time_s)
        lines = sender_lines(stage, sam, point)
        start = self._window_position(lines.vertex)
        largest = max(float(lines.weights.max(initial=0.0)), 1e-30)
        for sender, weight in zip(lines.senders, lines.weights, strict=True):
            end, share = self._window_position(sender), float(weight) / largest
            canvas.add_line(start, end, SENDER, 1.0 + 4.0 * share)
            if share > MIN_LABELLED:
                canvas.add_text(end, WHITE, f"{weight:.3g}")
        canvas.add_circle_filled(start, 4.0, VERTEX)

    def _window_position(self, point: npt.ArrayLike) -> tuple[float, float]:
        """Return where a point, world mm, is in the window, logical pixels."""
        session = self._session
        return session.layout.to_window(*manipulation.project(session.camera, session.layout.aspect, point))
