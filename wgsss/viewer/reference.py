"""Estimation of a reference in the background: a separate process refines it while the window stays responsive."""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from queue import SimpleQueue
from threading import Thread
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.errors import InputError, RenderError
from wgsss.reference import Estimate, Reference
from wgsss.scene import Scene
from wgsss.stage import Stage

SCALES = (0.25, 0.5, 1.0)
"""sizes of the successive estimates, relative to the sides of the picture"""
PROCESS_ENDED = "the process that estimates references has ended"


@dataclass(frozen=True)
class Request:
    """What to estimate: a scene at a time, by a reference, at a size in pixels."""

    scene: Scene
    time_s: float
    size: tuple[int, int]
    reference: Reference


_Numbered = tuple[int, Request]
"""a request and its number, which the process sends back with each answer"""


class BackgroundReference:
    """Keeps the best estimate so far for the latest request.

    The process sends estimates of increasing size, see SCALES. It starts with the first request, and again with the
    next request after it has ended.
    """

    def __init__(self) -> None:
        self._request: Request | None = None
        self._number = 0
        """of the latest request"""
        self._estimate: Estimate | None = None
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None
        self._queue: SimpleQueue[_Numbered] = SimpleQueue()
        """requests that a thread passes on to the process"""
        self.scale = 0.0
        """size of the estimate, relative to the sides of the picture; 0: there is none yet"""
        self.error_message = ""
        """why there is no estimate; empty: no error"""

    def estimate(self, request: Request) -> Estimate | None:
        """Return the best estimate so far, enlarged to the requested size, or None if there is none yet.

        A request that differs from the last one replaces it.
        """
        if request != self._request:
            self._start(request)
        while not self.error_message and self._pipe is not None and self._pipe.poll():
            try:
                number, scale, answer = self._pipe.recv()
            except (EOFError, OSError):
                self.error_message = PROCESS_ENDED
                break
            if number != self._number:
                continue
            if isinstance(answer, str):
                self.error_message = answer
            else:
                self._estimate, self.scale = _enlarge(answer, request.size), scale
        return self._estimate

    @property
    def is_refining(self) -> bool:
        """Whether a better estimate will come."""
        return self._request is not None and self.scale < 1.0 and not self.error_message

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.terminate()
            self._process.join()

    def _start(self, request: Request) -> None:
        """Discard the estimate and hand a new request to the process."""
        if self._process is None or not self._process.is_alive():
            context = multiprocessing.get_context("spawn")
            self._pipe, remote = context.Pipe()
            self._process = context.Process(target=_estimate_requests, args=(remote,), daemon=True)
            self._process.start()
            remote.close()  # with the process the only owner of this end, reading fails once the process has ended
            self._queue = SimpleQueue()
            Thread(target=_send_latest, args=(self._pipe, self._queue), daemon=True).start()
        self._request, self._estimate, self.scale, self.error_message = request, None, 0.0, ""
        self._number += 1
        self._queue.put((self._number, request))


def _send_latest(pipe: Connection, queue: SimpleQueue[_Numbered]) -> None:
    """Send requests to the process, in a thread of their own, and skip those that a newer one has replaced.

    The process reads the pipe only between estimates. Sending blocks while the pipe is full, for longer than a window
    can wait.
    """
    while True:
        request = queue.get()
        while not queue.empty():
            request = queue.get()
        try:
            pipe.send(request)
        except OSError:
            return


def _estimate_requests(pipe: Connection) -> None:
    """Run the process: estimate each request at increasing sizes, until the next request arrives."""
    from wgsss.gpu import default_gpu

    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # hides the progress bars
    while True:
        try:
            number, request = pipe.recv()
        except EOFError:
            return
        try:
            stage = Stage(default_gpu(), request.scene, request.time_s)
            for scale in SCALES:
                if pipe.poll():
                    break
                width, height = (max(int(n * scale), 1) for n in request.size)
                pipe.send((number, scale, request.reference.estimate(stage, (width, height))))
        except (InputError, RenderError) as error:
            pipe.send((number, 0.0, str(error)))


def _enlarge(estimate: Estimate, size: tuple[int, int]) -> Estimate:
    """Return an estimate at a larger size (width, height): each pixel takes the value of the nearest one above left."""
    width, height = size

    def repeat(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        rows = np.arange(height) * values.shape[0] // height
        return np.ascontiguousarray(values[rows][:, np.arange(width) * values.shape[1] // width])

    M_back = None if estimate.M_back is None else repeat(estimate.M_back)
    return Estimate(repeat(estimate.M_front), M_back, repeat(estimate.error))
