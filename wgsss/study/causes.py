"""The causes of a method's error against volumetric transport.

Three integrals of Maisch & Ropinski 2017, eq. 5, lie between a method and the volume. The first uses the profile that
the method uses. The second uses the profile that photons give for the same material. The third also replaces the sky by
many directional lights, whose shadows are sharp. Each step of this chain has one cause.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.environment import summed_radiance
from wgsss.errors import InputError
from wgsss.optics import Profile
from wgsss.scene import DirectionalLight, EnvironmentLight, Scene
from wgsss.scene.geometry import fibonacci_sphere
from wgsss.scene.light import Light
from wgsss.stage import Stage

Array = npt.NDArray[Any]

MEANINGS = {
    "method": "how the method approximates the integral",
    "profile": "how the diffusion profile R was modelled",
    "occlusion": "L_d takes the shadows of the environment from values baked at vertices",
    "diffusion": "light below a curved surface spreads differently than below a plane; also includes all other causes "
    "and the volume's own error",
}
CAUSES = tuple(MEANINGS)
"""In the order from the method to the volume, one for each step of the chain."""
PHOTONS = 1_000_000
"""Number of photons per channel for the profile that replaces the modelled one."""
SUNS = 96
"""Number of directional lights that replace an environment. Each needs a shadow map, and there can be 256."""


@dataclass(frozen=True)
class Causes:
    """The error of one method by cause, as shares of the root mean square of the reference.

    `own` is the rel_rmse of each step alone. `part` is what the step contributes to `total`, the method's rel_rmse: the
    projection of the step on the whole difference. The parts sum to the total. A part is negative if the step
    compensates another error.
    """

    total: float
    own: dict[str, float]
    part: dict[str, float]

    def json(self) -> dict[str, float | dict[str, float]]:
        return {"total": self.total, "own": self.own, "part": self.part}


def causes(
    scene: Scene,
    methods: Mapping[str, Array],
    volume: Array,
    mask: Array,
    size: tuple[int, int],
    time: float = 0.0,
) -> dict[str, Causes]:
    """Split the errors of `methods`, M (H, W, 3) by name, against the M of volumetric transport where `mask` (H, W).

    Returns nothing if the volume is black. Raises InputError if a material is known by its profile only.
    """
    if not volume[mask].any():
        return {}
    between = chain(scene, size, time)
    return {name: split([M, *between, volume], mask) for name, M in methods.items()}


def chain(scene: Scene, size: tuple[int, int], time: float = 0.0) -> list[Array]:
    """Return three integrals M (H, W, 3).

    They use the materials' profiles, then the profiles of photons, then these under a sky that casts shadows.
    """
    from wgsss.gpu import default_gpu
    from wgsss.reference.integral import integral

    photons = photon_profiles(scene)
    stage = Stage(default_gpu(), scene, time)
    by_model, by_photons = integral(stage, size).M, integral(stage, size, profiles=photons).M
    shadowed = with_suns(scene)
    if shadowed is scene:
        return [by_model, by_photons, by_photons]
    return [by_model, by_photons, integral(Stage(default_gpu(), shadowed, time), size, profiles=photons).M]


def split(steps: list[Array], mask: Array) -> Causes:
    """Split the difference between the first and the last of `steps` into the steps, one for each of CAUSES."""
    values = [np.asarray(step, np.float64)[mask] for step in steps]
    rms = _rms(values[-1])
    whole = values[0] - values[-1]
    total = _rms(whole)
    own, part = {}, {}
    for cause, before, after in zip(CAUSES, values[:-1], values[1:], strict=True):
        step = before - after
        own[cause] = _rms(step) / rms
        part[cause] = float(np.mean(step * whole)) / total / rms if total > 0.0 else 0.0
    return Causes(total / rms, own, part)


def photon_profiles(scene: Scene) -> dict[int, Profile]:
    """Trace PHOTONS photons through the material of each object, and return the profiles by the object's index.

    The photons enter from all directions, because L_d does not depend on the direction. On balls, even under a beam,
    that is closer to the volume than photons that enter at a right angle (studies/spheres.py).

    Raises InputError if a material is known by its profile only.
    """
    from wgsss.bake.photons import trace

    traced: dict[int, Profile] = {}
    for item in scene.objects:
        material = item.material
        if material.stack is None:
            raise InputError(f"material '{material.name}' is known by its profile only, which has no volume")
        if id(material) not in traced:
            traced[id(material)] = trace(material.stack, PHOTONS, sky=True, label=f"photons in {material.name}")
    return {index: traced[id(item.material)] for index, item in enumerate(scene.objects)}


def with_suns(scene: Scene) -> Scene:
    """Replace the environments of a scene by many directional lights, which cast shadows.

    A scene without environments is returned itself.
    """
    skies = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    if not skies:
        return scene
    towards, irradiance = suns(skies)
    lights: list[Light] = [light for light in scene.lights if light not in skies]
    lights += [DirectionalLight(tuple(-w), tuple(E)) for w, E in zip(towards, irradiance, strict=True) if E.max() > 0.0]
    return replace(scene, lights=tuple(lights))


def suns(skies: list[EnvironmentLight]) -> tuple[Array, Array]:
    """Return SUNS evenly spread directions towards suns (N, 3) and the irradiance of each (N, 3).

    Each sun has the light of all pixels that are nearest to it.
    """
    towards = fibonacci_sphere(SUNS)
    pixels = summed_radiance(skies).astype(np.float64)
    if (pixels == pixels[0, 0]).all():
        return towards, np.tile(4.0 * math.pi / SUNS * pixels[0, 0], (SUNS, 1))
    height, width = pixels.shape[:2]
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    sine, azimuth = np.sin(math.pi * v), 2.0 * math.pi * (u - 0.5)  # see EnvironmentLight
    direction = np.stack([sine * np.sin(azimuth), np.cos(math.pi * v), -sine * np.cos(azimuth)], axis=-1)
    power = pixels * (sine * (math.pi / height) * (2.0 * math.pi / width))[..., None]
    irradiance = np.zeros((SUNS, 3))
    np.add.at(irradiance, np.argmax(direction @ towards.T, axis=-1), power)
    return towards, irradiance


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values.size else 0.0
