"""What a reference knows of M, and how it is shown like a method's."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from wgsss.frame import Frame
from wgsss.methods.method import Diffused, Method
from wgsss.stage import Stage

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Estimate:
    """M per pixel, float32 (H, W, 3) in W/m^2, 0 where nothing is seen; row 0 is the top."""

    M_front: Array
    M_back: Array | None
    """None where the reference does not tell it from M_front, which then holds all of M"""
    error: Array
    """of M: its standard error, or the difference between two resolutions"""

    @property
    def M(self) -> Array:
        return self.M_front if self.M_back is None else self.M_front + self.M_back


class Reference(Method, Protocol):
    """A method that takes its time: it computes M apart from the frame that shows it."""

    @abstractmethod
    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        """M of the scene as posed at `size` (width, height) pixels, cached. May take minutes; shows how far it is."""

    def bake(self, stage: Stage) -> None:
        """Nothing: what depends on meshes alone is a part of `estimate`."""
        return None

    def passes(self, frame: Frame) -> Diffused:
        return shown(frame, self.estimate(frame.stage, frame.size))


def shown(frame: Frame, estimate: Estimate) -> Diffused:
    """Declare the passes that show an estimate of the frame's size."""
    back = None if estimate.M_back is None else _shown(frame, estimate.M_back)
    return Diffused(_shown(frame, estimate.M_front), back)


def _shown(frame: Frame, M: Array) -> Any:
    texels = np.concatenate([M, np.ones((*M.shape[:2], 1), np.float32)], axis=2)
    return frame.graph.draw("reference/show", size=frame.size, known=frame.stage.gpu.texture(texels, "rgba32float"))
