"""Environments, prefiltered: what each normal receives, and what each mirror direction reflects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.cache import KeyPart, cached
from wgsss.gpu import Gpu
from wgsss.graph import Graph, Handle
from wgsss.scene import EnvironmentLight, Material

IRRADIANCE_SIZE = (64, 32)  # the cosine leaves nothing finer
REFLECTION_SIZE = (128, 64)
_SOURCE_SIZE = (128, 64)
_FLOAT16_MAX = 65504.0


@dataclass(frozen=True)
class Prefiltered:
    """Textures over latitude and longitude: L_d by normal, W/m^2, and mean radiance by mirror direction, W/(m^2 sr)."""

    irradiance: Any
    reflection: Any


def rho_dt_table(graph: Graph, material: Material) -> Handle:
    """rho_dt over the cosine for a material's surface (Maisch & Ropinski 2017, eq. 3)."""
    params = {"alpha": material.roughness**2, "eta": material.eta}
    return graph.dispatch("frame/rho_dt", size=(64, 1), params=params, label=f"{material.roughness:g} {material.eta:g}")


def prefilter(gpu: Gpu, lights: Sequence[EnvironmentLight], material: Material) -> Prefiltered:
    """The sum of all environments, prefiltered for a material's surface; black where there are none."""
    pixels = summed(lights)
    if not pixels.any():
        black = gpu.texture(np.zeros((1, 1, 4)), "rgba16float")
        return Prefiltered(black, black)
    constant = bool((pixels == pixels[0, 0]).all())

    def make() -> dict[str, npt.NDArray[Any]]:
        graph = Graph(gpu)
        source = gpu.texture(np.dstack([pixels, np.ones(pixels.shape[:2])]), "rgba32float")
        table = rho_dt_table(graph, material)
        irradiance = graph.dispatch(
            "frame/prefilter_irradiance",
            size=(1, 1) if constant else IRRADIANCE_SIZE,
            params={"specular": material.specular},
            environment=source,
            rho_dt_table=table,
        )
        reflection = graph.dispatch(
            "frame/prefilter_reflection",
            size=(1, 1) if constant else REFLECTION_SIZE,
            params={"alpha": material.roughness**2},
            environment=source,
        )
        graph.run(irradiance, reflection)
        return {"irradiance": graph.read(irradiance), "reflection": graph.read(reflection)}

    key: list[KeyPart] = [pixels, material.roughness, material.eta, material.specular]
    code = ("frame/prefilter_irradiance", "frame/prefilter_reflection", "frame/rho_dt")
    maps = cached("environment", key, make, code=code, label="filtering the environment")
    return Prefiltered(*(gpu.texture(maps[name], "rgba16float") for name in ("irradiance", "reflection")))


def summed(lights: Sequence[EnvironmentLight]) -> npt.NDArray[np.float32]:
    """All environments added up, at the resolution that the filters read; 32 x 16 where constant."""
    total = np.zeros((16, 32, 3), np.float32)
    for light in lights:
        pixels = light.pixels()
        if pixels.shape[:2] == (1, 1):
            total = total + pixels
            continue
        turned = np.roll(_reduced(pixels), -round(light.rotation / 360 * _SOURCE_SIZE[0]), axis=1)
        total = turned + (total[0, 0] if total.shape != turned.shape else total)
    return np.minimum(total, _FLOAT16_MAX)


def _reduced(pixels: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Box-filtered to the source size; smaller images are repeated texel by texel."""
    width, height = _SOURCE_SIZE
    for axis, size in ((0, height), (1, width)):
        n = pixels.shape[axis]
        repeats = -(-size // n)
        pixels = np.repeat(pixels, repeats, axis) if n % size else pixels
        edges = np.linspace(0, pixels.shape[axis], size + 1).astype(int)[:-1]
        counts = np.diff([*edges, pixels.shape[axis]])
        pixels = np.add.reduceat(pixels, edges, axis) / counts.reshape([-1 if a == axis else 1 for a in range(3)])
    return pixels.astype(np.float32)
