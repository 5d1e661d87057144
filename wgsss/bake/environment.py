"""Environments, prefiltered: what each normal receives, and what each mirror direction reflects."""

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

IRRADIANCE_SIZE = (128, 64)  # the cosine leaves little that is finer
REFLECTION_SIZE = (128, 64)
_SOURCE_SIZE = (128, 64)
NO_SKY = np.zeros((1, 1, 3), np.float32)
_ROOTS = (-14, 15)  # powers of two that a half float holds


@dataclass(frozen=True)
class Prefiltered:
    """Textures over directions (`map_of_direction`, wgsl/sampling.wgsl): L_d by normal, W/m^2, and mean radiance by
    mirror direction, W/(m^2 sr). RGB is in units of alpha squared: half floats hold no more than 65504."""

    irradiance: Any
    reflection: Any


@dataclass(frozen=True)
class Divided:
    """The light of environments: what is lit by as by any light, and what is prefiltered."""

    suns: tuple[DirectionalLight, ...]
    rest: npt.NDArray[np.float32]
    """as `summed` gives it, without the suns"""


def rho_dt_table(graph: Graph, material: Material) -> Handle:
    """rho_dt over the cosine for a material's surface (Maisch & Ropinski 2017, eq. 3)."""
    params = {"alpha": material.roughness**2, "eta": material.eta}
    return graph.dispatch("frame/rho_dt", size=(64, 1), params=params, label=f"{material.roughness:g} {material.eta:g}")


def prefilter(gpu: Gpu, pixels: npt.NDArray[np.float32], material: Material) -> Prefiltered:
    """Radiance of the source size, prefiltered for a material's surface; black where there is none."""
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

    # Only what the surface does counts, so that no filter runs anew for another medium or colour below it.
    key = [pixels, material.roughness, material.eta, material.specular, gpu.name]
    maps = cached("environment", key, make, label="filtering the environment")
    return Prefiltered(*(gpu.texture(maps[name], "rgba16float") for name in ("irradiance", "reflection")))


def divided(lights: Sequence[EnvironmentLight]) -> Divided:
    """Environments, the suns of their images (`take_suns`) apart from the rest."""
    suns: list[DirectionalLight] = []
    rests = []
    for light in lights:
        found, rest = take_suns(light.pixels())
        suns += [_light(sun, light.rotation) for sun in found]
        rests.append(rest)
    return Divided(tuple(suns), _total(lights, rests))


def summed(lights: Sequence[EnvironmentLight]) -> npt.NDArray[np.float32]:
    """The radiance of all environments added up, at the resolution that the filters read; 32 x 16 where constant."""
    return _total(lights, [light.pixels() for light in lights])


def _total(lights: Sequence[EnvironmentLight], images: Sequence[npt.NDArray[np.float32]]) -> npt.NDArray[np.float32]:
    total = np.zeros((16, 32, 3), np.float32)
    for light, pixels in zip(lights, images, strict=True):
        if (pixels == pixels[0, 0]).all():
            total = total + pixels[0, 0]
            continue
        turned = _reduced(pixels, light.rotation)
        total = turned + (total[0, 0] if total.shape != turned.shape else total)
    return total


def _light(sun: Sun, rotation: float) -> DirectionalLight:
    """A sun of an image that is turned, see EnvironmentLight."""
    turn = math.radians(rotation)
    x, y, z = sun.towards
    away = (-(x * math.cos(turn) + z * math.sin(turn)), -y, -(z * math.cos(turn) - x * math.sin(turn)))
    return DirectionalLight(away, tuple(float(E) for E in sun.irradiance))  # type: ignore[arg-type]


def _reduced(pixels: npt.NDArray[Any], rotation: float) -> npt.NDArray[np.float32]:
    """The mean radiance over each texel of the source size, turned by `rotation` degrees."""
    width, height = _SOURCE_SIZE
    edges = np.cos(np.linspace(0.0, np.pi, len(pixels) + 1))  # solid angle goes by the cosine
    wanted = np.cos(np.linspace(0.0, np.pi, height + 1))
    rows = np.empty((height, *pixels.shape[1:]))
    for i in range(height):
        overlap = np.minimum(edges[:-1], wanted[i]) - np.maximum(edges[1:], wanted[i + 1])
        here = np.flatnonzero(overlap > 0.0)
        share = overlap[here] / overlap[here].sum()
        rows[i] = (share[:, None, None] * pixels[here]).sum(axis=0)
    # Along a row, from its integral, which goes on periodically.
    integral = np.concatenate([np.zeros((height, 1, 3)), np.cumsum(rows, axis=1)], axis=1)
    at = (np.arange(width + 1) / width + rotation / 360.0) * rows.shape[1]
    turns, within = np.divmod(at, rows.shape[1])
    left = np.minimum(within.astype(int), rows.shape[1] - 1)
    value = integral[:, left] + rows[:, left] * (within - left)[:, None] + turns[:, None] * integral[:, -1:]
    return np.maximum(np.diff(value, axis=1) * (width / rows.shape[1]), 0.0).astype(np.float32)
