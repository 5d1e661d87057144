"""Methods compared with a reference: their pictures, their costs and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from wgsss.console import progress_bar
from wgsss.gpu import default_gpu
from wgsss.methods import Method
from wgsss.reference import Estimate, Reference
from wgsss.registry import make_method, methods_for, name_of
from wgsss.rendering import Image
from wgsss.scene import Scene
from wgsss.study.measurement import M_of, compute_truth, default_reference, knobs_of, make_reference, measure
from wgsss.study.metrics import Errors
from wgsss.study.run_record import Knob
from wgsss.text import one_line

if TYPE_CHECKING:
    from wgsss.study.causes import Causes

Array = npt.NDArray[Any]

WARM_FRAMES = 3
"""Number of frames of which the median time is taken."""


@dataclass(frozen=True, eq=False)
class Run:
    """One method of a comparison: its picture, its cost and its errors."""

    name: str
    """The method's name, with the knobs that distinguish it from others of that name."""
    method: str
    knobs: dict[str, Knob]
    bake_ms: float
    """Time to prepare the method, upload included. Cached data is read, not computed."""
    frame_ms: float
    passes: dict[str, float]
    """Time of each pass, ms."""
    bytes: int
    """Size of the textures and buffers that a frame needs, transient and persistent."""
    image: Image
    errors: Errors

    @property
    def M(self) -> Array:
        """(H, W, 3), W/m^2."""
        return M_of(self.image)


@dataclass(frozen=True, eq=False)
class Comparison:
    """A scene rendered by several methods and by a reference."""

    scene: str
    reference: str
    size: tuple[int, int]
    adapter: str
    mask: Array
    """The pixels that show an object, bool (H, W)."""
    truth: Estimate
    image: Image
    """The frame that shows the reference's estimate."""
    runs: tuple[Run, ...]
    causes: dict[str, Causes] = field(default_factory=dict)
    """Errors by cause, by the names of the runs. Only against the reference "volume"."""
    lights: dict[str, Comparison] = field(default_factory=dict)
    """The same comparison under other types of light."""

    def json(self) -> dict[str, Any]:
        """Return the numbers: scene, reference, size, adapter, methods, and causes and lights if there are any."""
        numbers: dict[str, Any] = {"scene": self.scene, "reference": self.reference, "adapter": self.adapter}
        numbers |= {"size": list(self.size), "methods": [self._run_json(run) for run in self.runs]}
        if self.causes:
            numbers["causes"] = {name: causes.json() for name, causes in self.causes.items()}
        if self.lights:
            numbers["lights"] = {name: other.json()["methods"] for name, other in self.lights.items()}
        return numbers

    def _run_json(self, run: Run) -> dict[str, Any]:
        own = {"scene": self.scene, "name": run.name, "method": run.method, "knobs": run.knobs, "size": list(self.size)}
        cost = {"bake_ms": run.bake_ms, "frame_ms": run.frame_ms, "passes": run.passes, "bytes": run.bytes}
        return {**own, "adapter": self.adapter, **cost, "error": run.errors.json()}


def compare(
    scene: Scene,
    methods: Sequence[str | Method] | None = None,
    reference: str | Reference | None = None,
    size: tuple[int, int] = (256, 256),
    time: float = 0.0,
    *,
    by_cause: bool = True,
) -> Comparison:
    """Render `scene`, `time` seconds into its motion, by each method and by a reference, and measure the errors.

    Methods and the reference are names, or instances with their knobs set. By default the methods are all that can draw
    the scene, and the reference is that of `default_reference`. Against "volume" the errors are also split
    by cause, unless `by_cause` is false. This computes the integral two or three more times.

    Raises InputError for unknown names and for scenes that the reference cannot render, and RenderError if a number is
    not finite.
    """
    listed = methods_for(scene) if methods is None else methods
    chosen = named([make_method(method) if isinstance(method, str) else method for method in listed])
    reference = reference or default_reference(scene, list(chosen.values()))
    reference = make_reference(reference) if isinstance(reference, str) else reference
    truth = compute_truth(reference, scene, size, time)
    runs = []
    for name, method in progress_bar(chosen.items(), desc=one_line(scene.name), unit="method"):
        measured = measure(scene, method, truth, size, time, frames=WARM_FRAMES)
        cost = measured.cost
        runs.append(
            Run(
                name,
                name_of(method),
                knobs_of(method),
                measured.bake_ms,
                cost.frame_ms,
                cost.passes,
                cost.bytes,
                measured.image,
                measured.errors,
            )
        )
    adapter = default_gpu().name
    comparison = Comparison(
        scene.name, name_of(reference), size, adapter, truth.mask, truth.estimate, truth.image, tuple(runs)
    )
    if comparison.reference != "volume" or not by_cause:
        return comparison
    from wgsss.study.causes import causes

    M = {run.name: run.M for run in runs}
    return replace(comparison, causes=causes(scene, M, truth.estimate.M, truth.mask, size, time))


def named(methods: Sequence[Method]) -> dict[str, Method]:
    """Give each method a name, and drop duplicates. Methods of one kind also get the knobs in which they differ."""
    kinds = [name_of(method) for method in methods]
    by_name = {}
    for kind, method in zip(kinds, methods, strict=True):
        same = [knobs_of(other) for other_kind, other in zip(kinds, methods, strict=True) if other_kind == kind]
        knobs = knobs_of(method)
        differ = [f"{knob}={value}" for knob, value in knobs.items() if any(other[knob] != value for other in same)]
        by_name[" ".join([kind, *differ])] = method
    return by_name
