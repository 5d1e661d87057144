"""Where a method's error against volumetric transport comes from.

Between a method and the volume stand three integrals of 000 eq. 5: with the profile that the method was given, with the
profile that photons tell of the same material, and the same with many suns in place of the sky, whose shadows are as
sharp as any. Each step of that chain has one cause.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.bake.environment import summed
from wgsss.errors import InputError
from wgsss.optics import Profile
from wgsss.scene import DirectionalLight, EnvironmentLight, Scene
from wgsss.stage import Stage

Array = npt.NDArray[Any]

MEANINGS = {
    "method": "how the integral is approximated",
    "profile": "how R was modelled",
    "occlusion": "L_d knows the environment's shadows by what is baked at vertices",
    "diffusion": "light below a curved surface is not that below a plane; also all else, and the volume's own error",
}
CAUSES = tuple(MEANINGS)
"""from the method to the volume, one for each step of the chain"""
PHOTONS = 1_000_000
"""traced per channel, for the profile that is not modelled"""
SUNS = 96
"""directions that stand for an environment which casts shadows: each needs a shadow map, of which 256 are possible"""


@dataclass(frozen=True)
class Causes:
    """The error of one method by cause, as shares of the root mean square of the reference.

    `own` is the rel_rmse of each step alone; `part` is what the step adds to `total`, the method's rel_rmse: its
    projection on the whole difference. Parts sum to the total, and are negative where one error makes up for another.
    """

    total: float
    own: dict[str, float]
    part: dict[str, float]

    def json(self) -> dict[str, Any]:
        return {"total": self.total, "own": self.own, "part": self.part}


def causes(
    scene: Scene,
    methods: Mapping[str, Array],
    volume: Array,
    seen: Array,
    size: tuple[int, int],
    time: float = 0.0,
) -> dict[str, Causes]:
    """Split the errors of `methods`, M (H, W, 3) by name, against the M of volumetric transport where `seen` (H, W).

    None where that is black. Raises InputError where a material is known by its profile only.
    """
    if not volume[seen].any():
        return {}
    between = chain(scene, size, time)
    return {name: split([M, *between, volume], seen) for name, M in methods.items()}


def chain(scene: Scene, size: tuple[int, int], time: float = 0.0) -> list[Array]:
    """M (H, W, 3) by the integral with the materials' profiles, with those of photons, and under a sky with shadows."""
    from wgsss.gpu import default_gpu
    from wgsss.reference.integral import integral

    photons = photon_profiles(scene)
    stage = Stage(default_gpu(), scene, time)
    by_model, by_photons = integral(stage, size).M, integral(stage, size, profiles=photons).M
    shadowed = shadowing(scene)
    if shadowed is scene:
        return [by_model, by_photons, by_photons]
    return [by_model, by_photons, integral(Stage(default_gpu(), shadowed, time), size, profiles=photons).M]


def split(steps: list[Array], seen: Array) -> Causes:
    """The difference between the first and the last of `steps`, by the steps between them: one for each of CAUSES."""
    values = [np.asarray(step, np.float64)[seen] for step in steps]
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
    """The profile of each object's material, by the object's index, as PHOTONS photons tell it.

    They enter from everywhere, as L_d does not tell from where: on balls, even under a beam, that is nearer to volume
    than a right angle (studies/spheres.py).

    Raises InputError where a material is known by its profile only.
    """
    from wgsss.reference.photons import trace

    traced: dict[int, Profile] = {}
    for item in scene.objects:
        material = item.material
        if material.stack is None:
            raise InputError(f"material '{material.name}' is known by its profile only, which has no volume")
        if id(material) not in traced:
            traced[id(material)] = trace(material.stack, PHOTONS, sky=True, label=f"photons in {material.name}")
    return {index: traced[id(item.material)] for index, item in enumerate(scene.objects)}


def shadowing(scene: Scene) -> Scene:
    """The scene with many suns in place of its environments: these cast shadows. The scene itself, if it has none."""
    skies = [light for light in scene.lights if isinstance(light, EnvironmentLight)]
    if not skies:
        return scene
    towards, irradiance = suns(skies)
    lights: list[Any] = [light for light in scene.lights if light not in skies]
    lights += [DirectionalLight(tuple(-w), tuple(E)) for w, E in zip(towards, irradiance, strict=True) if E.max() > 0.0]
    return replace(scene, lights=tuple(lights))


def suns(skies: list[EnvironmentLight]) -> tuple[Array, Array]:
    """Directions towards SUNS suns (N, 3), evenly spread, and the irradiance of each (N, 3): each has the light of all
    that is nearest to it."""
    i = np.arange(SUNS) + 0.5
    y, phi = 1.0 - 2.0 * i / SUNS, math.pi * (3.0 - math.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - y * y)
    towards = np.stack([ring * np.sin(phi), y, ring * np.cos(phi)], axis=1)
    pixels = summed(skies).astype(np.float64)
    if (pixels == pixels[0, 0]).all():
        return towards, np.tile(4.0 * math.pi / SUNS * pixels[0, 0], (SUNS, 1))
    height, width = pixels.shape[:2]
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    sine, around = np.sin(math.pi * v), 2.0 * math.pi * (u - 0.5)  # see EnvironmentLight
    direction = np.stack([sine * np.sin(around), np.cos(math.pi * v), -sine * np.cos(around)], axis=-1)
    power = pixels * (sine * (math.pi / height) * (2.0 * math.pi / width))[..., None]
    irradiance = np.zeros((SUNS, 3))
    np.add.at(irradiance, np.argmax(direction @ towards.T, axis=-1), power)
    return towards, irradiance


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values.size else 0.0
