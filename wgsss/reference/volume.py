"""The reference `volume`: volumetric path tracing by Mitsuba 3, without a diffusion profile or other model."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.console import progress_bar
from wgsss.errors import InputError, Note
from wgsss.frame import begin
from wgsss.graph import Graph
from wgsss.reference.estimate import Estimate, Reference
from wgsss.reference.mitsuba_grids import VOXELS
from wgsss.reference.mitsuba_paths import Paths
from wgsss.reference.mitsuba_scene import check
from wgsss.stage import Stage

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Volume(Reference):
    """M by volumetric path tracing. M_back is part of M_front.

    The radiance L that leaves towards the camera contains light L_0 that was never scattered: the surface reflected it,
    or it passed straight through. A second rendering, in which the media absorb instead of scattering, gives L_0. The
    rest is converted to M by the equation of our composite pass, L - L_0 = rho_dt / pi M. If no boundary reflects, L_0
    is only the light sources that the camera sees directly, and it is left out.

    Paths start at the centre of a pixel, like the points that our frames shade. Each channel is traced separately.

    Under a uniform sky and without a reflecting boundary, hundreds of paths per pixel are enough. Through a rough
    boundary, small lights need thousands or more. Such a boundary also loses light, because Mitsuba ignores light that
    one facet reflects to another: a white medium of eta 1.5 loses 10 % at a roughness of 0.35, 35 % at 0.6, and nothing
    at 0.02.

    Layers become grids of voxels, with their true sigma_s and g (`mitsuba_grids`). A homogeneous medium scatters
    isotropically with its reduced coefficients.
    """

    samples: int = field(
        default=256, metadata={"unit": "paths", "range": (2, 1 << 20), "help": "number per pixel and channel"}
    )
    bounces: int = field(
        default=0,
        metadata={"unit": "", "range": (0, 1 << 16), "help": "largest number of scattering events; 0 for all"},
    )
    voxels: int = field(
        default=VOXELS,
        metadata={"unit": "", "range": (1000, 1 << 27), "help": "largest number of voxels of an object with layers"},
    )

    source: ClassVar[str] = "Jakob et al. 2022, Mitsuba 3: volumetric path tracing"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = tuple({"samples": n} for n in (64, 256, 1024))

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        """Return M at `size` (width, height) pixels and its standard error.

        Each batch of paths is cached when it is done, so that an interrupted run continues, and a larger number of
        samples adds to the cached ones.

        Raises InputError without Mitsuba, for a limit of bounces with eta above 1, and for scenes that Mitsuba cannot
        represent (`mitsuba_scene.check`). Raises RenderError if Mitsuba fails.
        """
        scene = stage.scene
        if notes := check(scene):
            note = f"{scene.name}: volume differs from our methods: {'; '.join(notes)}"
            warnings.warn(note, Note, stacklevel=2)
        bounded = any(thing.material.eta > 1 for thing in scene.objects)
        if bounded and self.bounces:
            raise InputError(f"{scene.name}: volume counts refractions as scattering: bounces needs materials of eta 1")
        renderings = [(channel, scatters) for channel in range(3) for scatters in ((True, False)[: 1 + bounded])]
        pixels = _Pixels(stage, size)
        scattered, variance = np.zeros((2, len(pixels.rays), 3))
        with (
            Paths(scene, size, pixels.rays, self.bounces, self.voxels) as paths,
            progress_bar(total=len(renderings) * self.samples, desc="volume", unit=" paths/pixel") as bar,
        ):
            for channel, scatters in renderings:
                mean, square = paths.trace(channel, scatters, self.samples, bar)
                scattered[:, channel] += mean if scatters else -mean
                variance[:, channel] += square
        to_M = math.pi / pixels.rho_dt[:, None] * pixels.base_color
        return Estimate(pixels.image(to_M * scattered), None, pixels.image(to_M * np.sqrt(variance)))


class _Pixels:
    """The N pixels whose centre shows a body.

    Attributes:
        rays: (N, 6), the origin of the line of sight, mm, and its direction.
        rho_dt: (N,), towards the camera.
        base_color: (N, 3), of the body.
    """

    def __init__(self, stage: Stage, size: tuple[int, int]) -> None:
        graph = Graph(stage.gpu)
        frame = begin(graph, stage, size)
        graph.run(frame.gbuffer.gbuffer_id, frame.gbuffer.normal, *frame.rho_dt.values())
        body = graph.read(frame.gbuffer.gbuffer_id)[..., 2].astype(int)
        self._mask = body > 0
        body = body[self._mask] - 1
        normal = graph.read(frame.gbuffer.normal)[self._mask].astype(np.float64)
        self.rays = _rays(frame.view.clip_to_world, size)[self._mask]

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
        """Return values (N, 3) as an image, float32 (H, W, 3), with 0 elsewhere."""
        image = np.zeros((*self._mask.shape, 3), np.float32)
        image[self._mask] = values
        return image


def _rays(clip_to_world: Array, size: tuple[int, int]) -> Array:
    """Return the lines through the centres of the pixels, from the near plane: origin and direction (H, W, 6)."""
    x, y = np.meshgrid((np.arange(size[0]) + 0.5) / size[0], (np.arange(size[1]) + 0.5) / size[1])
    ends = []
    for depth in (0.0, 1.0):
        clip = np.stack([2 * x - 1, 1 - 2 * y, np.full_like(x, depth), np.ones_like(x)], axis=-1) @ clip_to_world.T
        ends.append(clip[..., :3] / clip[..., 3:])
    along = ends[1] - ends[0]
    return np.concatenate([ends[0], along / np.linalg.norm(along, axis=-1, keepdims=True)], axis=-1)
