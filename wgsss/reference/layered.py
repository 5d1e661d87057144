"""The reference `layers`: single scattering in layered media by brute force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from wgsss.bake.samples import Samples
from wgsss.bake.suns import solid_angles, texel_directions
from wgsss.cache import Arrays, cached
from wgsss.console import progress_bar
from wgsss.emitters import DIRECTIONAL, LightValue, emitters
from wgsss.frame import Frame, begin
from wgsss.graph import Graph
from wgsss.reference.estimate import Estimate, Reference
from wgsss.reference.integral import pixel_receivers
from wgsss.reference.layered_medium import LayeredMedium
from wgsss.reference.refracted_light import Boundary
from wgsss.reference.single_scattering import Resolution, SingleScattering
from wgsss.reference.world_surface import WorldSurface
from wgsss.scene.geometry import fibonacci_sphere
from wgsss.stage import Body, Stage

Array = npt.NDArray[Any]

_NODES = 100_000  # points at which the layers are looked up at the same time, about


@dataclass(frozen=True)
class LayeredSingleScattering(Reference):
    """M of light that is scattered once: M = pi L / eta^2 for the radiance L that arrives from inside. M_back is none.

    Line of sight and light are refracted. Along both, the depth below the surface and the texture coordinates are those
    of the closest point of the surface. Interfaces are linear within a step. `error` is the change of M from half the
    steps.
    """

    steps: int = field(
        default=48, metadata={"unit": "", "range": (4, 4096), "help": "number of steps along a line of sight"}
    )
    light_steps: int = field(
        default=24,
        metadata={"unit": "", "range": (2, 4096), "help": "number of steps along the light that reaches a point"},
    )
    sky: int = field(
        default=16,
        metadata={"unit": "", "range": (0, 4096), "help": "number of directional lights in place of environments"},
    )

    source: ClassVar[str] = "Norberg 2010, section 2.1, by brute force"
    sweep: ClassVar[tuple[dict[str, Any], ...]] = ({},)

    def estimate(self, stage: Stage, size: tuple[int, int]) -> Estimate:
        """Return M at `size` (width, height) pixels. Cached.

        Raises InputError for a material of which only the profile is known.
        """
        media = [LayeredMedium(body.material) for body in stage.bodies]

        def compute() -> Arrays:
            return _estimate(stage, size, media, self)

        arrays = cached("layers", _key(stage, size, self), compute)
        return Estimate(arrays["M"], None, arrays["error"])


def _key(stage: Stage, size: tuple[int, int], knobs: LayeredSingleScattering) -> list[object]:
    scene = stage.scene
    still = [replace(body.rest, motion=None, material=replace(body.material, transport=None)) for body in stage.bodies]
    skies = [light.pixels() for light in stage.environments()]
    posed = [body.mesh for body in stage.bodies]
    return [stage.gpu.name, scene.camera, scene.lights, skies, still, posed, size, knobs]


def _estimate(
    stage: Stage, size: tuple[int, int], media: list[LayeredMedium], knobs: LayeredSingleScattering
) -> Arrays:
    width, height = size
    M, error = np.zeros((2, height, width, 3), np.float32)
    surfaces = [WorldSurface(thing) for thing in stage.scene.objects]
    points = np.concatenate([surface.positions for surface in surfaces])
    lights = [*emitters(stage.lights, points).lights, *_sky_lights(stage, knobs.sky)]
    graph = Graph(stage.gpu)
    frame = begin(graph, stage, size)
    pixels = pixel_receivers(frame)
    graph.run(pixels.place, frame.gbuffer.base_color, *frame.rho_dt.values())
    place, color = graph.read(pixels.place), graph.read(frame.gbuffer.base_color)[..., :3]
    if color.dtype == np.uint8:
        color = color / 255.0
    fine, coarse = (Resolution(knobs.steps // n, knobs.light_steps // n) for n in (1, 2))
    total = int((place[..., 3] > 0).sum())
    with progress_bar(total=total, desc="layers", unit=" pixels") as bar:
        for body, medium, surface in zip(stage.bodies, media, surfaces, strict=True):
            here = place[..., 3] == body.index + 1
            if not here.any():
                continue
            table = graph.read(frame.rho_dt_table(body))[0, :, 0].astype(np.float64)
            boundary = Boundary(body.material.eta, body.material.specular, table)
            results = []
            for resolution in (fine, coarse):
                march = SingleScattering(medium, boundary, surface, surfaces, lights, resolution)
                step = max(1, _NODES // (resolution.steps + 1) // (resolution.light_steps + 1))
                shown = bar.update if resolution is fine else lambda count: None
                results.append(_in_parts(march, frame, body, place[here], surface, step, shown))
            to_M = np.pi / body.material.eta**2 * np.asarray(body.material.base_color) * color[here]
            M[here], error[here] = to_M * results[0], to_M * np.abs(results[0] - results[1])
    return {"M": M, "error": error}


def _in_parts(
    march: SingleScattering,
    frame: Frame,
    body: Body,
    place: Array,
    surface: WorldSurface,
    step: int,
    shown: Callable[[int], object],
) -> Array:
    """Return the radiance from inside (N, 3) at pixels with `place` (N, 4), `step` pixels at a time."""
    b = place[:, :2].astype(np.float64)
    samples = Samples(place[:, 2].astype(np.int32), np.column_stack([b, 1.0 - b.sum(axis=1)]), np.zeros(len(b)))
    position, normal = surface.at(samples)
    eye = np.asarray(frame.view.eye, np.float64)
    to_eye = eye[:3] - eye[3] * position
    to_eye = to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True)
    radiance = np.zeros((len(place), 3))
    for first in range(0, len(place), step):
        some = slice(first, first + step)
        radiance[some] = march.radiance(position[some], normal[some], to_eye[some])
        shown(len(position[some]))
    return radiance


def _sky_lights(stage: Stage, count: int) -> list[LightValue]:
    """Return directional lights, `count` at most, with the light of the environments without their suns."""
    if not stage.environments() or count == 0:
        return []
    from scipy.spatial import KDTree

    radiance = stage.environment.rest.astype(np.float64)
    repeats = [-(-least // length) for least, length in zip((64, 128), radiance.shape[:2], strict=True)]
    radiance = radiance.repeat(repeats[0], axis=0).repeat(repeats[1], axis=1)
    rows, columns = radiance.shape[:2]
    row, column = np.indices((rows, columns))
    towards = texel_directions(row, column, rows, columns).reshape(-1, 3)
    irradiance = (radiance * solid_angles(rows, columns)[:, None, None]).reshape(-1, 3)
    directions = fibonacci_sphere(count)
    _, nearest = KDTree(directions).query(towards)
    power = np.zeros((count, 3))
    np.add.at(power, nearest, irradiance)
    none: LightValue = {
        "position": None, "kind": DIRECTIONAL, "power": None, "normal": np.zeros(3), "first_view": 0, "views": 0,
    }  # fmt: skip
    return [
        {**none, "position": direction, "power": light}
        for direction, light in zip(directions, power, strict=True)
        if light.max() > 0.0
    ]
