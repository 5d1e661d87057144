"""Fast stand-ins for references: the M of Lambert times a factor."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from wgsss.reference import Estimate, Reference
from wgsss.registry import make_method
from wgsss.rendering import Renderer
from wgsss.scene import Scene
from wgsss.stage import Stage

FACTOR, ERROR = 1.25, 0.02


@dataclass(frozen=True)
class Scaled(Reference):
    """A reference with the M of Lambert times `factor`, and a standard error of ERROR times M."""

    factor: float = field(default=FACTOR, metadata={"unit": "", "range": (0.0, 10.0), "help": ""})

    source: ClassVar[str] = "a stand-in"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({},)

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        M = lambert(stage.rest, size, stage.time_s)
        return Estimate(self.factor * M, None, ERROR * M)


class Volume(Scaled):
    """The same reference with another name."""


def lambert(scene: Scene, size: tuple[int, int], time: float = 0.0) -> np.ndarray:
    """Render M (H, W, 3) by the method lambert."""
    return Renderer(scene, make_method("lambert"), size).frame(time, ("M_front",), timed=False).aovs["M_front"]
