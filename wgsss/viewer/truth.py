"""References in the background: a process of its own refines what the present view should look like."""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Thread
from typing import Any, ClassVar

import numpy as np

from wgsss.errors import InputError, RenderError
from wgsss.frame import Frame
from wgsss.methods import Diffused
from wgsss.reference import Estimate, Reference
from wgsss.reference.estimate import show
from wgsss.scene import Scene
from wgsss.stage import Stage


@dataclass(frozen=True, eq=False)
class Known:
    """A method whose M is known."""

    estimate: Estimate

    source: ClassVar[str] = ""
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ()

    def bake(self, stage: Stage) -> None:
        pass

    def passes(self, frame: Frame) -> Diffused:
        return show(frame, self.estimate)


SHARES = (0.25, 0.5, 1.0)
"""of the picture's sides, one after the other"""

GONE = "the process that estimates references has ended"


@dataclass(frozen=True, eq=False)
class View:
    """What is to be estimated."""

    scene: Scene
    time_s: float
    size: tuple[int, int]
    reference: Reference

    def same(self, other: View | None) -> bool:
        return other is not None and self.scene is other.scene and vars(self) == vars(other)


class Truth:
    """The best estimate there is of the view that was asked for last."""

    def __init__(self) -> None:
        self._view: View | None = None
        self._found: Estimate | None = None
        self._process: Any = None
        self._pipe: Any = None
        self._wanted: SimpleQueue[tuple[int, View]] = SimpleQueue()
        self._number = 0
        """of the view that was asked for last"""
        self.share = 0.0
        """of the picture's sides that the estimate has; 0: there is none yet"""
        self.fault = ""
        """why there is none"""

    def of(self, view: View) -> Estimate | None:
        """What is known of a view by now, at its size."""
        if not view.same(self._view):
            self._ask(view)
        while not self.fault and self._pipe.poll():
            try:
                asked, share, found = self._pipe.recv()
            except (EOFError, OSError):
                self.fault = GONE
                break
            if asked != self._number:
                continue
            if isinstance(found, str):
                self.fault = found
            else:
                self._found, self.share = _enlarged(found, view.size), share
        return self._found

    @property
    def is_refining(self) -> bool:
        return self._view is not None and self.share < 1.0 and not self.fault

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.terminate()
            self._process.join()

    def _ask(self, view: View) -> None:
        if self._process is None or not self._process.is_alive():
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_work, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()  # so that its end is noticed
            self._wanted = SimpleQueue()
            Thread(target=_tell, args=(self._pipe, self._wanted), daemon=True).start()
        self._view, self._found, self.share, self.fault = view, None, 0.0, ""
        self._number += 1
        self._wanted.put((self._number, view))


def _tell(pipe: Any, wanted: SimpleQueue[tuple[int, View]]) -> None:
    """Tell the process what is wanted: it listens between estimates, and a window cannot wait so long."""
    while True:
        asked = wanted.get()
        while not wanted.empty():
            asked = wanted.get()
        try:
            pipe.send(asked)
        except OSError:
            return


def _work(pipe: Any) -> None:
    """Estimate what is asked for, coarsely first, until something else is."""
    from wgsss.gpu import default_gpu

    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # bars are for those who wait for them
    while True:
        try:
            asked, view = pipe.recv()
        except EOFError:
            return
        try:
            stage = Stage(default_gpu(), view.scene, view.time_s)
            for share in SHARES:
                if pipe.poll():
                    break
                size = [max(int(n * share), 1) for n in view.size]
                pipe.send((asked, share, view.reference.estimate(stage, (size[0], size[1]))))
        except (InputError, RenderError) as error:
            pipe.send((asked, 0.0, str(error)))


def _enlarged(found: Estimate, size: tuple[int, int]) -> Estimate:
    """The estimate at a larger size, each pixel several times."""
    width, height = size

    def enlarged(values: Any) -> Any:
        if values is None:
            return None
        rows = np.arange(height) * values.shape[0] // height
        return np.ascontiguousarray(values[rows][:, np.arange(width) * values.shape[1] // width])

    return Estimate(enlarged(found.M_front), enlarged(found.M_back), enlarged(found.error))
