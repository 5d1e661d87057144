"""Measure the error of M_back by spatial adjacency maps against the sum over all vertices on the back side.

The scripts beside this one use it. None of its lights is among the training lights of `fit`.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from tqdm import trange

from wgsss.bake.sam.form_factors import FormFactors
from wgsss.bake.samples import vertex_samples
from wgsss.frame import begin
from wgsss.gpu import default_gpu
from wgsss.graph import Graph
from wgsss.methods.sam.method import SamTranslucency
from wgsss.reference.convergence import converged, irradiance_at
from wgsss.scene import DirectionalLight, EnvironmentLight, Scene
from wgsss.stage import Body, Stage

SUNS = [DirectionalLight(towards, (1, 1, 1)) for towards in ((2, -3, -6), (-6, -2, 3), (3, 6, 2), (0.3, 0.1, 1))]
SKY = EnvironmentLight((1, 1, 1))
PAIRS = 2_000_000
"""largest number of pairs whose form factors are integrated at once"""


class Errors:
    """The errors of M_back under suns and under a sky, estimated at random vertices of a scene's first object.

    Hardly any light crosses most parts of a thick object. Vertices are therefore drawn with a probability that grows
    with their M_back; one in ten is drawn uniformly. Each vertex is weighted by the inverse of its probability.
    """

    def __init__(self, scene: Scene, receivers: int) -> None:
        self.stages = [Stage(default_gpu(), replace(scene, lights=(light,))) for light in (*SUNS, SKY)]
        self.vertices = vertex_samples(scene.objects[0].mesh)
        self.chosen, self.share = self._drawn(receivers)
        bodies = [stage.bodies[0] for stage in self.stages]
        self.truth = sums(bodies[0], [irradiance_at(body, self.vertices) for body in bodies], self.chosen)

    def _drawn(self, receivers: int) -> tuple[np.ndarray, np.ndarray]:
        """Draw vertices (k,) and compute the weight of each (k,)."""
        power = np.square(M_back(self.stages[-1], SamTranslucency())).sum(axis=1, dtype=np.float64)
        p = 0.9 * power / max(power.sum(), 1e-30) + 0.1 / len(power)
        drawn = np.random.default_rng(1).choice(len(p), receivers, p=p / p.sum())
        chosen, times = np.unique(drawn, return_counts=True)
        return chosen, times / p[chosen]

    def of(self, select: str, samples: int) -> tuple[float, float]:
        """Compute the relative RMSE of a selection: the mean under the suns, and the value under the sky."""
        method = SamTranslucency(samples=samples, select=select)
        return self._relative([M_back(stage, method)[self.chosen] for stage in self.stages], self.truth)

    def of_the_sum(self) -> tuple[float, float]:
        """Compute the relative RMSE of the sum, which takes L_d as constant over a fan, against the integral."""
        places = replace(self.vertices, **{name: v[self.chosen] for name, v in vars(self.vertices).items()})
        bodies = [stage.bodies[0] for stage in self.stages]
        integrals = [converged(b, places, b.profile, 0.05, 1_000_000).back for b in bodies]
        return self._relative(self.truth, integrals)

    def _relative(self, estimates: Sequence[np.ndarray], truth: Sequence[np.ndarray]) -> tuple[float, float]:
        def power(values: np.ndarray) -> float:
            return float((self.share[:, None] * np.square(values)).sum())

        *suns, sky = (np.sqrt(power(e - t) / power(t)) for e, t in zip(estimates, truth, strict=True))
        return float(np.mean(suns)), float(sky)


def sums(body: Body, L_d: Sequence[np.ndarray], receivers: np.ndarray) -> np.ndarray:
    """Compute M_back, W/m^2 (lights, receivers, 3), as the sum over all vertices on the back side of each receiver.

    Form factors are those of Maisch & Ropinski 2017, eq. 11, back sides those of eq. 13 and 14.
    """
    x, n = body.mesh.positions.astype(np.float64), body.mesh.normals.astype(np.float64)
    factors = FormFactors(body.stage.gpu, body.mesh, body.profile)
    light = np.stack(L_d).astype(np.float64)
    totals = np.zeros((len(light), len(receivers), 3))
    at_once = max(PAIRS // len(x), 1)
    for first in trange(0, len(receivers), at_once, desc="sums over all senders", disable=None):
        o = receivers[first : first + at_once]
        row, i = np.nonzero((x @ n[o].T < (x[o] * n[o]).sum(axis=1)).T & (n[o] @ n.T < 0.0))
        K = factors.of(np.stack([o[row], i], axis=1)).astype(np.float64)
        starts = np.searchsorted(row, np.arange(len(o) + 1))
        for k, (a, b) in enumerate(pairwise(starts), first):
            totals[:, k] = np.einsum("kc,lkc->lc", K[a:b], light[:, i[a:b]])
    return totals


def M_back(stage: Stage, method: SamTranslucency) -> np.ndarray:
    """Render M_back, W/m^2 (V, 3), at the vertices of the first object."""
    graph, body = Graph(stage.gpu), stage.bodies[0]
    gpu_map = method.gpu_map(body)
    if gpu_map is None:  # nothing shines through
        return np.zeros((len(body.mesh.positions), 3))
    values = method.M_back_at_vertices(begin(graph, stage, (8, 8)), body, gpu_map)
    graph.run(values)
    return graph.read(values)[:, :3]
