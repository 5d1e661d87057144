"""Prefiltered environments: the irradiance for each normal, and the mean radiance for each mirror direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.suns import Sun, take_suns
from wgsss.cache import cached
from wgsss.gpu import Gpu
from wgsss.graph import Graph, Handle
from wgsss.scene import DirectionalLight, EnvironmentLight, Material

IRRADIANCE_SIZE = (128, 64)  # texels: the cosine removes finer detail
REFLECTION_SIZE = (128, 64)
_SOURCE_SIZE = (128, 64)
NO_SKY = np.zeros((1, 1, 3), np.float32)
_ROOTS = (-14, 15)  # exponents of the powers of 2 within the range of half floats


@dataclass(frozen=True)
class Prefiltered:
    """Textures over directions (`map_of_direction` in wgsl/sampling.wgsl).

    RGB is in units of alpha squared, since half floats end at 65504.
    """

    irradiance: Any
    """L_d by normal, W/m^2"""
    reflection: Any
    """mean radiance by mirror direction, W/(m^2 sr)"""


@dataclass(frozen=True)
class SplitEnvironment:
    """The light of environments, divided into directional lights and a smooth rest, which is prefiltered."""

    suns: tuple[DirectionalLight, ...]
    rest: npt.NDArray[np.float32]
    """radiance (H, W, 3), W/(m^2 sr), as of `summed_radiance`, without the suns"""


def rho_dt_table(graph: Graph, material: Material) -> Handle:
    """Declare the pass that tabulates rho_dt over the cosine for a material (Maisch & Ropinski 2017, eq. 3)."""
    params = {"alpha": material.roughness**2, "eta": material.eta}
    return graph.dispatch("frame/rho_dt", size=(64, 1), params=params, label=f"{material.roughness:g} {material.eta:g}")


def prefilter(gpu: Gpu, pixels: npt.NDArray[np.float32], material: Material) -> Prefiltered:
    """Prefilter radiance (H, W, 3), as of `summed_radiance`, for the surface of a material. Cached."""
    if not pixels.any():
        black = gpu.texture(np.zeros((1, 1, 4)), "rgba16float")
        return Prefiltered(black, black)
    constant = bool((pixels == pixels[0, 0]).all())
    root = 2.0 ** min(max(math.ceil(0.5 * math.log2(pixels.max())), _ROOTS[0]), _ROOTS[1])

    def make() -> dict[str, npt.NDArray[Any]]:
        graph = Graph(gpu)
        source = gpu.texture(np.dstack([pixels, np.ones(pixels.shape[:2])]), "rgba32float")
        table = rho_dt_table(graph, material)
        irradiance = graph.dispatch(
            "frame/prefilter_irradiance",
            size=(1, 1) if constant else IRRADIANCE_SIZE,
            params={"specular": material.specular, "root": root},
            environment=source,
            rho_dt_table=table,
        )
        reflection = graph.dispatch(
            "frame/prefilter_reflection",
            size=(1, 1) if constant else REFLECTION_SIZE,
            params={"alpha": material.roughness**2, "root": root},
            environment=source,
        )
        graph.run(irradiance, reflection)
        return {"irradiance": graph.read(irradiance), "reflection": graph.read(reflection)}

    # The key has only the parameters of the surface: a change of the medium or the colour needs no new maps.
    key = [pixels, material.roughness, material.eta, material.specular, gpu.name]
    maps = cached("environment", key, make, label="filtering the environment")
    return Prefiltered(*(gpu.texture(maps[name], "rgba16float") for name in ("irradiance", "reflection")))


def split_environments(lights: Sequence[EnvironmentLight]) -> SplitEnvironment:
    """Divide environments into the suns of their images (`take_suns`) and the rest of their light."""
    suns: list[DirectionalLight] = []
    rests = []
    for light in lights:
        image_suns, rest = take_suns(light.pixels())
        suns += [_light(sun, light.rotation) for sun in image_suns]
        rests.append(rest)
    return SplitEnvironment(tuple(suns), _total(lights, rests))


def summed_radiance(lights: Sequence[EnvironmentLight]) -> npt.NDArray[np.float32]:
    """Return the summed_radiance radiance of all environments, float32 (H, W, 3), W/(m^2 sr), as prefilters read it.

    It has the size 128 x 64, or 32 x 16 if all environments are constant.
    """
    return _total(lights, [light.pixels() for light in lights])


def _total(lights: Sequence[EnvironmentLight], images: Sequence[npt.NDArray[np.float32]]) -> npt.NDArray[np.float32]:
    """Return the sum of the images (H, W, 3), each rotated as its light."""
    total = np.zeros((16, 32, 3), np.float32)
    for light, pixels in zip(lights, images, strict=True):
        if (pixels == pixels[0, 0]).all():
            total = total + pixels[0, 0]
            continue
        turned = _reduced(pixels, light.rotation)
        total = turned + (total[0, 0] if total.shape != turned.shape else total)
    return total


def _light(sun: Sun, rotation: float) -> DirectionalLight:
    """Return a sun of an image as a directional light. `rotation`, degrees, is that of its EnvironmentLight."""
    turn = math.radians(rotation)
    x, y, z = sun.towards
    away = (-(x * math.cos(turn) + z * math.sin(turn)), -y, -(z * math.cos(turn) - x * math.sin(turn)))
    return DirectionalLight(away, tuple(float(E) for E in sun.irradiance))  # type: ignore[arg-type]


def _reduced(pixels: npt.NDArray[Any], rotation: float) -> npt.NDArray[np.float32]:
    """Reduce an image (H, W, 3) to the source size, rotated by `rotation` degrees. Texels are means over their area."""
    width, height = _SOURCE_SIZE
    # The solid angle between two latitudes is in proportion to the difference of their cosines.
    edges = np.cos(np.linspace(0.0, np.pi, len(pixels) + 1))
    new_edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    rows = np.empty((height, *pixels.shape[1:]))
    for i in range(height):
        overlap = np.minimum(edges[:-1], new_edges[i]) - np.maximum(edges[1:], new_edges[i + 1])
        here = np.flatnonzero(overlap > 0.0)
        share = overlap[here] / overlap[here].sum()
        rows[i] = (share[:, None, None] * pixels[here]).sum(axis=0)
    # Along a row, the mean over a texel is a difference of the row's integral, which is continued periodically.
    integral = np.concatenate([np.zeros((height, 1, 3)), np.cumsum(rows, axis=1)], axis=1)
    at = (np.arange(width + 1) / width + rotation / 360.0) * rows.shape[1]
    turns, within = np.divmod(at, rows.shape[1])
    left = np.minimum(within.astype(int), rows.shape[1] - 1)
    value = integral[:, left] + rows[:, left] * (within - left)[:, None] + turns[:, None] * integral[:, -1:]
    return np.maximum(np.diff(value, axis=1) * (width / rows.shape[1]), 0.0).astype(np.float32)
