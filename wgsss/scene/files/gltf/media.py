"""Conversion between the volume extensions of glTF materials and the coefficients of a medium, in both directions.

KHR_materials_volume defines the attenuation, which includes absorption and scattering. KHR_materials_volume_scatter or
its successor KHR_materials_scatter (drafts of the Khronos Group) defines the multi-scattering albedo: the colour that
remains after many scattering events (Kulla & Conty 2017, "Revisiting Physically Based Shading at Imageworks").
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from wgsss.scene.files.contents import Medium
from wgsss.scene.files.gltf.fields import Item
from wgsss.scene.files.gltf.notes import Notes

Array = npt.NDArray[Any]

VOLUME, SCATTER, VOLUME_SCATTER = "KHR_materials_volume", "KHR_materials_scatter", "KHR_materials_volume_scatter"

# The fit of Kulla & Conty: s = A + B r - sqrt(C + D r + E r^2) for the colour r; the reduced albedo is 1 - s^2.
_A, _B, _C, _D, _E = 4.09712, 4.20863, 9.59217, 41.6808, 17.7126
# Bounds of the coefficients, 1/m. Scattering below 1e-3 per metre would be invisible in any object.
_LEAST, _MOST = 1e-3, 1e9


def read_medium(material: Item, notes: Notes) -> Medium | None:
    """Read the medium of a material, in 1/m. Return None if it has none, or, with a note, if nothing scatters in it."""
    volume = material.extension(VOLUME)
    name = next((n for n in (SCATTER, VOLUME_SCATTER) if material.extension(n) is not None), None)
    scatter = None if name is None else material.extension(name)
    if volume is None or scatter is None:
        if name is not None or volume is not None:
            reason = "nothing scatters in it" if name is None else f"it needs {VOLUME}"
            notes.add(f"{name or VOLUME} left out because {reason}: used by", "material")
        return None
    for key in ("multiscatterColorTexture", "scatterStrengthTexture", "scatterTexture"):
        if scatter.has(key):
            notes.add(f"{key} of {name} left out: used by", "material")
    color = _scatter_color(scatter, successor=name == SCATTER)
    # Walls are thin by default only in the successor: examples of the older draft have no thicknessFactor.
    if name == SCATTER and volume.number("thicknessFactor", 0.0, low=0) == 0:
        notes.add(f"{name} left out because its walls are thin (thicknessFactor 0): used by", "material")
        return None
    distance = volume.number("attenuationDistance", math.inf, low=0) if volume.has("attenuationDistance") else math.inf
    attenuation = np.clip(volume.numbers("attenuationColor", 3, (1.0, 1.0, 1.0)), 0, 1)
    if not distance > 0 or not color.any() or not (attenuation < 1).any() or math.isinf(distance):
        notes.add(f"{name} left out because nothing scatters in it: used by", "material")
        return None
    with np.errstate(divide="ignore", over="ignore"):
        sigma_t = np.minimum(-np.log(attenuation) / distance, _MOST)
    g = min(max(scatter.number("scatterAnisotropy", 0.0), -0.999), 0.999)
    return _medium(sigma_t, color, g)


def _scatter_color(scatter: Item, successor: bool) -> Array:
    """Read the multi-scattering albedo (3,), 0 to 1, which has different names in the drafts."""
    white, black = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
    key = "multiscatterColorFactor" if scatter.has("multiscatterColorFactor") else "multiscatterColor"
    color = np.clip(scatter.numbers(key, 3, white if successor else black), 0, 1)
    if not successor:
        return color
    key = "scatterStrengthFactor" if scatter.has("scatterStrengthFactor") else "scatterFactor"
    return color * scatter.number(key, 0.0, low=0, high=1)


def _medium(sigma_t: Array, color: Array, g: float) -> Medium:
    """Compute a medium from attenuation (3,), 1/m, multi-scattering albedo (3,) and anisotropy g."""
    s2 = np.maximum(_A + _B * color - np.sqrt(_C + _D * color + _E * color**2), 0) ** 2
    sigma_s = sigma_t * np.clip((1 - s2) / (1 - g * s2), 0, 1)
    scattering = np.clip((1 - g) * sigma_s, _LEAST, _MOST)
    absorption = sigma_t * np.clip(s2 * (1 - g) / (1 - g * s2), 0, 1)
    return Medium(_triple(absorption), _triple(scattering))


def written(sigma_a: Array, sigma_s_prime: Array) -> tuple[dict[str, Any], dict[str, Any]]:
    """Compute the values of KHR_materials_volume and KHR_materials_volume_scatter from coefficients (3,) in 1/m.

    Scattering is isotropic. The attenuation distance is the distance at which the densest channel falls to 1/e. The
    caller adds the thickness.
    """
    sigma_t = sigma_a + sigma_s_prime
    distance = 1 / float(sigma_t.max())
    s = np.sqrt(sigma_a / sigma_t)
    # The fit, solved for r: (B^2 - E) r^2 + (2 B (A - s) - D) r + (A - s)^2 - C = 0, where B^2 - E is almost 0.
    a, b, c = _B**2 - _E, 2 * _B * (_A - s) - _D, (_A - s) ** 2 - _C
    color = np.clip(2 * c / (-b + np.sqrt(b**2 - 4 * a * c)), 0, 1)
    volume = {"attenuationDistance": distance, "attenuationColor": np.exp(-sigma_t * distance).tolist()}
    return volume, {"multiscatterColor": color.tolist()}


def _triple(values: Array) -> tuple[float, float, float]:
    red, green, blue = values.tolist()
    return red, green, blue
