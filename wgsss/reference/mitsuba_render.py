"""A program that traces paths through scenes with Mitsuba 3. The reference `volume` runs it as a separate process.

Mitsuba's compiler and a software Vulkan device may each load an LLVM library, and two versions of it in one process
crash it. Each line of standard input is a request in JSON, and each line of standard output is the reply. This file
imports nothing of wgsss.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from typing import Any

import numpy as np

_AT_ONCE = 1 << 20  # paths traced at the same time, a few hundred bytes each


class Scenes:
    """Loads each scene file once and traces paths through it."""

    def __init__(self, variant: str) -> None:
        import mitsuba

        mitsuba.set_variant(variant)
        self.mi: Any = mitsuba
        self._loaded: dict[str, Any] = {}
        self._vectorised = not variant.startswith("scalar")

    def trace(self, file: str, rays: Any, paths: int, seed: int) -> dict[str, Any]:
        """Return, for each ray (N, 6), origin and direction, the `mean` radiance of its paths and the mean `square`."""
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
                radiance = self._trace_rays(scene, sampler, some, paths, seed + first // step)
            else:
                radiance = self._trace_ray(scene, sampler, some[0], paths)
            moments[first : first + step, 0] = radiance.mean(axis=1)
            moments[first : first + step, 1] = np.square(radiance).mean(axis=1)
        return {"mean": moments[:, 0], "square": moments[:, 1]}

    def _trace_rays(self, scene: Any, sampler: Any, rays: Any, paths: int, seed: int) -> Any:
        """Return the radiance (rays, paths)."""
        mi = self.mi
        sampler.seed(seed, len(rays) * paths)
        columns = [mi.Float(column) for column in np.repeat(rays, paths, axis=0).astype(np.float32).T]
        ray = mi.RayDifferential3f(mi.Point3f(*columns[:3]), mi.Vector3f(*columns[3:]))
        radiance, _, _ = scene.integrator().sample(scene, sampler, ray)
        return np.array(radiance[0], np.float64).reshape(len(rays), paths)

    def _trace_ray(self, scene: Any, sampler: Any, ray: Any, paths: int) -> Any:
        """Return the radiance (1, paths) of one path after another."""
        mi = self.mi
        ray_of_mitsuba = mi.RayDifferential3f(mi.Point3f(*ray[:3]), mi.Vector3f(*ray[3:]))
        integrator = scene.integrator()
        return np.array([[integrator.sample(scene, sampler, ray_of_mitsuba)[0][0] for _ in range(paths)]])


def main(variant: str) -> None:
    """Reply to requests until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started this one ends it
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # Mitsuba's log goes to standard output
    scenes = Scenes(variant)
    for line in sys.stdin:
        request = json.loads(line)
        try:
            moments = scenes.trace(request["scene"], np.load(request["rays"]), request["paths"], request["seed"])
            np.savez(request["result"], **moments)
            reply = {}
        except Exception as error:
            reply = {"error": " ".join(str(error).split())}
        print(json.dumps(reply), file=replies, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
