"""What a reference computes, and how it is shown in a frame like the result of a method."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.methods.method import Diffused, Method
from wgsss.stage import Stage

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Estimate:
    """M per pixel, float32 (H, W, 3) in W/m^2, 0 where no object is seen. Row 0 is the top."""

    M_front: Array
    M_back: Array | None
    """None if the reference does not separate it from M_front, which then is all of M."""
    error: Array
    """The error of M: its standard error, or the difference between two resolutions."""

    @property
    def M(self) -> Array:
        return self.M_front if self.M_back is None else self.M_front + self.M_back


class Reference(Method, Protocol):
    """A method that may take minutes: it computes M apart from the frame that shows it."""

    @abstractmethod
    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        """Return M of the scene as posed, at `size` (width, height) pixels. Cached. Shows a progress bar."""

    def bake(self, stage: Stage) -> None:
        """Do nothing: `estimate` computes everything."""
        return None

    def passes(self, frame: Frame) -> Diffused:
        return show(frame, self.estimate(frame.stage, frame.size))


@dataclass(frozen=True, eq=False)
class Finished(Method):
    """A method that shows an estimate which a reference has already computed for the frame's scene and size."""

    estimate: Estimate

    source: ClassVar[str] = ""
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()

    def bake(self, stage: Stage) -> None:
        return None

    def passes(self, frame: Frame) -> Diffused:
        return show(frame, self.estimate)


def show(frame: Frame, estimate: Estimate) -> Diffused:
    """Declare the passes that show an estimate of the frame's size."""
    back = None if estimate.M_back is None else _show(frame, estimate.M_back)
    return Diffused(_show(frame, estimate.M_front), back)


def _show(frame: Frame, M: Array) -> Handle:
    texels = np.concatenate([M, np.ones((*M.shape[:2], 1), np.float32)], axis=2)
    shown: Handle = frame.graph.draw(
        "reference/show", size=frame.size, known=frame.stage.gpu.texture(texels, "rgba32float")
    )
    return shown
