"""Methods of two parts: a surface, which estimates M_front, and a translucency, which estimates M_back."""

from __future__ import annotations

from dataclasses import field, fields, make_dataclass, replace
from functools import cache
from typing import Any, ClassVar, Protocol, runtime_checkable

from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.methods.lambert import Lambert
from wgsss.methods.method import Diffused, Method
from wgsss.stage import Stage


class Translucency(Protocol):
    """A frozen dataclass whose fields are the knobs, each with its unit and default."""

    source: ClassVar[str]
    """the paper"""
    sweep: ClassVar[tuple[dict[str, Any], ...]]
    """settings from cheap to dear, beside the default"""
    beside: ClassVar[type]
    """the surfaces that it can do with: `object` for any"""

    def bake(self, stage: Stage) -> None:
        """Compute, or load from the cache, what depends on meshes and materials but not on the frame."""

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        """Declare the passes that estimate M_back, W/m^2 per pixel; None where nothing shines through."""


@runtime_checkable
class Joined(Protocol):
    """A translucency whose light some surface may diffuse along with its own."""

    def M(self, frame: Frame, surface: Method) -> Handle | None:
        """Declare the passes that estimate M_front + M_back at once; None where that is no shorter."""


class Pair:
    """M_front by one technique and M_back by another; the knobs are those of both."""

    parts: ClassVar[tuple[type[Method], type[Translucency]]]

    def __post_init__(self) -> None:
        self.made()  # the parts say what is wrong with their knobs

    def bake(self, stage: Stage) -> None:
        for part in self.made():
            part.bake(stage)

    def passes(self, frame: Frame) -> Diffused:
        surface, translucency = self.made()
        M = translucency.M(frame, surface) if isinstance(translucency, Joined) else None
        return replace(surface.passes(frame), M_back=translucency.M_back(frame, surface), together=M)

    def made(self) -> tuple[Method, Translucency]:
        """The two parts with their knobs set."""
        surface, translucency = self.parts
        return surface(**self._knobs(surface)), translucency(**self._knobs(translucency))

    def _knobs(self, part: Any) -> dict[str, Any]:
        return {knob.name: getattr(self, knob.name) for knob in fields(part)}


@cache
def pair(surface: type[Method], translucency: type[Translucency]) -> type[Method]:
    """The method of these two parts."""
    parts: tuple[Any, Any] = surface, translucency
    knobs = [
        (knob.name, knob.type, field(default=knob.default, metadata=knob.metadata))
        for part in parts
        for knob in fields(part)
    ]
    made: type[Method] = make_dataclass(
        f"{surface.__name__}And{translucency.__name__}",
        knobs,
        bases=(Pair,),
        frozen=True,
        namespace={
            "parts": parts,
            "source": "; ".join(dict.fromkeys(part.source for part in parts if part is not Lambert)),
            "sweep": (*surface.sweep, *translucency.sweep),
        },
    )
    return made
