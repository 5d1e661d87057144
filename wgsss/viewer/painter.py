"""What is drawn of the state, when, and how finely: coarsely while things move, in full once they are still."""

from __future__ import annotations

import time
import traceback
from typing import Any

from wgsss.errors import InputError, RenderError
from wgsss.gpu import Gpu
from wgsss.methods import Method
from wgsss.reference import Integral
from wgsss.registry import REFERENCES, name_of
from wgsss.viewer.measure import Measured, measure
from wgsss.viewer.pace import STILL_S, Pace
from wgsss.viewer.pictures import Drawing, Easel, Picture
from wgsss.viewer.reload import Shaders
from wgsss.viewer.state import State
from wgsss.viewer.truth import Known, Truth, View
from wgsss.wgsl import WgslError


def _is_reference(method: Method) -> bool:
    return type(method) in REFERENCES.values()


class Painter:
    """Keeps the pictures of both sides as the state has them; where that goes wrong, those that were there."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.easel, self.pace, self.shaders = Easel(gpu), Pace(), Shaders()
        self.truth = Truth()
        self.drawing: Drawing | None = None
        self.sides: list[Picture | None] = [None, None]
        """the pictures of the left and the right side: None is a reference that is not known yet"""
        self.measured: Measured | None = None
        self.scale = 1.0
        """share of the full size that the pictures have"""
        self.seconds = 0.0
        """that the last picture took"""
        self.fault = ""
        """what keeps the pictures from being those of the state and the shaders as they are"""
        self.present: list[Method] = []
        """the methods that the last drawing was asked of"""
        self._drawn: Any = None
        """the view that was drawn last, how finely, with which reference, and whether it moved: then nothing was
        measured"""
        self._last_known: Known | None = None
        self._changed_s = -1.0
        self._pooled: Any = None
        """the methods and the size that the device's pool is for"""

    def reread(self) -> bool:
        """Whether shaders have changed: all is drawn anew then."""
        if not self.shaders.changed():
            return False
        self._drawn = None
        return True

    def is_done(self, state: State, size: tuple[int, int]) -> bool:
        """Whether the pictures are of the state as it is, in full."""
        return self._drawn is not None and (*self._drawn[:2], self._drawn[3]) == (_view(state, size), 1.0, False)

    def paint(self, state: State, full: tuple[int, int]) -> bool:
        """Draw what is not drawn yet, at most at a size in pixels; whether there is something new."""
        import wgpu

        view, now = _view(state, full), time.perf_counter()
        last = None if self._drawn is None else self._drawn[0]
        if view != last:
            self._changed_s = now
        pooled = [name_of(method) for method in state.methods], full
        if pooled != self._pooled:
            self.gpu.trim()  # or what pictures of all earlier methods and sizes needed would be kept
            self._pooled = pooled
        moving = state.playing or (last is not None and now - self._changed_s < STILL_S)
        scale = self.pace.scale if moving else 1.0
        known = None if moving else self._known(state, full)
        if self.is_done(state, full) and self._drawn[2] is known:
            return False
        if view == last and moving and self._drawn[1] >= scale:
            return False
        size = max(int(full[0] * scale), 1), max(int(full[1] * scale), 1)
        methods = [known if _is_reference(m) else m for m in state.methods]
        self.present = [m for m in methods if m is not None]
        self._drawn = view, scale, known, moving
        try:
            self.drawing = self.easel.draw(
                state.scene, self.present, size, state.time_s, state.layer, timed=scale == 1.0
            )
            self.gpu.fence()
            pictures = iter(self.drawing.pictures)
            self.sides = [None if m is None else next(pictures) for m in methods]
            self.scale = scale
            self.measured = None if moving else measure(self.drawing, self.sides, known)
        except Exception as error:  # shaders that are being written may break anything
            if isinstance(error, InputError | RenderError | WgslError | wgpu.GPUError):
                self.fault = str(error)
            else:
                self.fault = repr(error)
                traceback.print_exc()
            if self.shaders.undo():
                self._drawn = None
            return False
        self.shaders.keep()
        if not self.shaders.is_behind:
            self.fault = ""
        self.seconds = time.perf_counter() - now
        if moving:
            self.pace.took(self.seconds)
        return True

    def _known(self, state: State, size: tuple[int, int]) -> Known | None:
        """What is known by now of the reference that a side shows, or errors are told against."""
        references: list[Any] = [m for m in state.methods if _is_reference(m)]
        if not references and not state.is_measured:
            return None
        reference = references[0] if references else Integral()
        found = self.truth.of(View(state.scene, state.time_s, size, reference))
        if found is None:
            return None
        if self._last_known is None or self._last_known.estimate is not found:
            self._last_known = Known(found)
        return self._last_known


def _view(state: State, size: tuple[int, int]) -> Any:
    """All that the pictures depend on, but for how finely they are drawn and what is known of a reference."""
    return state.scene, tuple(state.methods), state.layer, state.time_s, size
