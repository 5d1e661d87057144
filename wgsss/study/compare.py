"""Methods beside a reference: their pictures, what they cost and how far off they are."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy.typing as npt

from wgsss.console import progress_bar
from wgsss.errors import unknown
from wgsss.gpu import default_gpu
from wgsss.methods import METHODS, Method, make_method, name_of
from wgsss.reference import REFERENCES, Estimate, Reference
from wgsss.rendering import Image, Renderer
from wgsss.scene import Scene
from wgsss.stage import Stage
from wgsss.study.cost import frame_cost
from wgsss.study.metrics import Errors, errors
from wgsss.text import one_line

if TYPE_CHECKING:
    from wgsss.study.causes import Causes

Array = npt.NDArray[Any]

WARM_FRAMES = 3
"""frames that the time of one is the median of"""
_AOVS = ("M_front", "M_back", "irradiance", "depth")


@dataclass(frozen=True, eq=False)
class Run:
    """One method: what it made, what that cost and how far it is from the reference."""

    name: str
    """the method's, with the knobs that tell it from others of that name"""
    method: str
    knobs: dict[str, Any]
    bake_ms: float
    """upload included; what the cache holds is read, not made"""
    frame_ms: float
    passes: dict[str, float]
    """ms of each"""
    bytes: int
    """textures and buffers that a frame needs, transient and persistent"""
    image: Image
    errors: Errors

    @property
    def M(self) -> Array:
        """(H, W, 3), W/m^2."""
        return self.image.aovs["M_front"] + self.image.aovs["M_back"]


@dataclass(frozen=True, eq=False)
class Comparison:
    """A scene by several methods and by a reference."""

    scene: str
    reference: str
    size: tuple[int, int]
    adapter: str
    seen: Array
    """bool (H, W): where an object shows"""
    truth: Estimate
    image: Image
    """the frame that the reference makes"""
    runs: tuple[Run, ...]
    causes: dict[str, Causes] = field(default_factory=dict)
    """by the runs' names; against the reference "volume" only"""
    lights: dict[str, Comparison] = field(default_factory=dict)
    """the same under lights of other types"""

    def json(self) -> dict[str, Any]:
        """The numbers: scene, reference, size, adapter, methods, and causes and lights where there are."""
        found: dict[str, Any] = {key: getattr(self, key) for key in ("scene", "reference", "adapter")}
        found |= {"size": list(self.size), "methods": [self._described(run) for run in self.runs]}
        if self.causes:
            found["causes"] = {name: causes.json() for name, causes in self.causes.items()}
        if self.lights:
            found["lights"] = {name: other.json()["methods"] for name, other in self.lights.items()}
        return found

    def _described(self, run: Run) -> dict[str, Any]:
        own = {"scene": self.scene, "name": run.name, "method": run.method, "knobs": run.knobs, "size": list(self.size)}
        cost = {"bake_ms": run.bake_ms, "frame_ms": run.frame_ms, "passes": run.passes, "bytes": run.bytes}
        return {**own, "adapter": self.adapter, **cost, "error": run.errors.json()}


def compare(
    scene: Scene,
    methods: Sequence[str | Method] = tuple(METHODS),
    reference: str | Reference = "integral",
    size: tuple[int, int] = (256, 256),
    time: float = 0.0,
    *,
    by_cause: bool = True,
) -> Comparison:
    """Render `scene`, `time` seconds into its motion, by each method and by a reference, and measure the differences.

    Methods and the reference are names, or instances with knobs of their own. Against "volume" the errors are split by
    cause, where not told otherwise; that takes the integral two or three times over.

    Raises InputError for names that are not known and scenes that the reference cannot have, and RenderError where a
    number is not finite.
    """
    made = named([make_method(method) if isinstance(method, str) else method for method in methods])
    truth_by = make_reference(reference) if isinstance(reference, str) else reference
    gpu = default_gpu()
    truth = truth_by.estimate(Stage(gpu, scene, time), size)
    image = shown(truth, truth_by, scene, size, time)
    seen = image.pixels[..., 3] > 0.0
    runs = []
    for name, method in progress_bar(made.items(), desc=one_line(scene.name), unit="method"):
        run = _run(name, method, scene, size, time)
        found = errors(
            run["image"].aovs["M_front"] + run["image"].aovs["M_back"],
            truth.M,
            seen,
            error=truth.error,
            display=run["image"].display,
            reference_display=image.display,
        )
        runs.append(Run(name=name, errors=found, **run))
    comparison = Comparison(scene.name, name_of(truth_by), size, gpu.name, seen, truth, image, tuple(runs))
    if comparison.reference != "volume" or not by_cause:
        return comparison
    from wgsss.study.causes import causes

    return replace(comparison, causes=causes(scene, {run.name: run.M for run in runs}, truth.M, seen, size, time))


@dataclass(frozen=True, eq=False)
class _Known(Reference):
    """A reference that has done its work: what takes long, and may warn, is to happen once."""

    known: Estimate

    source: ClassVar[str] = ""
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()

    def bake(self, stage: Stage) -> None:
        return None

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        return self.known


def shown(truth: Estimate, by: Reference, scene: Scene, size: tuple[int, int], time: float) -> Image:
    """The frame that an estimate makes, with its error beside it."""
    image = Renderer(scene, _Known(truth), size).frame(time, _AOVS, timed=False)
    knobs = " ".join(f"{knob}={value}" for knob, value in vars(by).items())
    return replace(
        image,
        aovs={**image.aovs, "error": truth.error},
        metadata={**image.metadata, "method": name_of(by), "knobs": knobs},
    )


def make_reference(name: str) -> Reference:
    """The reference of that name. Raises InputError for one that is not known."""
    if name not in REFERENCES:
        raise unknown("reference", name, REFERENCES)
    made: Any = make_method(name)
    return made


def named(methods: Sequence[Method]) -> dict[str, Method]:
    """Methods by their names, with the knobs that differ where a name is there twice. The same twice is one."""
    names = [name_of(method) for method in methods]
    found = {}
    for name, method in zip(names, methods, strict=True):
        same = [vars(other) for other_name, other in zip(names, methods, strict=True) if other_name == name]
        differ = [f"{knob}={v}" for knob, v in vars(method).items() if any(other[knob] != v for other in same)]
        found[" ".join([name, *differ])] = method
    return found


def _run(name: str, method: Method, scene: Scene, size: tuple[int, int], time: float) -> dict[str, Any]:
    start = clock.perf_counter()
    renderer = Renderer(scene, method, size)
    baked = clock.perf_counter()
    image = renderer.frame(time, _AOVS, timed=False)
    cost = frame_cost(renderer, time, WARM_FRAMES)
    return {
        "method": name_of(method),
        "knobs": dict(vars(method)),
        "bake_ms": 1000.0 * (baked - start),
        "frame_ms": cost.frame_ms,
        "passes": cost.passes,
        "bytes": cost.bytes,
        "image": image,
    }
