"""Methods made of two parts: a surface method, which estimates M_front, and a translucency method, for M_back."""

from __future__ import annotations

from dataclasses import Field, field, fields, make_dataclass, replace
from functools import cache
from typing import Any, ClassVar, Protocol, runtime_checkable

from wgsss.frame import Frame
from wgsss.graph import Handle
from wgsss.methods.lambert import Lambert
from wgsss.methods.method import Diffused, Method
from wgsss.stage import Stage


class Translucency(Protocol):
    """A translucency method: a frozen dataclass whose fields are its knobs, each with a default and metadata."""

    source: ClassVar[str]
    """the paper that describes it: authors and year"""
    sweep: ClassVar[tuple[dict[str, Any], ...]]
    """settings for `wgsss bench`, from fast to slow, without the default"""
    beside: ClassVar[type]
    """base class of the surface methods that it can be paired with; `object`: all"""

    def bake(self, stage: Stage) -> None:
        """Compute, or load from the cache, the data that depend on meshes and materials but not on the frame."""

    def M_back(self, frame: Frame, surface: Method) -> Handle | None:
        """Declare the passes that estimate M_back, W/m^2, rgba32float per pixel; None: M_back is 0 everywhere."""


@runtime_checkable
class JointTranslucency(Protocol):
    """A translucency method that can estimate M_front + M_back together at a lower cost than one after the other."""

    def M(self, frame: Frame, surface: Method) -> Handle | None:
        """Declare the passes that estimate M_front + M_back, W/m^2; None: this surface method does not allow it."""


class Pair:
    """A method that estimates M_front by its first part and M_back by its second. Its knobs are those of both parts."""

    parts: ClassVar[tuple[type[Method], type[Translucency]]]

    def __post_init__(self) -> None:
        self.instances()  # the parts check their knobs

    def bake(self, stage: Stage) -> None:
        """Bake the data of both parts."""
        for part in self.instances():
            part.bake(stage)

    def passes(self, frame: Frame) -> Diffused:
        """Declare the passes of both parts."""
        surface, translucency = self.instances()
        M = translucency.M(frame, surface) if isinstance(translucency, JointTranslucency) else None
        return replace(surface.passes(frame), M_back=translucency.M_back(frame, surface), together=M)

    def instances(self) -> tuple[Method, Translucency]:
        """Return the two parts, with the pair's values of their knobs."""
        surface, translucency = self.parts
        return surface(**self._values(surface)), translucency(**self._values(translucency))

    def _values(self, part: type[Method | Translucency]) -> dict[str, Any]:
        return {knob.name: getattr(self, knob.name) for knob in _knobs(part)}


@cache
def pair(surface: type[Method], translucency: type[Translucency]) -> type[Method]:
    """Return the method of two parts. Equal arguments give the same class.

    Its sweep varies the knobs of one part while those of the other have their defaults.
    """
    parts = surface, translucency
    knobs = [
        (knob.name, knob.type, field(default=knob.default, metadata=knob.metadata))
        for part in parts
        for knob in _knobs(part)
    ]
    method: type[Method] = make_dataclass(
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
    return method


def _knobs(part: type[Method | Translucency]) -> tuple[Field[Any], ...]:
    return fields(part)  # type: ignore[arg-type]  # the protocols do not say that their classes are dataclasses
