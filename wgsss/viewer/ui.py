"""Dear ImGui in the window: its font, when it needs a frame, and which pointer and key events it receives."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import matplotlib
import numpy as np
import numpy.typing as npt
import wgpu
from imgui_bundle import imgui, implot
from rendercanvas.glfw import RenderCanvas, loop
from wgpu.utils.imgui import ImguiRenderer, ImguiWgpuBackend

from wgsss.gpu import Gpu

Event = dict[str, Any]
"""an event of rendercanvas"""
Point = tuple[float, float]

FONT_SIZE = 14.0
"""logical pixels"""
FRAMES_PER_INPUT = 3
"""frames to draw after an input: Dear ImGui handles a press, its release and a popup that they open one by one"""
HOVER_S = 0.6
"""time after the last input at which one more frame is drawn: the tooltip of the control under the pointer appears"""


class _Renderer(ImguiRenderer):
    """wgpu's renderer without its handling of pointer events, which `Ui` does in its place.

    That renderer asks the last frame whether an event belongs to Dear ImGui; with slow frames the answer is outdated.
    """

    KEY_MAP: ClassVar[dict[str, imgui.Key]] = {**ImguiRenderer.KEY_MAP, " ": imgui.Key.space}

    def _on_pointer(self, event: Event) -> None:
        pass

    _on_mouse = _on_mouse_move = _on_wheel = _on_pointer


class Ui:
    """Draws the user interface, and hands it the events that belong to it.

    Pointer events left of `panel_width()`, logical pixels, belong to the user interface, and so do drags that begin
    there.
    """

    def __init__(
        self, gpu: Gpu, canvas: RenderCanvas, declare: Callable[[], None], panel_width: Callable[[], float]
    ) -> None:
        """`declare` declares the content of a frame."""
        self._canvas, self._declare, self._panel_width = canvas, declare, panel_width
        self._renderer = _Renderer(gpu.device, canvas, "bgra8unorm")
        self._renderer.set_gui(self._declare_frame)
        implot.create_context()
        self.backend = self._renderer.backend
        self._io = self.backend.io
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._io.fonts.add_font_from_file_ttf(str(fonts / "DejaVuSans.ttf"), FONT_SIZE)
        self._io.config_nav_escape_clear_focus_window = True
        self._frames_due = FRAMES_PER_INPUT
        self._drawn_s, self._input_s = 0.0, 0.0
        """when the last frame was drawn, and the last input came"""
        self._awaits_hover = False
        """whether `_draw_hover` is scheduled"""
        self._has_keyboard = self._takes_keyboard = False
        """whether the panel receives keys, and whether it does from the next frame on"""
        self._has_pointer = self._has_popup = False
        """whether the panel receives pointer events, and whether a popup is open, which may reach over the pictures"""
        self._pointer_inputs: deque[tuple[str, Callable[[], None]]] = deque()
        """pointer events that Dear ImGui has not received yet: their kinds, and functions that hand them over"""
        pointer = "pointer_down", "pointer_move", "pointer_up", "wheel", "double_click"
        canvas.add_event_handler(self._on_pointer, *pointer, order=-100)
        canvas.add_event_handler(self._on_key, "key_down", "key_up", "char", order=-100)
        canvas.add_event_handler(self._stop_key, "key_down", "key_up", order=-98)  # after the renderer's own handler
        canvas.add_event_handler(lambda event: self._request_frames(), "resize", order=-100)

    def render(self) -> None:
        """Draw a frame, and request the next one if more are due."""
        now = time.perf_counter()
        self._io.delta_time = float(np.clip(now - self._drawn_s, 1e-3, 1.0))
        self._drawn_s = now
        self._emit_pointer_inputs()
        self._renderer.render()
        self._frames_due = max(self._frames_due - 1, 0)
        if self._frames_due or self._pointer_inputs:
            self._canvas.request_draw()

    def take_keyboard(self) -> None:
        """Give the keys to the panel, until escape or a click on the picture."""
        self._io.config_flags |= imgui.ConfigFlags_.nav_enable_keyboard
        self._has_keyboard = self._takes_keyboard = True

    def _declare_frame(self) -> None:
        if self._takes_keyboard:
            imgui.set_next_window_focus()
            imgui.set_nav_cursor_visible(True)
            self._takes_keyboard = False
        elif self._has_keyboard and not self._io.nav_active:
            self._io.config_flags &= ~imgui.ConfigFlags_.nav_enable_keyboard
            self._has_keyboard = False
        self._declare()
        self._has_popup = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)

    def _emit_pointer_inputs(self) -> None:
        """Hand pointer events to Dear ImGui: in one frame at most a move followed by a press, or a release.

        It reads the pointer once a frame, and would not see a drag whose events all came at once.
        """
        emitted: set[str] = set()
        while self._pointer_inputs:
            kind, emit = self._pointer_inputs[0]
            if (kind == "pointer_move" and emitted - {kind}) or (kind == "pointer_up" and emitted):
                break
            self._pointer_inputs.popleft()
            emitted.add(kind)
            emit()

    def _on_pointer(self, event: Event) -> None:
        io, kind = self._io, event["event_type"]
        if kind in ("pointer_down", "pointer_up"):
            is_down = kind == "pointer_down"
            self._pointer_inputs.append((kind, lambda: io.add_mouse_button_event(event["button"] - 1, is_down)))
        elif kind == "pointer_move":
            self._pointer_inputs.append((kind, lambda: io.add_mouse_pos_event(event["x"], event["y"])))
        elif kind == "wheel":
            wheel = event["dx"] / 100, -event["dy"] / 100
            self._pointer_inputs.append((kind, lambda: io.add_mouse_wheel_event(*wheel)))
        if kind != "pointer_up" and len(event["buttons"]) <= (kind == "pointer_down"):  # no drag is under way
            self._has_pointer = self._has_popup or event["x"] < self._panel_width()
        event["stop_propagation"] = self._has_pointer
        is_queued = self._has_pointer and kind != "pointer_move"
        self._request_frames(self._frames_due + FRAMES_PER_INPUT if is_queued else FRAMES_PER_INPUT)

    def _on_key(self, event: Event) -> None:
        self._io.want_capture_keyboard |= self._has_keyboard
        is_queued = self._io.want_capture_keyboard
        self._request_frames(self._frames_due + FRAMES_PER_INPUT if is_queued else FRAMES_PER_INPUT)

    def _stop_key(self, event: Event) -> None:
        """Keep a key from the window while the panel has the keys.

        The renderer stops only those that Dear ImGui has a name for; a full stop that is typed has none.
        """
        event["stop_propagation"] = self._io.want_capture_keyboard

    def _request_frames(self, count: int = FRAMES_PER_INPUT) -> None:
        """Draw at least `count` frames, and one more if no other input comes within HOVER_S."""
        self._frames_due = max(self._frames_due, count)
        self._input_s = time.perf_counter()
        self._canvas.request_draw()
        if not self._awaits_hover:
            self._awaits_hover = True
            loop.call_later(HOVER_S, self._draw_hover)

    def _draw_hover(self) -> None:
        """Draw again once HOVER_S have passed since the last input."""
        remaining_s = self._input_s + HOVER_S - time.perf_counter()
        if remaining_s > 0.0:
            loop.call_later(remaining_s, self._draw_hover)
        else:
            self._awaits_hover = False
            self._frames_due = max(self._frames_due, FRAMES_PER_INPUT)
            self._canvas.request_draw()


class UiTexture:
    """A texture that the user interface can show.

    Its format is not sRGB: the user interface shows the encoded values as they are, and sampling must not decode them.
    """

    def __init__(self, gpu: Gpu, backend: ImguiWgpuBackend) -> None:
        self._gpu, self._backend = gpu, backend
        self._texture: wgpu.GPUTexture | None = None
        self._handle: imgui.ImTextureRef | None = None
        """by which Dear ImGui refers to the texture"""

    def copy(self, source: wgpu.GPUTexture) -> None:
        """Copy an rgba8unorm-srgb texture."""
        texture = self._allocate(source.size[:2])
        encoder = self._gpu.device.create_command_encoder()
        encoder.copy_texture_to_texture({"texture": source}, {"texture": texture}, source.size)
        self._gpu.queue.submit([encoder.finish()])

    def write(self, pixels: npt.NDArray[np.uint8]) -> None:
        """Upload pixels (H, W, 4)."""
        height, width = pixels.shape[:2]
        texture = self._allocate((width, height))
        layout = {"bytes_per_row": 4 * width, "rows_per_image": height}
        self._gpu.queue.write_texture({"texture": texture}, np.ascontiguousarray(pixels), layout, (width, height, 1))

    def draw(
        self, canvas: imgui.ImDrawList, corners: tuple[Point, Point], uv: tuple[Point, Point] = ((0.0, 0.0), (1.0, 1.0))
    ) -> None:
        """Draw the texture, or the part of it between two points of its own, between two corners on a canvas.

        Draw nothing if there is no texture.
        """
        if self._handle is not None:
            canvas.add_image(self._handle, *corners, *uv)

    def clear(self) -> None:
        """Destroy the texture; the user interface shows nothing then."""
        if self._texture is not None:
            self._backend.unregister_texture(self._handle)
            self._texture.destroy()
        self._texture = self._handle = None

    def _allocate(self, size: tuple[int, int]) -> wgpu.GPUTexture:
        """Return a texture of a size; the present one if it fits."""
        if self._texture is None or self._texture.size[:2] != tuple(size):
            self.clear()
            usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST
            self._texture = self._gpu.device.create_texture(size=(*size, 1), format="rgba8unorm", usage=usage)
            self._handle = self._backend.register_texture(self._texture.create_view())
        return self._texture
