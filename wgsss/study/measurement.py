"""The measurement of one method in one scene: its picture, its cost, and its errors against a finished reference."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy.typing as npt

from wgsss import cache
from wgsss.errors import unknown
from wgsss.gpu import default_gpu
from wgsss.methods import Method
from wgsss.reference import Estimate, Finished, Reference
from wgsss.registry import REFERENCES, make_method, name_of
from wgsss.rendering import Image, Renderer
from wgsss.scene import Scene
from wgsss.stage import Stage
from wgsss.study.cost import Cost, frame_cost
from wgsss.study.metrics import Errors, errors
from wgsss.study.run_record import Knob

AOVS = ("M_front", "M_back", "irradiance", "depth")

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Truth:
    """What a reference has computed for a scene, and the frame that shows it."""

    estimate: Estimate
    image: Image

    @property
    def mask(self) -> Array:
        """The pixels that show an object, bool (H, W)."""
        mask: Array = self.image.pixels[..., 3] > 0.0
        return mask


@dataclass(frozen=True, eq=False)
class Measurement:
    """One method in one scene at one size."""

    image: Image
    """The frame, with AOVS."""
    bake_ms: float
    """Time to prepare the method, upload included. Cached data is read, not computed."""
    bake_cached: bool
    """Whether the cache already held everything that the method prepares."""
    cost: Cost
    errors: Errors


def compute_truth(reference: Reference, scene: Scene, size: tuple[int, int], time_s: float = 0.0) -> Truth:
    """Wait until a reference has computed M, and render the frame that shows it, with its error as an extra output."""
    estimate = reference.estimate(Stage(default_gpu(), scene, time_s), size)
    image = Renderer(scene, Finished(estimate), size).frame(time_s, AOVS, timed=False)
    knobs = " ".join(f"{knob}={value}" for knob, value in knobs_of(reference).items())
    image = replace(
        image,
        aovs={**image.aovs, "error": estimate.error},
        metadata={**image.metadata, "method": name_of(reference), "knobs": knobs},
    )
    return Truth(estimate, image)


def measure(
    scene: Scene,
    method: Method,
    truth: Truth,
    size: tuple[int, int],
    time_s: float = 0.0,
    *,
    frames: int,
    seconds: float = 0.0,
) -> Measurement:
    """Prepare a method, render a frame, time at least `frames` more frames, and compare M with the truth.

    Frames are timed for `seconds` if this allows more. Raises RenderError if a number is not finite.
    """
    known = set(cache.entries())
    start = time.perf_counter()
    renderer = Renderer(scene, method, size)
    bake_ms = 1e3 * (time.perf_counter() - start)
    is_cached = set(cache.entries()) <= known
    image = renderer.frame(time_s, AOVS, timed=False)  # the first frame includes compilation
    cost = frame_cost(renderer, time_s, frames, seconds)
    differences = errors(
        M_of(image),
        truth.estimate.M,
        truth.mask,
        error=truth.estimate.error,
        display=image.display,
        reference_display=truth.image.display,
    )
    return Measurement(image, bake_ms, is_cached, cost, differences)


def M_of(image: Image) -> Array:
    """Return M (H, W, 3) of a frame with AOVS, W/m^2."""
    return image.aovs["M_front"] + image.aovs["M_back"]


def knobs_of(method: Method) -> dict[str, Knob]:
    """Return the knobs of a method with their values."""
    return {f.name: getattr(method, f.name) for f in fields(method)}  # type: ignore[arg-type]


def default_reference(scene: Scene, methods: Sequence[Method]) -> str:
    """Return the name of the reference for methods in a scene, if the user names none.

    It is the integral unless a material has maps of layers. There, methods that scatter light once, those with a knob
    `multiple` that is off, are compared with `layers`, and others with `volume`.
    """
    if not any(thing.material.maps.layers for thing in scene.objects):
        return "integral"
    once = all(getattr(method, "multiple", True) in (False, "off") for method in methods)
    return "layers" if once else "volume"


def make_reference(name: str) -> Reference:
    """Return the reference with this name. Raises InputError for an unknown name."""
    if name not in REFERENCES:
        raise unknown("reference", name, REFERENCES)
    return make_method(name)  # type: ignore[return-value]
