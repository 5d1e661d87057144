"""One run of a bench: a method with its knobs set, in a scene; what it costs and how far off it is."""

from __future__ import annotations

import hashlib
import subprocess
import threading
import time
from dataclasses import asdict, dataclass, fields, is_dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import wgsss
from wgsss import cache
from wgsss.errors import InputError, RenderError
from wgsss.gpu import default_gpu
from wgsss.methods import make_method
from wgsss.reference import Estimate
from wgsss.rendering import Image, Renderer
from wgsss.scene import EnvironmentLight, Scene
from wgsss.stage import Stage
from wgsss.study.compare import make_reference, shown
from wgsss.study.cost import frame_cost
from wgsss.study.metrics import errors

FRAMES_S = 2.0
FEWEST = 5
"""frames that are timed: as many as fit FRAMES_S, and at least these"""

_one_at_a_time = threading.Lock()  # a worker may have several threads, and what they run would slow each other


@dataclass(frozen=True)
class Spec:
    """What to measure. `digest` stands for the scene's content, `step` is the setting's place in the method's sweep."""

    scene: str
    digest: str
    method: str
    knobs: dict[str, Any]
    step: int
    size: tuple[int, int]
    reference: str

    def json(self) -> dict[str, Any]:
        return {**asdict(self), "size": list(self.size), "version": version()}

    def __str__(self) -> str:
        return " ".join([self.scene, "by", self.method, *(f"{knob}={value}" for knob, value in self.knobs.items())])


def measure(scene: Scene, spec: Spec) -> dict[str, Any]:
    """Do one run.

    Returns what a line of runs.jsonl holds: the fields of `spec`, and `adapter`, `clock`, `version`, `date`; `bake_ms`,
    to prepare the method, and `bake_cached`, whether the cache had all of it; `frame_ms`, the median of the time
    that the passes of a frame take, by `clock`, its `frame_ms_quartiles` and `frames`, how many; `passes`, ms of each
    in the median frame; `bytes`, textures and buffers of a frame, transient and persistent; `error` {rel_rmse, psnr,
    flip, bias} and `flip_reason` where flip is missing; and `floor`, the rel_rmse that the reference's own error
    accounts for.

    Raises InputError and RenderError as the method and the reference do.
    """
    with _one_at_a_time:
        try:
            return _measured(scene, spec)
        except (InputError, RenderError) as error:
            raise type(error)(f"{spec}: {error}") from None


def _measured(scene: Scene, spec: Spec) -> dict[str, Any]:
    gpu = default_gpu()
    truth, shown_truth = _truth(scene, spec)
    known = set(cache.entries())
    start = time.perf_counter()
    renderer = Renderer(scene, make_method(spec.method, spec.knobs), spec.size, gpu)
    bake_ms, bake_cached = 1e3 * (time.perf_counter() - start), set(cache.entries()) <= known
    image = renderer.frame(aovs=("M_front", "M_back"), timed=False)  # the first frame pays for compilation
    cost = frame_cost(renderer, 0.0, FEWEST, FRAMES_S)
    found = errors(
        image.aovs["M_front"] + image.aovs["M_back"],
        truth.M,
        shown_truth.pixels[..., 3] > 0.0,
        error=truth.error,
        display=image.display,
        reference_display=shown_truth.display,
    ).json()
    return {
        **spec.json(),
        "adapter": adapter(),
        "clock": cost.clock,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "bake_ms": bake_ms,
        "bake_cached": bake_cached,
        "frame_ms": cost.frame_ms,
        "frame_ms_quartiles": list(cost.quartiles),
        "frames": cost.frames,
        "passes": cost.passes,
        "bytes": cost.bytes,
        "error": {name: found[name] for name in ("rel_rmse", "psnr", "flip", "bias", "flip_reason") if name in found},
        "floor": found["floor"],
    }


def adapter() -> str:
    """The adapter that runs are done on, in words."""
    return default_gpu().name


@lru_cache(maxsize=1)
def version() -> str:
    """The package's version and, of a checkout, its commit, which "-dirty" says has been changed since."""
    root = Path(wgsss.__file__).parents[1]
    if not (root / ".git").exists():
        return wgsss.__version__
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return wgsss.__version__
    return f"{wgsss.__version__}+{found}"


def digest(scene: Scene) -> str:
    """A name for a scene's content: meshes, materials, lights with their images, and camera, by all their fields."""
    found = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, np.ndarray):
            found.update(f"{value.dtype.str} {value.shape}:".encode())
            found.update(np.ascontiguousarray(value).tobytes())
        elif is_dataclass(value):
            add([type(value).__name__, *((f.name, getattr(value, f.name)) for f in fields(value))])
            if isinstance(value, EnvironmentLight):
                add(value.pixels())
        elif isinstance(value, tuple | list):
            found.update(f"{len(value)}(".encode())
            for item in value:
                add(item)
        else:
            found.update(f"{value!r},".encode())

    add(scene)
    return found.hexdigest()[:16]


_last: dict[Any, tuple[Estimate, Image]] = {}  # of the last scene only: runs come scene by scene


def _truth(scene: Scene, spec: Spec) -> tuple[Estimate, Image]:
    """What the reference makes of a scene."""
    key = (spec.digest, spec.size, spec.reference)
    if key not in _last:
        _last.clear()
        method = make_reference(spec.reference)
        estimate = method.estimate(Stage(default_gpu(), scene), spec.size)
        _last[key] = estimate, shown(estimate, method, scene, spec.size, 0.0)
    return _last[key]
