"""Converts the lights and the camera of a mesh file to those of a scene."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from wgsss.errors import InputError, Note
from wgsss.scene.bodies import LoadedFile
from wgsss.scene.camera import Camera, OrthographicCamera, PerspectiveCamera
from wgsss.scene.light import DirectionalLight, Light, PointLight
from wgsss.scene.repair import counted
from wgsss.scene.scene import Object
from wgsss.scene.tables import at

MM_PER_METRE = 1000.0
NARROWEST, WIDEST = 0.05, 170.0  # degrees, of a camera's view


def lights_of(file: LoadedFile) -> list[Light]:
    """Convert all lights of a file to lights of a scene, with lengths in mm.

    If the unit of the file is scaled to a length other than a metre, intensities of point lights are scaled too, so
    that the irradiance on the mesh stays the same. Raises InputError naming a light whose values are out of range.
    """
    scale = file.bodies[0].mm_per_unit
    lights: list[Light] = []
    for light in file.lights:
        try:
            if light.kind == "directional":
                lights.append(DirectionalLight(light.direction, light.power))
            else:
                intensity = np.asarray(light.power) * (scale / MM_PER_METRE) ** 2
                lights.append(PointLight(_triple(np.asarray(light.position) * scale), _triple(intensity)))
        except InputError as error:
            raise at(light.name, error) from None
    return lights


def camera_in(file: LoadedFile, things: Sequence[Object]) -> Camera | None:
    """Convert the first camera of a file, with lengths in mm. Returns None if there is none.

    Its target is the point on its axis that is nearest to the middle of the objects, so that it turns about them.
    """
    if not file.cameras:
        return None
    seen, scale = file.cameras[0], file.bodies[0].mm_per_unit
    points = np.concatenate([thing.placed for thing in things])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    eye, forward = np.asarray(seen.eye) * scale, np.asarray(seen.forward)
    ahead = float((middle - eye) @ forward)
    target = eye + max(ahead, float(np.ptp(points, axis=0).max()), 1e-3) * forward
    place: dict[str, Any] = {"eye": _triple(eye), "target": _triple(target), "up": seen.up}
    try:
        if seen.height is not None:
            return OrthographicCamera(**place, height=seen.height * scale)
        return PerspectiveCamera(**place, fov=min(max(seen.fov or 0.0, NARROWEST), WIDEST))
    except InputError as error:
        raise at(seen.name, error) from None


def note_unused(where: str, count: int, what: str, why: str) -> None:
    """Warn that `count` lights or cameras of a mesh file are not used, with the reason or a hint."""
    if count:
        note = f"{where}: {counted(count, what)} of the file {'is' if count == 1 else 'are'} not used{why}"
        warnings.warn(note, Note, stacklevel=3)


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
