"""Follows paths through scenes with Mitsuba 3: a program of its own, which `volume` runs and talks to.

It is a process apart since Mitsuba's compiler and a software Vulkan device may each bring an LLVM, and two of different
versions end a process. Orders come as lines of JSON on standard input, one answer each on standard output. Nothing of
wgsss is imported here.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from typing import Any

import numpy as np

_AT_ONCE = 1 << 20  # paths; a few hundred bytes each


class Scenes:
    """Scenes by their file, loaded once."""

    def __init__(self, variant: str) -> None:
        import mitsuba

        mitsuba.set_variant(variant)
        self.mi: Any = mitsuba
        self._loaded: dict[str, Any] = {}
        self._vectorised = not variant.startswith("scalar")

    def follow(self, file: str, rays: Any, paths: int, seed: int) -> dict[str, Any]:
        """Per ray (N, 6), origin and direction, the `mean` radiance of its paths and the mean of its `square`."""
        if file not in self._loaded:
            self._loaded[file] = self.mi.load_file(file)
        scene = self._loaded[file]
        moments = np.zeros((len(rays), 2))
        step = max(1, _AT_ONCE // paths) if self._vectorised else 1
        sampler = self.mi.load_dict({"type": "independent"})
        if not self._vectorised:
            sampler.seed(seed)
        for first in range(0, len(rays), step):
            some = rays[first : first + step]
            if self._vectorised:
                found = self._together(scene, sampler, some, paths, seed + first // step)
            else:
                found = self._singly(scene, sampler, some[0], paths)
            moments[first : first + step, 0] = found.mean(axis=1)
            moments[first : first + step, 1] = np.square(found).mean(axis=1)
        return {"mean": moments[:, 0], "square": moments[:, 1]}

    def _together(self, scene: Any, sampler: Any, rays: Any, paths: int, seed: int) -> Any:
        """Radiance (rays, paths)."""
        mi = self.mi
        sampler.seed(seed, len(rays) * paths)
        columns = [mi.Float(column) for column in np.repeat(rays, paths, axis=0).astype(np.float32).T]
        ray = mi.RayDifferential3f(mi.Point3f(*columns[:3]), mi.Vector3f(*columns[3:]))
        radiance, _, _ = scene.integrator().sample(scene, sampler, ray)
        return np.array(radiance[0], np.float64).reshape(len(rays), paths)

    def _singly(self, scene: Any, sampler: Any, ray: Any, paths: int) -> Any:
        mi = self.mi
        along = mi.RayDifferential3f(mi.Point3f(*ray[:3]), mi.Vector3f(*ray[3:]))
        integrator = scene.integrator()
        return np.array([[integrator.sample(scene, sampler, along)[0][0] for _ in range(paths)]])


def main(variant: str) -> None:
    """Answer orders until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started us ends us
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # Mitsuba's log goes to standard output
    scenes = Scenes(variant)
    for line in sys.stdin:
        order = json.loads(line)
        try:
            found = scenes.follow(order["scene"], np.load(order["rays"]), order["paths"], order["seed"])
            np.savez(order["result"], **found)
            answer = {}
        except Exception as error:
            answer = {"error": " ".join(str(error).split())}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
