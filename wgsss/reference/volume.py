"""`volume`: the scene itself, by Mitsuba 3, without a diffusion profile or any other model of what happens inside."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.console import progress_bar
from wgsss.errors import Note
from wgsss.frame import begin
from wgsss.graph import Graph
from wgsss.reference.estimate import Estimate, Reference
from wgsss.reference.mitsuba_paths import Paths
from wgsss.reference.mitsuba_scene import check
from wgsss.stage import Stage

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Volume(Reference):
    """M as the light that has been scattered inside makes it, by following paths; M_back is part of M_front.

    Of the radiance L that leaves towards the camera, L_0 never was scattered: the surface reflected it, or it went
    straight through. A second rendering, in which the media absorb what they would scatter, tells it, and what is left
    is read as our frame would show it, L - L_0 = rho_dt / pi M. Where no boundary reflects, L_0 is what the camera sees
    of the lights themselves, and is left out.

    Paths begin in the middle of a pixel, where our frame looks too; each channel is followed on its own.

    Under a uniform sky, hundreds of paths per pixel do where no boundary reflects. Through a rough boundary, small
    lights take thousands and more; and that boundary loses light, as Mitsuba's does not follow what one facet sends to
    another: of a white medium 10 % at an eta of 1.5 and a roughness of 0.35, 35 % at 0.6, nothing at 0.02.
    """

    samples: int = field(
        default=256, metadata={"unit": "paths", "range": (2, 1 << 20), "help": "per pixel and channel"}
    )

    source: ClassVar[str] = "Jakob et al. 2022, Mitsuba 3: volumetric path tracing"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"samples": n} for n in (64, 256, 1024))

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        """M at `size` (width, height) pixels and its standard error. Batches of paths are cached as they come, so that
        a run that was stopped goes on, and more samples add to those there are.

        Raises InputError without Mitsuba, and for scenes that it cannot have (`mitsuba_scene.check`); RenderError where
        it fails.
        """
        scene = stage.scene
        if notes := check(scene):
            note = f"{scene.name}: volume differs from what else we render: {'; '.join(notes)}"
            warnings.warn(note, Note, stacklevel=2)
        bounded = any(thing.material.eta > 1 for thing in scene.objects)
        renderings = [(channel, scatters) for channel in range(3) for scatters in ((True, False)[: 1 + bounded])]
        pixels = _Pixels(stage, size)
        scattered, variance = np.zeros((2, len(pixels.rays), 3))
        with (
            Paths(scene, size, pixels.rays) as paths,
            progress_bar(total=len(renderings) * self.samples, desc="volume", unit=" paths/pixel") as bar,
        ):
            for channel, scatters in renderings:
                mean, square = paths.follow(channel, scatters, self.samples, bar)
                scattered[:, channel] += mean if scatters else -mean
                variance[:, channel] += square
        to_M = math.pi / pixels.rho_dt[:, None] * pixels.base_color
        return Estimate(pixels.image(to_M * scattered), None, pixels.image(to_M * np.sqrt(variance)))


class _Pixels:
    """The pixels (N) in whose middle a body is seen.

    Attributes:
        rays: (N, 6), where the line of sight begins, mm, and its direction.
        rho_dt: (N,), towards the camera.
        base_color: (N, 3), of the body.
    """

    def __init__(self, stage: Stage, size: tuple[int, int]) -> None:
        graph = Graph(stage.gpu)
        frame = begin(graph, stage, size)
        tables = {key: table for key, table in frame.rho_dt.items()}
        graph.run(frame.gbuffer.gbuffer_id, frame.gbuffer.normal, *tables.values())
        body = graph.read(frame.gbuffer.gbuffer_id)[..., 2].astype(int)
        self._seen = body > 0
        body = body[self._seen] - 1
        normal = graph.read(frame.gbuffer.normal)[self._seen].astype(np.float64)
        self.rays = _rays(frame.view.clip_to_world, size)[self._seen]

        towards = -np.einsum("ij,ij->i", normal[:, :3], self.rays[:, 3:]) / np.linalg.norm(normal[:, :3], axis=1)
        entry = np.sqrt(np.clip(towards, 0.0, 1.0))  # as the tables are laid out: wgsl/rho_dt.wgsl
        self.rho_dt, self.base_color = np.ones(len(body)), np.ones((len(body), 3))
        for index, thing in enumerate(stage.bodies):
            of = body == index
            table = graph.read(frame.rho_dt_table(thing))[0, :, 0]
            reflected = 1.0 - np.interp(entry[of], np.linspace(0.0, 1.0, len(table)), table)
            self.rho_dt[of] = 1.0 - normal[of, 3] * reflected
            self.base_color[of] = thing.material.base_color

    def image(self, values: Array) -> Array:
        """Values (N, 3) as float32 (H, W, 3), 0 elsewhere."""
        image = np.zeros((*self._seen.shape, 3), np.float32)
        image[self._seen] = values
        return image


def _rays(clip_to_world: Array, size: tuple[int, int]) -> Array:
    """(H, W, 6): the lines through the middles of the pixels, from where the view begins."""
    x, y = np.meshgrid((np.arange(size[0]) + 0.5) / size[0], (np.arange(size[1]) + 0.5) / size[1])
    ends = []
    for depth in (0.0, 1.0):
        clip = np.stack([2 * x - 1, 1 - 2 * y, np.full_like(x, depth), np.ones_like(x)], axis=-1) @ clip_to_world.T
        ends.append(clip[..., :3] / clip[..., 3:])
    along = ends[1] - ends[0]
    return np.concatenate([ends[0], along / np.linalg.norm(along, axis=-1, keepdims=True)], axis=-1)
