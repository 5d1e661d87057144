"""One run of the benchmark: a method with its knobs set, in a scene, measured against a reference."""

from __future__ import annotations

import threading
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from wgsss.errors import InputError, RenderError
from wgsss.registry import make_method
from wgsss.scene import Scene
from wgsss.study.measurement import Truth, compute_truth, make_reference, measure
from wgsss.study.metrics import finite
from wgsss.study.provenance import adapter, version
from wgsss.study.run_record import Knob, Run, RunErrors

FRAMES_S = 2.0
FEWEST = 5
"""As many frames are timed as FRAMES_S seconds allow, but at least FEWEST."""

_one_at_a_time = threading.Lock()  # a worker may have several threads, and runs at the same time would slow each other


@dataclass(frozen=True)
class RunSpec:
    """What to measure. `digest` identifies the scene's content. `step` is the place of the setting in the sweep."""

    scene: str
    digest: str
    method: str
    knobs: dict[str, Knob]
    step: int
    size: tuple[int, int]
    reference: str

    def json(self) -> dict[str, Any]:
        """Return the fields of a Run that are known before it is done."""
        return {**asdict(self), "size": list(self.size), "version": version()}

    def __str__(self) -> str:
        return " ".join([self.scene, "by", self.method, *(f"{knob}={value}" for knob, value in self.knobs.items())])


def execute(scene: Scene, spec: RunSpec) -> Run:
    """Do one run. Raises the InputError or RenderError of the method or the reference, with the run in front."""
    with _one_at_a_time:
        try:
            return _execute(scene, spec)
        except (InputError, RenderError) as error:
            raise type(error)(f"{spec}: {error}") from None


def _execute(scene: Scene, spec: RunSpec) -> Run:
    truth = _truth(scene, spec)
    method = make_method(spec.method, spec.knobs)
    measured = measure(scene, method, truth, spec.size, frames=FEWEST, seconds=FRAMES_S)
    errors = measured.errors
    error: RunErrors = {
        "rel_rmse": finite(errors.rel_rmse),
        "psnr": finite(errors.psnr),
        "flip": finite(errors.flip),
        "bias": finite(errors.bias),
    }
    if errors.flip_reason:
        error["flip_reason"] = errors.flip_reason
    cost = measured.cost
    return {
        **spec.json(),  # type: ignore[typeddict-item]
        "adapter": adapter(),
        "clock": cost.clock,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "bake_ms": measured.bake_ms,
        "bake_cached": measured.bake_cached,
        "frame_ms": cost.frame_ms,
        "frame_ms_quartiles": list(cost.quartiles),
        "frames": cost.frames,
        "passes": cost.passes,
        "bytes": cost.bytes,
        "error": error,
        "floor": finite(errors.floor),
    }


_last_truth: dict[tuple[str, tuple[int, int], str], Truth] = {}
"""The truth of the last scene. A benchmark measures one scene after another, so that earlier ones are not needed."""


def _truth(scene: Scene, spec: RunSpec) -> Truth:
    key = (spec.digest, spec.size, spec.reference)
    if key not in _last_truth:
        _last_truth.clear()
        _last_truth[key] = compute_truth(make_reference(spec.reference), scene, spec.size)
    return _last_truth[key]
