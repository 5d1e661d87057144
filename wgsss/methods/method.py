"""What a method is: its parameters, what it bakes, the passes it adds to a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.stage import Stage


@dataclass(frozen=True)
class Diffused:
    """What a method estimates, per pixel, rgba32float at the frame's size: M in W/m^2. A slot left empty is None.

    `together` is M_front + M_back, where there is a shorter way to that than to each: what asks for one of them alone
    pays for it.
    """

    M_front: Handle
    M_back: Handle | None = None
    together: Handle | None = None

    @property
    def M(self) -> tuple[Handle, ...]:
        """What M is the sum of."""
        if self.together is not None:
            return (self.together,)
        return (self.M_front,) if self.M_back is None else (self.M_front, self.M_back)


class Method(Protocol):
    """A frozen dataclass whose fields are the knobs, each with its unit and default."""

    source: ClassVar[str]
    """the paper"""
    sweep: ClassVar[tuple[dict[str, Any], ...]]
    """settings from cheap to dear"""

    def bake(self, stage: Stage) -> Any:
        """Compute, or load from the cache, what depends on meshes and materials but not on the frame."""

    def passes(self, frame: Frame) -> Diffused:
        """Declare the passes that estimate M."""
