"""Decides when to draw the pictures and at which resolution, and measures their errors."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

import numpy.typing as npt

from wgsss.errors import InputError, RenderError
from wgsss.gpu import Gpu
from wgsss.methods import Method
from wgsss.reference import Finished, Integral, Reference
from wgsss.registry import REFERENCES, name_of
from wgsss.study.error_maps import coloured
from wgsss.study.metrics import Errors, error_map, errors
from wgsss.viewer.pictures import Drawing, LiveRenderer, Picture, View
from wgsss.viewer.reference import BackgroundReference, Request
from wgsss.viewer.reload import Shaders
from wgsss.wgsl import WgslError

SCALES = (1.0, 0.5, 0.25, 0.125)
"""resolutions, relative to the sides of the full picture: few, since the textures of each size stay allocated"""
STILL_S = 0.25
"""time without a change after which a picture is drawn at full resolution"""
ERROR_MAP_END = 0.5
"""error at the end of the colours of the error map, relative to the RMS of the right side's luminance"""


@dataclass
class AdaptiveResolution:
    """Chooses a resolution at which a picture takes no longer than `budget_s`.

    It halves the sides when a picture takes longer, and doubles them when four times the time would fit.
    """

    budget_s: float = 0.1
    step: int = 0
    """index into SCALES"""

    @property
    def scale(self) -> float:
        return SCALES[self.step]

    def update(self, seconds: float) -> None:
        """Choose the next resolution, given the time that a picture at the present one took."""
        if seconds > self.budget_s:
            self.step = min(self.step + 1, len(SCALES) - 1)
        elif 4.0 * seconds < 0.8 * self.budget_s:
            self.step = max(self.step - 1, 0)


@dataclass(frozen=True, eq=False)
class Measurement:
    """Errors of the two sides against the reference, and the error between them."""

    errors: list[Errors | None]
    """of the left and the right side; None: there is no reference or no picture"""
    error_map: npt.NDArray[Any] | None
    """uint8 (H, W, 4), colours of the left side's error relative to the right side; None: a side has no picture"""


def measure(drawing: Drawing, sides: Sequence[Picture | None], reference: Finished | None) -> Measurement | None:
    """Measure the errors of the two sides. Return None if no pixel shows an object."""
    mask = drawing.object_mask
    if not mask.any():
        return None
    M = [None if picture is None else drawing.read_M(picture) for picture in sides]
    side_errors: list[Errors | None] = [None] * len(M)
    if reference is not None:
        estimate = reference.estimate
        side_errors = [None if m is None else errors(m, estimate.M, mask, error=estimate.error) for m in M]
    left, right = M
    if left is None or right is None:
        return Measurement(side_errors, None)
    return Measurement(side_errors, coloured(error_map(left, right, mask), mask, ERROR_MAP_END))


@dataclass(frozen=True)
class _Drawn:
    """What was drawn last: a view, how finely, and with which estimate of a reference."""

    view: View
    scale: float
    reference: Finished | None
    is_moving: bool
    """whether things moved: if so, nothing was measured"""


class Painter:
    """Keeps a picture of each side up to date: coarse while things move, at full resolution once they are still.

    If drawing fails, the pictures of the last success stay.
    """

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.renderer, self.resolution, self.shaders = LiveRenderer(gpu), AdaptiveResolution(), Shaders()
        self.reference = BackgroundReference()
        self.drawing: Drawing | None = None
        self.sides: list[Picture | None] = [None, None]
        """pictures of the left and the right side; None: a reference without an estimate yet"""
        self.measurement: Measurement | None = None
        self.scale = 1.0
        """resolution of the pictures, relative to their full size"""
        self.draw_s = 0.0
        """time that the last drawing took"""
        self.error_message = ""
        """why the pictures do not show the latest view or the latest shaders; empty: they do"""
        self.drawn_methods: tuple[Method, ...] = ()
        """methods of the last drawing, with estimates in place of references"""
        self._last: _Drawn | None = None
        """None: draw again whatever the view is"""
        self._finished: Finished | None = None
        self._changed_s = -1.0
        """when the view last changed"""
        self._pool_key: tuple[list[str], tuple[int, int]] | None = None
        """names of methods and size of the pictures that the device's pool of textures serves"""

    def reload_shaders(self) -> bool:
        """Return whether a shader file has changed. If so, the next `paint` draws with the new shaders."""
        if not self.shaders.reload_changed():
            return False
        self._last = None
        return True

    def is_done(self, view: View) -> bool:
        """Return whether the pictures show this view at full resolution."""
        last = self._last
        return last is not None and (last.view, last.scale, last.is_moving) == (view, 1.0, False)

    def paint(self, view: View, is_playing: bool = False, is_measured: bool = False) -> bool:
        """Draw the view, unless it is drawn already. Return whether there are new pictures.

        `is_playing` says that time passes, `is_measured` that errors against a reference are wanted.
        """
        now, last = time.perf_counter(), self._last
        if last is None or view != last.view:
            self._changed_s = now
        self._trim_pool(view)
        is_moving = is_playing or (last is not None and now - self._changed_s < STILL_S)
        scale = self.resolution.scale if is_moving else 1.0
        reference = None if is_moving else self._latest_estimate(view, is_measured)
        if last is not None:
            if self.is_done(view) and last.reference is reference:
                return False
            if is_moving and last.view == view and last.scale >= scale:
                return False
        try:
            self._draw(_Drawn(view, scale, reference, is_moving))
        except Exception as error:  # a shader that is being edited may break anything
            self._recover(error)
            return False
        self.shaders.mark_working()
        if not self.shaders.is_outdated:
            self.error_message = ""
        self.draw_s = time.perf_counter() - now
        if is_moving:
            self.resolution.update(self.draw_s)
        return True

    def pass_times(self, side: int) -> dict[str, float]:
        """Return the ms of each pass that drew a side, by pass name; empty if passes were not timed."""
        picture = self.sides[side]
        return {} if self.drawing is None or picture is None else self.drawing.pass_times(picture)

    def frame_ms(self, side: int) -> float:
        """Return the time of all passes that drew a side, including shared ones; 0 if passes were not timed."""
        return sum(self.pass_times(side).values())

    def _draw(self, drawn: _Drawn) -> None:
        """Draw and measure the pictures of both sides."""
        view, scale = drawn.view, drawn.scale
        size = max(int(view.size[0] * scale), 1), max(int(view.size[1] * scale), 1)
        methods = [drawn.reference if _is_reference(method) else method for method in view.methods]
        self.drawn_methods = tuple(method for method in methods if method is not None)
        self._last = drawn
        self.drawing = self.renderer.draw(replace(view, methods=self.drawn_methods, size=size), timed=scale == 1.0)
        self.gpu.fence()
        pictures = iter(self.drawing.pictures)
        self.sides = [None if method is None else next(pictures) for method in methods]
        self.scale = scale
        self.measurement = None if drawn.is_moving else measure(self.drawing, self.sides, drawn.reference)

    def _recover(self, error: Exception) -> None:
        """Keep the message of an error, and return to the last shaders that worked."""
        import wgpu

        if isinstance(error, InputError | RenderError | WgslError | wgpu.GPUError):
            self.error_message = str(error)
        else:
            self.error_message = repr(error)
            traceback.print_exception(error)
        if self.shaders.restore_working():
            self._last = None

    def _trim_pool(self, view: View) -> None:
        """Free the pooled textures when methods or size change; the pool would keep those of all earlier ones."""
        key = [name_of(method) for method in view.methods], view.size
        if key != self._pool_key:
            self.gpu.trim()
            self._pool_key = key

    def _latest_estimate(self, view: View, is_measured: bool) -> Finished | None:
        """Return the best estimate so far of the reference that a side shows, or that errors are measured against."""
        references = [method for method in view.methods if _is_reference(method)]
        if not references and not is_measured:
            return None
        reference = references[0] if references else Integral()
        estimate = self.reference.estimate(Request(view.scene, view.time_s, view.size, reference))
        if estimate is None:
            return None
        if self._finished is None or self._finished.estimate is not estimate:
            self._finished = Finished(estimate)
        return self._finished


def _is_reference(method: Method) -> TypeGuard[Reference]:
    return type(method) in REFERENCES.values()
