"""What has been measured of a scene: in this session, and by a bench before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wgsss.errors import InputError
from wgsss.methods import Method
from wgsss.registry import REFERENCES, make_method, name_of
from wgsss.study.provenance import adapter, scene_digest
from wgsss.study.run_log import FILE, read_runs
from wgsss.study.run_record import Run
from wgsss.study.scatter import panels
from wgsss.viewer.costs import milliseconds

if TYPE_CHECKING:
    from wgsss.viewer.painter import Painter
    from wgsss.viewer.state import State

FOLDER = Path("bench")
"""where `wgsss bench` writes, unless told otherwise"""
LENGTH = 64
"""points that are kept, of all views"""


@dataclass(frozen=True)
class Point:
    """A method with its knobs set, what a frame costs by it, and how far off it is."""

    method: str
    label: str
    """the method, and its knobs that are not at their defaults"""
    ms: float
    rel_rmse: float


class Trail:
    """The points of a session, and those of a bench in the working directory."""

    def __init__(self) -> None:
        self._opened: Any = None
        self._points: dict[Any, Point] = {}
        """by view and label, the last measured last"""
        self._bench: tuple[Any, list[Run]] = (), []
        """what runs were looked up for, and the runs"""

    def follow(self, state: State, painter: Painter, size: tuple[int, int]) -> None:
        """Take up what was measured of both sides; what is known already is replaced."""
        if state.opened is not self._opened:
            self._opened = state.opened
            self._points.clear()
        if painter.measured is None:
            return
        for side, (method, errors) in enumerate(zip(state.methods, painter.measured.errors, strict=True)):
            ms = milliseconds(painter, side)
            if errors is not None and errors.rel_rmse and ms and type(method) not in REFERENCES.values():
                label = label_of(method)
                self._points.pop((_view(state, size), label), None)
                self._points[_view(state, size), label] = Point(name_of(method), label, ms, errors.rel_rmse)
        for key in list(self._points)[:-LENGTH]:
            del self._points[key]

    def points(self, state: State, size: tuple[int, int]) -> list[Point]:
        """Those at the view that is shown, the last measured last."""
        return [point for (view, _), point in self._points.items() if view == _view(state, size)]

    def bench(self, state: State) -> list[Run]:
        """The runs of the last bench of the scene, as of its own camera, on this adapter; empty where there is none."""
        if not (FOLDER / FILE).exists():
            return []
        lit = state.scene.objects, state.scene.lights
        if lit != self._bench[0]:
            self._bench = lit, _last_bench(scene_digest(replace(state.opened, objects=lit[0], lights=lit[1])))
        return self._bench[1]


def label_of(method: Method) -> str:
    """A method and its knobs that are not at their defaults, in words."""
    name = name_of(method)
    usual = vars(make_method(name))
    return words(name, {knob: value for knob, value in vars(method).items() if value != usual[knob]})


def words(method: str, knobs: dict[str, Any]) -> str:
    return ", ".join([method, *(f"{k} {f'{v:.4g}' if isinstance(v, float) else v}" for k, v in knobs.items())])


def _view(state: State, size: tuple[int, int]) -> Any:
    scene = state.scene
    return scene.objects, scene.lights, scene.camera, state.time_s, size


def _last_bench(seen: str) -> list[Run]:
    try:
        runs = [run for run in read_runs(FOLDER) if run["digest"] == seen and run["adapter"] == adapter()]
    except InputError:
        return []
    return next((list(panel.runs) for panel in panels(runs) if runs[-1] in panel.runs), []) if runs else []
