"""The interface of methods: their knobs, what they bake, and the passes that they declare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.stage import Stage


@dataclass(frozen=True)
class Diffused:
    """The estimate of a method, W/m^2 per pixel: textures in rgba32float at the frame's size."""

    M_front: Handle
    M_back: Handle | None = None
    """None: not estimated"""
    together: Handle | None = None
    """M_front + M_back, where their sum takes fewer passes than both. Only those of M_front and M_back run that a frame
    is asked for."""

    @property
    def M(self) -> tuple[Handle, ...]:
        """One or two textures whose sum is M."""
        if self.together is not None:
            return (self.together,)
        return (self.M_front,) if self.M_back is None else (self.M_front, self.M_back)


class Method(Protocol):
    """A frozen dataclass whose fields are the knobs, each with its unit and default."""

    source: ClassVar[str]
    """the paper: author and year"""
    sweep: ClassVar[tuple[dict[str, Any], ...]]
    """settings of the knobs that `wgsss bench` measures, from fast to slow"""

    def bake(self, stage: Stage) -> None:
        """Compute, or load from the cache, the data that depend on meshes and materials but not on the frame."""

    def passes(self, frame: Frame) -> Diffused:
        """Declare the passes that estimate M."""
