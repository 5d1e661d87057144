"""Light at the surface of a medium and where it is scattered, as the shaders compute it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.emitters import DIRECTIONAL, PATCH, LightValue

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Boundary:
    """The refracting surface of a medium."""

    eta: float
    specular: float
    rho_dt_table: Array
    """(n,): rho_dt for a specular lobe of scale 1, as wgsl/rho_dt.wgsl lays it out"""

    def rho_dt(self, cosine: Array) -> Array:
        """Return the share of light that enters at cosines (N,) from the normal."""
        entry = np.sqrt(np.clip(cosine, 0.0, 1.0))
        table = np.interp(entry, np.linspace(0.0, 1.0, len(self.rho_dt_table)), self.rho_dt_table)
        share: Array = 1.0 - self.specular * (1.0 - table)
        return share

    def refracted(self, outside: Array, normal: Array) -> tuple[Array, Array]:
        """Return the directions (N, 3) inside of light along unit directions outside, and their cosines (N,).

        All directions point away from the medium.
        """
        cosine = np.clip(np.einsum("nd,nd->n", outside, normal), 1e-4, 1.0)
        inside_cosine = np.sqrt(1.0 - (1.0 - cosine**2) / self.eta**2)
        inside = outside / self.eta + (inside_cosine - cosine / self.eta)[:, None] * normal
        return inside / np.linalg.norm(inside, axis=1, keepdims=True), inside_cosine


def incident(light: LightValue, x: Array) -> tuple[Array, Array, Array]:
    """Return directions (N, 3) towards a light, irradiance (N, 3) of a surface that faces it, and distances, mm.

    This is `incident` of wgsl/light.wgsl.
    """
    power = np.broadcast_to(np.asarray(light["power"], np.float64), x.shape)
    if light["kind"] == DIRECTIONAL:
        direction = np.broadcast_to(np.asarray(light["position"], np.float64), x.shape)
        return direction, power, np.full(len(x), np.inf)
    to_light = light["position"] - x
    distance = np.maximum(np.linalg.norm(to_light, axis=1), 1e-6)
    direction = to_light / distance[:, None]
    irradiance = power / np.square(distance / 1000.0)[:, None]
    if light["kind"] == PATCH:
        irradiance = irradiance * np.maximum(-direction @ light["normal"], 0.0)[:, None]
    return direction, irradiance, distance


def henyey_greenstein(cosine: Any, g: Any) -> Array:
    """Return the phase function of Henyey and Greenstein, 1/sr, at the cosine of the angle of deflection."""
    phase: Array = (1.0 - g**2) / (4.0 * np.pi * (1.0 + g**2 - 2.0 * g * cosine) ** 1.5)
    return phase
