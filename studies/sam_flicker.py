"""Measure how much M_back flickers when a shadow's edge crosses senders, and how much blending over time removes.

python studies/sam_flicker.py statue

A sun turns by 40 degrees in one second, at 60 frames per second. Flicker is the RMS of the second difference in time
of M_back at vertices, divided by the RMS of M_back. It is measured from 0.2 s on, when blending has settled, and is
also given as a multiple of the flicker of the sum over all vertices on the back side. Blending (Maisch & Ropinski
2017, eq. 17, 18) delays changes: `off` is the relative RMSE against that sum at the same time.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from sam_errors import M_back, sums
from tqdm import tqdm

from wgsss.bake.samples import vertex_samples
from wgsss.gpu import default_gpu
from wgsss.methods.sam.method import SamTranslucency
from wgsss.reference.convergence import irradiance_at
from wgsss.scene import DirectionalLight, load_scene
from wgsss.stage import Stage

TURN, SECONDS, SETTLED = 40.0, 1.0, 0.2
MAPS = tuple((select, samples) for select in ("top", "fit") for samples in (3, 8, 20))


def flicker(M: np.ndarray) -> float:
    """Compute the flicker of M (frames, vertices, 3)."""
    return float(np.sqrt(np.square(np.diff(M, n=2, axis=0)).mean() / np.square(M).mean()))


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    add = parser.add_argument
    add("scene", nargs="?", default="statue", help="a built-in scene")
    add("--vertices", type=int, default=20_000)
    add("--receivers", type=int, default=500, help="number of vertices at which M_back is measured")
    add("--rate", type=int, default=60, help="frames per second")
    args = parser.parse_args(argv)

    scene = load_scene(args.scene, vertices=args.vertices).at(0.0)  # only the light moves
    stage = Stage(default_gpu(), scene)
    body = stage.bodies[0]
    times = np.arange(round(args.rate * SECONDS) + 1) / args.rate
    everywhere = vertex_samples(body.mesh)
    chosen = np.sort(np.random.default_rng(1).permutation(len(everywhere.face))[: args.receivers])

    def shine(time_s: float) -> None:
        """Turn the sun to its direction at a time."""
        angle = math.radians(150.0 + TURN * time_s / SECONDS)
        sun = DirectionalLight((math.sin(angle), -0.4, -math.cos(angle)), (1, 1, 1))
        stage.rest = replace(scene, lights=(sun,))

    def frames(label: str, look: Callable[[], np.ndarray], *, blended: bool) -> np.ndarray:
        values = []
        for time_s in tqdm(times, desc=label, disable=None):
            shine(time_s)
            stage.pose(time_s if blended else 0.0)  # frames of one time are not blended
            values.append(look())
        return np.array(values)

    light = frames("light", lambda: irradiance_at(body, everywhere), blended=False)
    truth = sums(body, light, chosen)[times >= SETTLED]
    print("map      flicker  of the sum's  off    blended  of the sum's  off")
    print(f"all      {100 * flicker(truth):5.2f} %", flush=True)
    for select, samples in MAPS:
        method = SamTranslucency(samples=samples, select=select)
        cells = []
        for blended in (False, True):
            M = frames(f"{select} {samples}", lambda m=method: M_back(stage, m)[chosen], blended=blended)
            M = M[times >= SETTLED]
            off = np.sqrt(np.square(M - truth).mean() / np.square(truth).mean())
            cells.append(f"{100 * flicker(M):5.2f} %  {flicker(M) / flicker(truth):12.1f}  {off:.3f}")
        print(f"{select:5} {samples:2}", *cells, sep="  ", flush=True)


if __name__ == "__main__":
    main()
