"""Measurements of a scene: by the viewer since the scene was opened, and by `wgsss bench` before."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wgsss.errors import InputError
from wgsss.methods import Method
from wgsss.registry import REFERENCES, name_of
from wgsss.scene import Scene
from wgsss.study.metrics import Errors
from wgsss.study.provenance import adapter, scene_digest
from wgsss.study.run_log import FILE, read_runs
from wgsss.study.run_record import Run
from wgsss.study.scatter import panels, setting_text
from wgsss.viewer.command import changed_knobs
from wgsss.viewer.pictures import View

BENCH_FOLDER = Path("bench")
"""where `wgsss bench` writes by default"""
MAX_POINTS = 64
"""points that are kept, of all views together; the oldest are dropped"""


@dataclass(frozen=True)
class MeasuredPoint:
    """A method with its knobs, the time that a frame takes by it, and its error."""

    method: str
    label: str
    """the method, and its knobs that are not at their defaults"""
    ms: float
    rel_rmse: float


class History:
    """The points measured since a scene was opened, and the runs of the last benchmark of the scene."""

    def __init__(self) -> None:
        self._points: dict[tuple[Hashable, str], MeasuredPoint] = {}
        """by view and label, in the order in which they were measured last"""
        self._bench_key: tuple[Hashable, ...] = ()
        """objects and lights that the runs were looked up for"""
        self._bench_runs: list[Run] = []

    def record(self, view: View, frame_ms: Sequence[float], errors: Sequence[Errors | None]) -> None:
        """Add a point for each side that has a time and an error, in place of an older point with the same label.

        References are left out.
        """
        for method, ms, error in zip(view.methods, frame_ms, errors, strict=True):
            if error is not None and error.rel_rmse and ms and type(method) not in REFERENCES.values():
                label = method_label(method)
                self._points.pop((_key(view), label), None)
                self._points[_key(view), label] = MeasuredPoint(name_of(method), label, ms, error.rel_rmse)
        for key in list(self._points)[:-MAX_POINTS]:
            del self._points[key]

    def points(self, view: View) -> list[MeasuredPoint]:
        """Return the points measured for a view, by any method, the oldest first."""
        return [point for (key, _), point in self._points.items() if key == _key(view)]

    def bench_runs(self, opened: Scene, scene: Scene) -> list[Run]:
        """Return the runs of the last benchmark of a scene on this adapter, or none.

        A benchmark uses the camera of the scene as it was opened; objects and lights must be those of `scene`.
        """
        if not (BENCH_FOLDER / FILE).exists():
            return []
        key = scene.objects, scene.lights
        if key != self._bench_key:
            self._bench_key = key
            self._bench_runs = _last_bench(scene_digest(replace(opened, objects=scene.objects, lights=scene.lights)))
        return self._bench_runs


def method_label(method: Method) -> str:
    """Return the name of a method and its knobs that are not at their defaults."""
    return setting_text(name_of(method), changed_knobs(method))


def _key(view: View) -> Hashable:
    """Return all that M depends on in a view, apart from the method."""
    scene = view.scene
    return scene.objects, scene.lights, scene.camera, view.time_s, view.size


def _last_bench(digest: str) -> list[Run]:
    """Return the runs that belong with the last run of a scene on this adapter, or none."""
    try:
        runs = [run for run in read_runs(BENCH_FOLDER) if run["digest"] == digest and run["adapter"] == adapter()]
    except InputError:
        return []
    return next((list(panel.runs) for panel in panels(runs) if runs[-1] in panel.runs), []) if runs else []
